"""Plants against the pendulum of the package, exact solutions and python-control."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TimeLimit
from hypothesis import given, settings
from hypothesis import strategies as st

import acl_gym
from acl_gym.envs.plant import PlantEnv, PlantVectorEnv
from tests.envs.plant import plants
from tests.envs.plant.plants import PENDULUM, make_mass

BOTH = pytest.mark.parametrize("dynamics", [plants.mass, plants.compiled_mass])


@pytest.mark.parametrize("dynamics", [plants.pendulum, plants.compiled_pendulum])
@pytest.mark.parametrize("substeps", [1, 3])
def test_is_the_pendulum_of_the_package(dynamics: Any, substeps: int) -> None:
    count = 500
    own = acl_gym.plant(dynamics, num_envs=count, substeps=substeps, **PENDULUM)
    reference = gym.make_vec("acl_gym/Pendulum-v0", num_envs=count, substeps=substeps)
    rng = np.random.default_rng(0)
    states = rng.uniform([0.0, -9.0], [2 * np.pi, 9.0], (count, 2))
    states[:50] = rng.uniform([3.0, -0.3], [3.3, 0.3], (50, 2))  # some reach the goal
    actions = rng.integers(0, 3, count)
    results = []
    for env in (own, reference):
        env.reset(options={"state": states})
        results.append(env.step(actions)[:3])
    (observed, rewards, reached), (wanted, wanted_rewards, wanted_reached) = results
    # Angles may wrap at 0 in one and not in the other.
    error = np.abs(observed - wanted)
    error[:, 0] = np.minimum(error[:, 0], 2 * np.pi - error[:, 0])
    assert error.max() < 1e-12
    np.testing.assert_allclose(rewards, wanted_rewards, rtol=1e-11, atol=1e-11)
    assert (reached == wanted_reached).all()
    assert 0 < reached.sum() < count
    space = own.single_observation_space
    assert space == reference.single_observation_space


@settings(max_examples=40)
@given(
    st.integers(1, 6),
    st.integers(1, 5),
    st.integers(1, 4),
    st.integers(0, 2**32 - 1),
)
def test_substeps_and_dimensions(
    size: int, substeps: int, n_inputs: int, seed: int
) -> None:
    """One step of Runge-Kutta on x' = a x + b is the Taylor polynomial of degree 4."""
    rng = np.random.default_rng(seed)
    rates, gains = rng.uniform(-2, 2, size), rng.normal(size=(size, n_inputs))
    inputs = rng.normal(size=(3, n_inputs))
    env = acl_gym.plant(
        lambda x, u: rates[:, None] * x + gains @ u,
        low=np.full(size, -1e6),
        high=np.full(size, 1e6),
        inputs=inputs,
        sampling_time=0.3,
        substeps=substeps,
        goal=None,
        max_episode_steps=5,
        num_envs=4,
    )
    states, actions = rng.normal(size=(4, size)), rng.integers(0, 3, 4)
    env.reset(options={"state": states})
    observed, rewards, reached, _, _ = env.step(actions)
    h = 0.3 / substeps
    growth = sum((h * rates) ** k / math.factorial(k) for k in range(5))
    push = sum(h * (h * rates) ** k / math.factorial(k + 1) for k in range(4))
    wanted = states
    for _ in range(substeps):
        wanted = wanted * growth + (inputs[actions] @ gains.T) * push
    np.testing.assert_allclose(observed, wanted, rtol=1e-10, atol=1e-12)
    assert (rewards == -0.3).all()
    assert not reached.any()


@pytest.mark.parametrize("dynamics", [plants.pendulum, plants.compiled_pendulum])
def test_is_of_fourth_order(dynamics: Any) -> None:
    """Half the step, a sixteenth of the error."""
    errors = []
    state = {"state": np.tile([1.0, 2.0], (1, 1))}
    finest = None
    for substeps in (64, 4, 2):
        env = acl_gym.plant(
            dynamics, num_envs=1, **{**PENDULUM, "substeps": substeps, "goal": [0, 8]}
        )
        env.reset(options=state)
        observed = env.step([2])[0]
        if finest is None:
            finest = observed
        errors.append(np.abs(observed - finest).max())
    # 16 in the limit of short steps.
    assert 14 < errors[2] / errors[1] < 20


