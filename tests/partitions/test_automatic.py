"""The partition chosen for an environment, and the bounds that random steps find."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import FlattenObservation, TransformObservation
from gymnasium.wrappers.vector import FlattenObservation as FlattenVectorObservation

from acl_gym import Crisp, Discrete, Fuzzy, ScaledObservation, automatic_partition
from acl_gym.partitions.automatic import CENTRES, thesis_partition
from acl_gym.partitions.bounds import estimate_bounds

PENDULUM = "acl_gym/Pendulum-v0"
INF = float("inf")


def made(env_id: str, way: str, slots: int = 3, **parameters: Any) -> Any:
    if way == "single":
        return gym.make(env_id, **parameters)
    mode = None if way == "native" else way
    return gym.make_vec(env_id, slots, vectorization_mode=mode, **parameters)


WAYS = pytest.mark.parametrize("way", ["single", "native", "sync"])


class Fixed(gym.Env):
    """Any observation space; it is never stepped."""

    def __init__(self, space: Any) -> None:
        self.observation_space, self.action_space = space, spaces.Discrete(2)


class Clock(gym.Env):
    """Observes (t, -2 t, 7, what it was seeded with and a random number) to t = 5."""

    def __init__(self, low: float = -INF, high: float = INF) -> None:
        self.observation_space = spaces.Box(low, high, (4,), np.float64)
        self.action_space = spaces.Discrete(3)

    def _observe(self) -> np.ndarray:
        t = float(self.t)
        return np.array([t, -2.0 * t, 7.0, self.np_random.normal() + self.action])

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.t = self.action = 0
        return self._observe(), {}

    def step(self, action: Any) -> Any:
        assert self.t < 5, "an episode was stepped beyond its end"
        self.t += 1
        self.action = int(action)
        return self._observe(), -1.0, self.t == 5, False, {}


def clocks(mode: str, slots: int = 3, **parameters: Any) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: Clock(**parameters)] * slots, autoreset_mode=mode)


# --- what is chosen ------------------------------------------------------------


@pytest.mark.parametrize("way", ["single", "sync"])
@pytest.mark.parametrize(
    ("env_id", "states"),
    [("FrozenLake-v1", 16), ("CliffWalking-v1", 48), ("Taxi-v4", 500)],
)
def test_discrete_observations_are_cells(env_id: str, states: int, way: str) -> None:
    env = made(env_id, way)
    partition = automatic_partition(env)
    assert isinstance(partition, Discrete)
    assert partition.settings() == {"type": "Discrete", "sizes": states, "starts": 0}
    seen = np.atleast_1d(env.reset(seed=0)[0])
    assert partition(seen)[0][:, 0].tolist() == seen.tolist()


@pytest.mark.parametrize(
    "space", [spaces.MultiDiscrete([2, 3], start=[1, 0]), spaces.MultiBinary(3)]
)
def test_other_finite_observations_are_cells(space: Any) -> None:
    partition = automatic_partition(Fixed(space))
    assert isinstance(partition, Discrete)
    partition.check_space(space)


@WAYS
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_the_pendulum_gets_the_centres_of_the_thesis(kind: Any, way: str) -> None:
    env = made(PENDULUM, way, omega_max=7.0)
    partition = automatic_partition(env, kind=kind)
    expected = thesis_partition(env, kind=kind)
    assert partition.settings() == expected.settings()
    # A number of centres of one's own, round the same circle.
    own = automatic_partition(env, kind=kind, cells=(6, 7))
    space = gym.make(PENDULUM, omega_max=7.0).observation_space
    assert own.settings() == kind.from_box(space, (6, 7), circular=[0]).settings()
    narrow = automatic_partition(env, kind=kind, bounds={1: (-2.0, 2.0)})
    assert isinstance(narrow, kind)
    assert [axis.size for axis in narrow.centres] == [42, 41]
    assert narrow.centres[1][[0, -1]].tolist() == [-2.0, 2.0]
    assert narrow.periods == (2 * np.pi, None)


def test_a_wrapped_pendulum_is_taken_as_it_is_seen() -> None:
    env = ScaledObservation(gym.make(PENDULUM), circular=[0])
    partition = automatic_partition(env)
    assert isinstance(partition, Fuzzy)
    assert [axis.size for axis in partition.centres] == [15] * 3
    assert partition.periods == (None,) * 3
    partition.check_space(env.observation_space)


def test_navigation_gets_the_centres_of_the_thesis() -> None:
    env = gym.make("acl_gym/Navigation-v0")
    for kind in (Crisp, Fuzzy):
        expected = thesis_partition(env, "regular", kind=kind).settings()
        assert automatic_partition(env, kind=kind).settings() == expected
    # Where the vehicle may go further, the centres of the thesis do not reach.
    wide = gym.make("acl_gym/Navigation-v0", position_max=10.0)
    expected = Fuzzy.from_box(wide.observation_space, 7).settings()
    assert automatic_partition(wide).settings() == expected


@pytest.mark.parametrize("d", range(1, 7))
def test_the_more_variables_the_fewer_centres(d: int) -> None:
    space = spaces.Box(np.arange(d) - 3.0, np.arange(d) + 1.0, dtype=np.float64)
    partition = automatic_partition(Fixed(space))
    assert partition.n_cells == CENTRES[d] ** d <= 3400
    assert partition.settings() == Fuzzy.from_box(space, CENTRES[d]).settings()
    assert CENTRES[d] % 2 == 1
    middle = (space.low + space.high)[None] / 2
    assert partition(middle)[1].max() > 1.0 - 1e-12


@pytest.mark.parametrize("way", ["single", "sync"])
@pytest.mark.parametrize(
    ("env_id", "cells"), [("MountainCar-v0", [41] * 2), ("Acrobot-v1", [3] * 6)]
)
def test_bounded_environments_of_gymnasium(env_id: str, cells: Any, way: str) -> None:
    env = made(env_id, way)
    partition = automatic_partition(env)
    assert isinstance(partition, Fuzzy)
    assert [axis.size for axis in partition.centres] == cells
    observation, _ = env.reset(seed=0)
    _, degree = partition(np.atleast_2d(observation))
    np.testing.assert_allclose(degree.sum(axis=1), 1.0, atol=1e-12)


def test_cells_and_bounds_are_as_asked() -> None:
    env = gym.make("MountainCar-v0")
    partition = automatic_partition(
        env, kind=Crisp, cells=[5, 3], bounds={np.int64(1): (-0.01, 0.02)}
    )
    assert isinstance(partition, Crisp)
    np.testing.assert_allclose(partition.centres[0], np.linspace(-1.2, 0.6, 5))
    np.testing.assert_allclose(partition.centres[1], [-0.01, 0.005, 0.02])
    many = Fixed(spaces.Box(0.0, 1.0, (9,)))
    assert automatic_partition(many, kind=Crisp, cells=2).n_cells == 2**9


def test_a_variable_that_cannot_change_has_one_centre() -> None:
    space = spaces.Box(np.array([0.0, 3.0]), np.array([1.0, 3.0]), dtype=np.float64)
    partition = automatic_partition(Fixed(space))
    assert isinstance(partition, Fuzzy)
    assert [axis.size for axis in partition.centres] == [41, 1]


# --- what has no bounds --------------------------------------------------------


@WAYS
def test_variables_without_bounds_are_reported_with_both_remedies(way: str) -> None:
    env = made("CartPole-v1", way)
    with pytest.raises(ValueError, match=r"variables 1, 3;") as error:
        automatic_partition(env)
    for remedy in ("bounds={1: (low, high), 3: (low, high)}", "random_steps=10_000"):
        assert remedy in str(error.value)
    with pytest.raises(ValueError, match=r"for variables 3;"):
        automatic_partition(env, bounds={1: (-3, 3)})


@WAYS
def test_cart_pole_with_bounds_given(way: str) -> None:
    env = made("CartPole-v1", way)
    partition = automatic_partition(env, bounds={1: (-3, 3), 3: (-3.5, 3.5)})
    assert isinstance(partition, Fuzzy)
    assert [axis.size for axis in partition.centres] == [7] * 4
    ends = [axis[[0, -1]].tolist() for axis in partition.centres]
    assert ends[1:4:2] == [[-3.0, 3.0], [-3.5, 3.5]]
    np.testing.assert_allclose(ends[0], [-4.8, 4.8])


@WAYS
def test_cart_pole_with_bounds_estimated(way: str) -> None:
    env = made("CartPole-v1", way)
    partition, again = (automatic_partition(env, random_steps=600) for _ in range(2))
    assert isinstance(partition, Fuzzy)
    assert partition.settings() == again.settings()
    seen = estimate_bounds(env, 600)
    for axis in (1, 3):
        ends = partition.centres[axis][[0, -1]]
        np.testing.assert_allclose(ends, [seen.low[axis], seen.high[axis]])
        assert -6.0 < ends[0] < -0.5
        assert 0.5 < ends[1] < 6.0
    # What has bounds keeps them.
    np.testing.assert_allclose(partition.centres[0][[0, -1]], [-4.8, 4.8])
    other = automatic_partition(env, random_steps=600, seed=1)
    assert other.settings() != partition.settings()


@pytest.mark.parametrize("bound", [INF, 3.4e38, 1e31])
def test_the_largest_floats_are_no_bounds(bound: float) -> None:
    with pytest.raises(ValueError, match=r"without bounds for variables 0, 1, 2, 3;"):
        automatic_partition(Clock(-bound, bound))


def test_only_the_end_that_is_missing_is_estimated() -> None:
    low, high = np.full(4, -INF), np.full(4, INF)
    low[0], high[1], low[2], high[2] = -20.0, 30.0, 0.0, 9.0
    env = Clock()
    env.observation_space = spaces.Box(low, high, dtype=np.float64)
    partition = automatic_partition(env, random_steps=50)
    assert isinstance(partition, Fuzzy)
    ends = [axis[[0, -1]].tolist() for axis in partition.centres[:3]]
    assert ends == [[-20.0, 6.25], [-12.5, 30.0], [0.0, 9.0]]


def test_a_variable_that_never_changed_needs_bounds() -> None:
    with pytest.raises(ValueError, match=r"but \[2\] never changed in 50"):
        automatic_partition(Clock(), random_steps=50)
    given = automatic_partition(Clock(), random_steps=50, bounds={2: (0.0, 9.0)})
    assert given.n_cells == 7**4


# --- random steps --------------------------------------------------------------


@pytest.mark.parametrize("mode", [None, "NextStep", "SameStep", "Disabled"])
def test_the_range_seen_is_widened_in_every_mode(mode: str | None) -> None:
    env = Clock() if mode is None else clocks(mode)
    low, high = estimate_bounds(env, 60)
    # t runs from 0 to 5, the last included; a quarter of the range on either side.
    assert low[:3].tolist() == [-1.25, -12.5, 7.0]
    assert high[:3].tolist() == [6.25, 2.5, 7.0]
    again = estimate_bounds(env, 60, seed=0)
    np.testing.assert_array_equal([low, high], again)
    assert (estimate_bounds(env, 60, seed=1).low[3] != low[3]).all()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_this_packages_environments_in_every_mode(mode: str) -> None:
    env = gym.make_vec(PENDULUM, 4, autoreset_mode=mode, max_episode_steps=7)
    low, high = estimate_bounds(env, 200)
    assert -1.6 * np.pi < low[0] < 0.0
    assert 2 * np.pi < high[0] < 3.1 * np.pi
    assert (np.abs([low[1], high[1]]) < 13.6).all()


def test_steps_of_all_slots_together_are_counted(monkeypatch: Any) -> None:
    counts = []
    step = Clock.step
    monkeypatch.setattr(Clock, "step", lambda *a: counts.append(1) or step(*a))
    estimate_bounds(Clock(), 17)
    assert len(counts) == 17
    counts.clear()
    estimate_bounds(clocks("Disabled", slots=5), 18)
    assert len(counts) == 15


def test_the_environments_own_action_space_is_left_alone() -> None:
    one, other = clocks("NextStep"), clocks("NextStep")
    for env in (one, other):
        env.action_space.seed(3)
    estimate_bounds(one, 30)
    assert one.action_space.sample().tolist() == other.action_space.sample().tolist()


def test_bounded_environments_are_not_stepped() -> None:
    env = gym.make("MountainCar-v0")
    automatic_partition(env, random_steps=100)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)


def test_observations_that_are_not_finite_are_reported(monkeypatch: Any) -> None:
    bad = lambda self: np.array([0.0, np.nan, 0.0, 0.0])  # noqa: E731
    monkeypatch.setattr(Clock, "_observe", bad)
    with pytest.raises(ValueError, match=r"must be finite, got \[0.0, nan"):
        estimate_bounds(clocks("NextStep"), 10)


@pytest.mark.parametrize("steps", [0, 2, -1, 2.5, "many", True])
def test_bad_numbers_of_steps_are_refused(steps: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="random_steps must be"):
        automatic_partition(clocks("NextStep"), random_steps=steps)
    with pytest.raises((TypeError, ValueError), match="seed must be"):
        automatic_partition(Clock(), random_steps=5, seed=-1)


# --- what is refused -----------------------------------------------------------


@pytest.mark.parametrize(
    "space",
    [
        spaces.Dict({"x": spaces.Discrete(2)}),
        spaces.Tuple([spaces.Discrete(2)]),
        spaces.Text(3),
    ],
)
def test_spaces_without_cells_are_refused(space: Any) -> None:
    with pytest.raises(TypeError, match=r"observations must be a Box, .*Transform"):
        automatic_partition(Fixed(space))
    if not isinstance(space, spaces.Text):
        with pytest.raises(TypeError, match="observations must be a Box"):
            estimate_bounds(Fixed(space), 10)


@pytest.mark.parametrize(
    "space",
    [spaces.Box(0, 255, (8, 8, 3), np.uint8), spaces.Box(0, 1, (2, 2))],
)
def test_images_and_tables_are_refused(space: Any) -> None:
    with pytest.raises(ValueError, match=r"one axis of variables.*FlattenObservation"):
        automatic_partition(Fixed(space))


def test_flattened_tables_are_taken() -> None:
    env = FlattenObservation(Fixed(spaces.Box(0, 1, (2, 2))))
    assert automatic_partition(env).n_cells == 7**4
    vector = SyncVectorEnv([lambda: Fixed(spaces.Box(0, 1, (2, 2)))] * 2)
    assert automatic_partition(FlattenVectorObservation(vector)).n_cells == 7**4


def test_too_many_variables_are_refused_and_a_choice_of_them_taken() -> None:
    env = Fixed(spaces.Box(-INF, INF, (7,)))
    with pytest.raises(ValueError, match=r"1 to 6 variables.*got 7.*2\^d = 128"):
        automatic_partition(env, random_steps=100)
    chosen = TransformObservation(env, lambda x: x[:2], spaces.Box(-1, 1, (2,)))
    assert automatic_partition(chosen).n_cells == 41**2


@pytest.mark.parametrize("env", [None, "CartPole-v1", gym.make, Fuzzy([[0.0]])])
def test_what_is_no_environment_is_refused(env: Any) -> None:
    for use in (automatic_partition, lambda env: estimate_bounds(env, 10)):
        with pytest.raises(TypeError, match="env must be a Gymnasium environment"):
            use(env)


@pytest.mark.parametrize(
    "bounds",
    [
        {2: (0, 1)},
        {-1: (0, 1)},
        {0.5: (0, 1)},
        {"x": (0, 1)},
        {True: (0, 1)},
        {0: (1, 0)},
        {0: (1, 1)},
        {0: (0, 1, 2)},
        {0: (0,)},
        {0: 1},
        {0: None},
        {0: (0, INF)},
        {0: ("0", "1")},
        [(0, 1), (0, 1)],
        (0, 1),
    ],
    ids=str,
)
def test_bad_bounds_are_refused(bounds: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=r"bounds(\[0\])? must"):
        automatic_partition(gym.make("MountainCar-v0"), bounds=bounds)


def test_the_period_of_a_circle_is_not_a_choice() -> None:
    with pytest.raises(ValueError, match="bounds must not be of circular variables"):
        automatic_partition(gym.make(PENDULUM), bounds={0: (0.0, 1.0)})


@pytest.mark.parametrize("cells", [0, [3], [3, 3, 3], 2.5, "3", [3, None]])
def test_bad_cells_are_refused(cells: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=r"cells(\[\d\])? must be"):
        automatic_partition(gym.make("MountainCar-v0"), cells=cells)


@pytest.mark.parametrize("given", [{"cells": 3}, {"bounds": {0: (0, 1)}}])
def test_cells_of_discrete_observations_are_not_a_choice(given: Any) -> None:
    with pytest.raises(ValueError, match="cells and bounds must be None"):
        automatic_partition(gym.make("Taxi-v4"), **given)


@pytest.mark.parametrize("kind", ["Fuzzy", None, Discrete])
def test_other_kinds_are_refused(kind: Any) -> None:
    with pytest.raises(TypeError, match="kind must be the class Crisp or Fuzzy"):
        automatic_partition(gym.make("MountainCar-v0"), kind=kind)
