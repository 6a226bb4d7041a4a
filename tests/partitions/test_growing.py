"""Finer grids say what the coarser ones said."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import ACL, Crisp, Discrete, Fuzzy
from acl_gym.partitions import locate_all
from acl_gym.partitions.growing import (
    carried_over,
    initial_partition,
    widened,
)


def value(table: Any, partition: Any, states: Any) -> Any:
    index, degree = locate_all(partition, states, partition.n_cells)
    return np.einsum("nk,nka->na", degree, table[index])


@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.lists(st.integers(1, 5), min_size=1, max_size=4),
    round_axis=st.booleans(),
    axis=st.integers(0, 3),
)
def test_a_fuzzy_table_says_the_same_everywhere(
    seed: int, sizes: list[int], round_axis: bool, axis: int
) -> None:
    rng = np.random.default_rng(seed)
    centres = [np.sort(rng.choice(100, n, replace=False)) / 10.0 for n in sizes]
    period = 10.0 if round_axis and sizes[0] > 1 else None
    coarse = Fuzzy(centres, [period] + [None] * (len(sizes) - 1))
    axis %= len(sizes)
    fine = coarse.refined(axis)
    table = rng.normal(size=(coarse.n_cells, 3))
    carried = carried_over(table, coarse, fine)
    states = rng.uniform(-2.0, 12.0, (200, len(sizes)))
    np.testing.assert_allclose(
        value(carried, fine, states), value(table, coarse, states), atol=1e-9
    )
    old, new = value(table, coarse, states), value(carried, fine, states)
    chosen = new.argmax(axis=1)[:, None]
    # Where two actions are equal but for rounding, either may be the policy's.
    np.testing.assert_allclose(
        np.take_along_axis(old, chosen, 1)[:, 0], old.max(axis=1), atol=1e-9
    )
    assert set(coarse.centres[axis]) <= set(fine.centres[axis])
    rounded = axis == 0 and period is not None
    expected = 2 * sizes[axis] - (not rounded)
    assert fine.centres[axis].size == expected


def test_cells_of_a_crisp_grid_are_copied() -> None:
    coarse = Crisp([[0.0, 1.0, 2.0]])
    fine = coarse.refined(0)
    table = np.array([[1.0], [2.0], [4.0]])
    # A centre on the border of two cells belongs to the upper one, as a state does.
    assert carried_over(table, coarse, fine).ravel().tolist() == [1, 2, 2, 4, 4]


def test_a_colony_goes_on_on_finer_cells() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=20)
    coarse = Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0])
    colony = ACL(env, coarse, seed=0, max_steps=100).learn(trials=3)
    finer = ACL(env, coarse.refined(1), seed=0, max_steps=100)
    finer.set_table(carried_over(colony.table, coarse, finer.partition))
    states = env.reset(seed=2)[0]
    chosen = colony.predict(states)[0]
    # Where levels tie, either action may be taken; here few do.
    assert np.mean(finer.predict(states)[0] == chosen) > 0.8
    assert finer.learn(trials=1).partition.n_cells == 8 * 17


def test_only_grids_can_be_refined_and_stay_of_their_kind() -> None:
    assert type(Crisp([[0.0, 1.0]]).refined(0)) is Crisp
    assert not hasattr(Discrete(5), "refined")
    lone = Fuzzy([[0.5], [0.0, 1.0]])
    assert lone.refined(0).n_cells == lone.n_cells


MOST = 20_000  # cells


@pytest.mark.parametrize("axis", [2, -1, "0", 0.5, None, True])
def test_an_axis_must_exist(axis: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="axis must be"):
        Fuzzy([[0.0, 1.0]] * 2).refined(axis)


def test_a_table_of_another_partition_is_refused() -> None:
    coarse = Fuzzy([[0.0, 1.0]])
    with pytest.raises(ValueError, match="table must have 2 rows, one for each cell"):
        carried_over(np.zeros((3, 1)), coarse, coarse.refined(0))


@pytest.mark.parametrize("which", ["old", "new"])
def test_tables_are_carried_between_partitions(which: str) -> None:
    both: dict[str, Any] = {"old": Fuzzy([[0.0, 1.0]]), "new": Fuzzy([[0.0, 1.0]])}
    with pytest.raises(TypeError, match=f"{which} must be a partition, got 3"):
        carried_over(np.zeros((2, 1)), **{**both, which: 3})


BOX = spaces.Box(np.array([-np.inf, 0.0]), np.array([np.inf, 1.0]), dtype=np.float64)


def test_a_range_is_that_which_is_seen_with_a_margin_within_the_bounds() -> None:
    start = Fuzzy([[0.0], [0.5]])
    wide = widened(start, np.array([[-2.0, 0.1], [8.0, 0.9]]), BOX, MOST)
    assert wide is not None
    # A tenth of the range is added on either side: 1.0, and 0.08.
    np.testing.assert_allclose(wide.centres[0], np.linspace(-3.0, 9.0, 9))
    np.testing.assert_allclose(wide.centres[1], np.linspace(0.02, 0.98, 9))
    assert widened(wide, np.array([[9.0, 0.5]]), BOX, MOST) is None
    wider = widened(wide, np.array([[10.0, 1.0]]), BOX, MOST)
    assert wider is not None
    np.testing.assert_allclose(wider.centres[0], np.linspace(-3.0, 11.3, 9))
    np.testing.assert_allclose(wider.centres[1][[0, -1]], [0.02, 1.0])


def test_what_does_not_vary_or_is_circular_keeps_its_centres() -> None:
    grid = Fuzzy([[0.0, 1.0, 2.0], [0.5]], [3.0, None])
    assert widened(grid, np.array([[50.0, 0.7], [-9.0, 0.7]]), BOX, MOST) is None


def test_states_that_are_not_finite_widen_nothing() -> None:
    start = Fuzzy([[0.0], [0.5]])
    assert widened(start, np.array([[np.inf, 0.1]]), BOX, MOST) is None
    assert widened(start, np.array([[np.nan, 0.1]]), BOX, MOST) is None


def test_a_partition_to_begin_with() -> None:
    pendulum = initial_partition(gym.make("acl_gym/Pendulum-v0"), MOST)
    assert isinstance(pendulum, Fuzzy)
    assert pendulum.periods == (pytest.approx(2 * np.pi), None)
    assert [line.size for line in pendulum.centres] == [10, 1]
    assert isinstance(initial_partition(gym.make("Taxi-v4"), 1), Discrete)
    with pytest.raises(ValueError, match=r"must have 1 to 6 variables .*, got 7"):
        initial_partition(Many(), MOST)


@pytest.mark.parametrize(
    ("most", "on_circle", "on_line"),
    [(1, 1, 1), (5, 1, 1), (6, 3, 2), (19, 4, 3), (20, 5, 4), (89, 9, 8), (90, 10, 9)],
)
def test_there_are_never_more_cells_than_may_be(
    most: int, on_circle: int, on_line: int
) -> None:
    """A circle and a line: 9 centres of the line and 10 of the circle where they fit."""
    env = gym.make("acl_gym/Pendulum-v0")
    grid = initial_partition(env, most)
    assert isinstance(grid, Fuzzy)
    box = env.observation_space
    assert isinstance(box, spaces.Box)
    wide = widened(grid, np.array([[0.0, -3.0], [1.0, 3.0]]), box, most) or grid
    assert [line.size for line in wide.centres] == [on_circle, on_line]
    assert wide.n_cells <= most


class Many(gym.Env):
    """An environment of seven variables."""

    observation_space = spaces.Box(-1.0, 1.0, (7,))
    action_space = spaces.Discrete(2)


@pytest.mark.parametrize("intervals", [[True], [1, 0], [True, False, True], "ab"])
def test_intervals_must_fit(intervals: Any) -> None:
    with pytest.raises(ValueError, match="intervals must be 2 bools for axis 0"):
        Fuzzy([[0.0, 1.0, 3.0]]).refined(0, intervals)


def test_single_intervals_are_halved() -> None:
    fine = Fuzzy([[0.0, 1.0, 3.0]]).refined(0, [False, True])
    assert fine.centres[0].tolist() == [0.0, 1.0, 2.0, 3.0]
    rounded = Fuzzy([[0.0, 1.0]], [3.0]).refined(0, [False, True])
    assert rounded.centres[0].tolist() == [0.0, 1.0, 2.0]