@BOTH
def test_bounds_and_circles(dynamics: Any) -> None:
    env = make_mass(
        dynamics=dynamics, num_envs=3, circular=[0], goal=None, tolerance=None
    )
    states = [[0.95, 0.9], [-0.99, -1.0], [0.0, 0.5]]
    env.reset(options={"state": states})
    observed = env.step([2, 0, 1])[0]
    # Position 0.95 + 0.09 + 0.005 wraps to -0.955; velocities stop at +-1.
    np.testing.assert_allclose(observed, [[-0.955, 1.0], [0.905, -1.0], [0.05, 0.5]])
    # High itself is low: the state space is [low, high) there.
    assert env.reset(options={"state": [[1.0, 0.0]] * 3})[0][0].tolist() == [-1.0, 0.0]
    flat = make_mass(dynamics=dynamics, num_envs=1, goal=None, tolerance=None)
    flat.reset(options={"state": [[0.99, 0.9]]})
    assert flat.step([2])[0].tolist() == [[1.0, 1.0]]


def inside(x: Any) -> Any:
    return (np.abs(x[0]) <= 0.15) & (np.abs(x[1]) <= 0.15)


def effort(x: Any, u: Any) -> Any:
    return x[0] ** 2 + 0.5 * u[0] ** 2


@BOTH
@pytest.mark.parametrize("goal", [[0.0, 0.0], ([-0.15, -0.15], [0.15, 0.15]), inside])
def test_forms_of_the_goal(dynamics: Any, goal: Any) -> None:
    tolerance = 0.15 if isinstance(goal, list) else None
    env = make_mass(dynamics=dynamics, goal=goal, tolerance=tolerance, num_envs=4)
    states = [[0.1, 0.0], [0.2, 0.0], [0.15, 0.0], [-0.1, 0.2]]
    env.reset(options={"state": states})
    assert env.step([1] * 4)[2].tolist() == [True, False, True, False]
    env.reset(seed=0)
    for seed in range(20):  # nobody begins in the goal
        observed, _ = env.reset(seed=seed)
        assert not inside(observed.T).any()


def test_goals_without_an_end_and_over_the_end() -> None:
    fast = make_mass(
        goal=([-np.inf, 0.5], [np.inf, np.inf]), tolerance=None, num_envs=3
    )
    fast.reset(options={"state": [[-0.9, 0.6], [0.9, 0.6], [0.0, 0.4]]})
    assert fast.step([1] * 3)[2].tolist() == [True, True, False]
    arc = make_mass(
        goal=([0.8, -1.0], [-0.8, 1.0]), tolerance=None, circular=[0], num_envs=4
    )
    arc.reset(options={"state": [[0.85, 0], [-0.85, 0], [0.7, 0], [-0.7, 0]]})
    assert arc.step([1] * 4)[2].tolist() == [True, True, False, False]


def test_forms_of_the_cost() -> None:
    state = {"state": [[0.5, 0.0]]}
    weights = ([[2.0, 0.5], [0.5, 1.0]], [3.0])
    for cost, wanted in [
        ("time", 0.1),
        (([2.0, 1.0], 3.0), 2 * 0.505**2 + 0.1**2 + 3),
        (weights, 2 * 0.505**2 + 2 * 0.5 * 0.505 * 0.1 + 0.1**2 + 3),
        (effort, 0.505**2 + 0.5),
    ]:
        env = make_mass(cost=cost, num_envs=1)
        env.reset(options=state)
        assert env.step([2])[1][0] == pytest.approx(-wanted, rel=1e-12)
        assert env.system.max_stage_cost >= wanted


def test_the_bound_on_the_cost_holds_on_corners() -> None:
    assert make_mass(cost=([1, 1], 1)).unwrapped.system.max_stage_cost == 3.0
    circle = acl_gym.plant(plants.pendulum, **PENDULUM).unwrapped.system
    assert circle.max_stage_cost == pytest.approx(np.pi**2 + 8.1 + 0.05 * 0.64)


def two_states(rng: np.random.Generator, count: int) -> Any:
    return rng.choice([[0.5, 0.0], [-0.5, 0.0]], count)


@pytest.mark.parametrize(
    ("initial", "allowed"),
    [
        ([0.5, 0.25], [[0.5, 0.25]]),
        ([[0.5, 0.0], [-0.5, 0.0]], [[0.5, 0.0], [-0.5, 0.0]]),
        (two_states, [[0.5, 0.0], [-0.5, 0.0]]),
    ],
)
def test_initial_states(initial: Any, allowed: list[list[float]]) -> None:
    env = make_mass(initial=initial, num_envs=30)
    observed, _ = env.reset(seed=0)
    assert {tuple(row) for row in observed} == {tuple(row) for row in allowed}
    again, _ = env.reset(seed=0)
    assert (observed == again).all()


def test_initial_box_and_evaluation_states() -> None:
    box = spaces.Box(np.array([0.0, -0.5]), np.array([0.5, 0.5]), dtype=np.float64)
    env = make_mass(initial=box, num_envs=500)
    observed, _ = env.reset(seed=0)
    assert all(row in box for row in observed)
    assert not inside(observed.T).any()
    evaluated = env.system.evaluation_states()
    assert evaluated.shape == (100, 2)
    assert (
        evaluated == make_mass(initial=box).unwrapped.system.evaluation_states()
    ).all()
    given = [[0.5, 0.0], [0.9, 0.9]]
    assert make_mass(evaluation_states=given, num_envs=1).system.evaluation_states(
    ).tolist() == given  # fmt: skip
    assert env.system.evaluation_steps == 60


def test_an_initial_box_may_lead_over_the_end_of_a_circle() -> None:
    # PENDULUM counts angles from 0 to 2 pi: half of the box is just below 2 pi.
    box = spaces.Box(np.array([-0.5, -1.0]), np.array([0.5, 1.0]), dtype=np.float64)
    settings = {**PENDULUM, "initial": box, "num_envs": 1_000}
    env = acl_gym.plant(plants.pendulum, **settings)
    observed, _ = env.reset(seed=0)
    for angles in (observed[:, 0], env.system.evaluation_states()[:, 0]):
        assert ((angles >= 0.0) & (angles < 2 * np.pi)).all()
        assert ((angles <= 0.5) | (angles >= 2 * np.pi - 0.5)).all()
        assert 0.3 < (angles < 1.0).mean() < 0.7


@BOTH
def test_one_environment_and_many_are_the_same(dynamics: Any) -> None:
    many = make_mass(dynamics=dynamics, num_envs=5, cost=([1, 1], 1))
    single = make_mass(dynamics=dynamics, cost=([1, 1], 1))
    assert isinstance(many, PlantVectorEnv)
    assert isinstance(single, TimeLimit)
    assert isinstance(single.unwrapped, PlantEnv)
    rng = np.random.default_rng(1)
    states = rng.uniform(-1, 1, (5, 2))
    actions = rng.integers(0, 3, (10, 5))
    many.reset(options={"state": states, "finished": "wait"})
    steps = [many.step(a) for a in actions]
    for slot in range(5):
        single.reset(options={"state": states[slot]})
        for t in range(10):
            observed, reward, reached, _, _ = single.step(actions[t, slot])
            np.testing.assert_allclose(observed, steps[t][0][slot], rtol=1e-12)
            assert reward == pytest.approx(steps[t][1][slot], rel=1e-12)
            assert reached == steps[t][2][slot]
            if reached:
                break


def test_time_limits() -> None:
    single = make_mass(max_episode_steps=2)
    single.reset(options={"state": [0.9, 0.9]})
    assert [single.step(1)[3] for _ in range(2)] == [False, True]
    many = make_mass(max_episode_steps=2, num_envs=2)
    many.reset(options={"state": [[0.9, 0.9]] * 2})
    assert [many.step([1, 1])[3].tolist() for _ in range(2)] == [
        [False] * 2,
        [True] * 2,
    ]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_modes_of_autoreset(mode: str) -> None:
    env = make_mass(num_envs=3, autoreset_mode=mode, max_episode_steps=2)
    assert env.metadata["autoreset_mode"].value == mode
    env.reset(seed=0)
    env.step([1] * 3)
    _, _, terminated, truncated, infos = env.step([1] * 3)
    finished = terminated | truncated
    assert finished.all()
    assert ("final_obs" in infos) == (mode == "SameStep")
    if mode == "Disabled":
        env.reset(options={"reset_mask": finished})
    assert not env.step([1] * 3)[3].any()


def test_the_checker_of_gymnasium() -> None:
    with pytest.warns(UserWarning, match="not having a spec"):
        check_env(make_mass().unwrapped)


@BOTH
def test_copies_and_pickles_go_on_in_the_same_way(dynamics: Any) -> None:
    env = make_mass(dynamics=dynamics, num_envs=4)
    env.reset(seed=3)
    env.step([0, 1, 2, 0])
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env)), env.with_slots(4)]
    observed = env.step([1, 1, 2, 0])[0]
    for other in others[:2]:
        assert (other.step([1, 1, 2, 0])[0] == observed).all()
    assert others[2].reset(seed=3)[0].shape == (4, 2)


def test_in_other_processes() -> None:
    env = gym.vector.AsyncVectorEnv([make_mass] * 2)
    try:
        observed, _ = env.reset(options={"state": np.array([0.5, 0.0])})
        assert observed.tolist() == [[0.5, 0.0]] * 2
    finally:
        env.close()


@pytest.mark.parametrize("kind", [plants.explosion, plants.compiled_explosion])
def test_a_state_that_is_not_finite_names_slot_and_state(kind: Any) -> None:
    env = acl_gym.plant(
        kind,
        low=[-1.0],
        high=[0.95],
        inputs=[-1.0, 0.0, 1.0],
        sampling_time=0.1,
        goal=[-0.95],
        max_episode_steps=10,
        num_envs=5,
    )
    words = r"no finite next state in slot 3, from the state \[0\.92\] with the input \[1\.0\]"
    start = {"state": [0.0, 0.1, 0.2, 0.92, 0.3]}
    env.reset(options=start)
    with pytest.raises(ValueError, match=words):
        env.step([2] * 5)
    # With few walking slots, slot 3 is not the third of those that are advanced.
    env.reset(options={"state": [-0.95, -0.95, -0.95, 0.75, -0.95], "finished": "wait"})
    assert env.step([1, 1, 1, 2, 1])[2].tolist() == [True, True, True, False, True]
    words = words.replace(r"0\.92", r"0\.85")
    with pytest.raises(ValueError, match=words):
        env.step([2] * 5)
    # An idle slot that would explode harms nobody.
    env.reset(options={"state": [0.0, 0.1, 0.2, 0.92, 0.3], "finished": "wait"})
    env._finished[3], env._walking = True, np.array([0, 1, 2, 4])
    observed, rewards, terminated, _, _ = env.step([2] * 5)
    np.testing.assert_allclose(observed[:, 0], [0.1, 0.2, 0.3, 0.92, 0.4])
    assert rewards.tolist() == [-0.1, -0.1, -0.1, 0.0, -0.1]
    assert not terminated.any()
    error = pickle.loads(
        pickle.dumps(acl_gym.envs.control.system.SlotError("<slot>", 3))
    )
    assert str(error) == "3"


def nan_cost(x: Any, u: Any) -> Any:
    return np.where(x[0] > 0.99, np.nan, 1.0)


def test_a_cost_that_is_not_finite_names_slot_and_state() -> None:
    env = make_mass(cost=nan_cost, num_envs=3)
    env.reset(options={"state": [[0.0, 0.5], [0.9999, 0.5], [0.5, 0.5]]})
    with pytest.raises(
        ValueError, match=r"cost must be finite, got nan in slot 1, for "
    ):
        env.step([2] * 3)


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_gauges_are_drawn(mode: str) -> None:
    pytest.importorskip("pygame")
    env = make_mass(render_mode=mode)
    env.reset(options={"state": [0.0, 0.0]})
    first = env.render()
    env.step(2)
    second = env.render()
    env.close()
    if mode == "rgb_array":
        assert first.shape == (480, 480, 3)
        assert (first != second).any()
    vector = make_mass(render_mode="rgb_array", num_envs=2, goal=inside, tolerance=None)
    vector.reset(seed=0)
    assert len(vector.render()) == 2


def test_a_goal_over_the_end_of_a_circle_is_drawn_at_both_ends() -> None:
    pytest.importorskip("pygame")
    env = make_mass(render_mode="rgb_array", circular=[0], goal=[1.0, 0.0])
    env.reset(seed=0)
    picture = env.render().astype(int)
    # Three gauges, for two variables and an input; the first one is circular.
    row = np.abs(picture[picture.shape[0] // 6] - [170, 215, 190]).sum(axis=-1) < 10
    left, right = np.split(row, 2)
    assert left.any()
    assert right.any()


@pytest.mark.parametrize("discrete_time", [False, True])
def test_a_function_may_return_the_same_array_each_time(discrete_time: bool) -> None:
    """The four slopes of a step would else all be the last one."""
    buffers: dict[tuple[int, ...], Any] = {}

    def reusing(x: Any, u: Any) -> Any:
        found = buffers.setdefault(x.shape, np.empty(x.shape))
        found[0], found[1] = x[1], 9.81 * np.sin(x[0]) + u[0]
        return found

    def fresh(x: Any, u: Any) -> Any:
        return np.stack([x[1], 9.81 * np.sin(x[0]) + u[0]])

    results = []
    for dynamics in (fresh, reusing):
        env = acl_gym.plant(
            dynamics,
            **{**PENDULUM, "discrete_time": discrete_time},
            num_envs=3,
        )
        env.reset(options={"state": [[1.0, 0.0], [2.0, 1.0], [0.5, -1.0]]})
        results.append(env.step([0, 1, 2])[0])
    assert np.array_equal(*results)
