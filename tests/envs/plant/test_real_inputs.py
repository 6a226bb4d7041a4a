"""Real inputs: each slot with inputs of its own, in plants and in the pendulum."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import Fuzzy, fuzzy_q_iteration, plant
from acl_gym.utils.compiling import njit

BOX = spaces.Box(np.array([-6.0, -1.0]), np.array([6.0, 1.0]), dtype=np.float64)
MODES = pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])


def rod(x: Any, u: Any) -> Any:
    return [x[1], 9.81 * np.sin(x[0]) - 0.5 * x[1] + u[0] + 0.3 * u[1]]


@njit
def compiled_rod(x: Any, u: Any) -> Any:
    return x[1], 9.81 * math.sin(x[0]) - 0.5 * x[1] + u[0] + 0.3 * u[1]


def made(inputs: Any = BOX, dynamics: Any = rod, **changes: Any) -> Any:
    arguments: dict[str, Any] = {
        "low": [-np.pi, -8],
        "high": [np.pi, 8],
        "circular": [0],
        "inputs": inputs,
        "sampling_time": 0.1,
        "goal": [0, 0],
        "tolerance": [0.1, 0.3],
        "cost": ([1, 0.1], [[0.02, 0.005], [0.005, 0.03]]),
        "max_episode_steps": 6,
        "num_envs": 4,
    }
    return plant(dynamics, **{**arguments, **changes})


def random_inputs(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(BOX.low, BOX.high, (n, 2))


def next_of(x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, float]:
    """One step of the fourth-order method, and its cost, written from the equations."""
    f = lambda y: np.array(rod(y, u))  # noqa: E731
    h = 0.1
    k1 = f(x)
    k2 = f(x + h / 2 * k1)
    k3 = f(x + h / 2 * k2)
    k4 = f(x + h * k3)
    y = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    y[0] = (y[0] + np.pi) % (2 * np.pi) - np.pi
    y[1] = np.clip(y[1], -8, 8)
    weight = np.array([[0.02, 0.005], [0.005, 0.03]])
    return y, y[0] ** 2 + 0.1 * y[1] ** 2 + u @ weight @ u


@settings(max_examples=30, deadline=None)  # the first example compiles
@given(st.sampled_from([rod, compiled_rod]), st.integers(1, 9), st.integers(0, 2**32))
def test_steps_follow_the_equations(dynamics: Any, n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    env = made(dynamics=dynamics, num_envs=n)
    states = rng.uniform([-np.pi, -8], [np.pi, 8], (n, 2))
    env.reset(options={"state": states})
    inputs = random_inputs(rng, n)
    observation, reward, *_ = env.step(inputs)
    for slot in range(n):
        wanted, cost = next_of(states[slot], inputs[slot])
        wrapped = np.abs(observation[slot] - wanted)
        wrapped[0] = min(wrapped[0], 2 * np.pi - wrapped[0])
        np.testing.assert_allclose(wrapped, 0.0, atol=1e-12)
        assert reward[slot] == pytest.approx(-cost, rel=1e-10, abs=1e-10)


@MODES
@pytest.mark.parametrize("waits", [False, True])
def test_numbered_inputs_give_the_same_bits(mode: str, waits: bool) -> None:
    points = np.random.default_rng(0).uniform(BOX.low, BOX.high, (5, 2))
    envs = made(autoreset_mode=mode), made(points, autoreset_mode=mode)
    options = {"finished": "wait"} if waits else None
    starts = [env.reset(seed=1, options=options)[0] for env in envs]
    np.testing.assert_array_equal(*starts)
    rng = np.random.default_rng(2)
    finished = np.zeros(4, np.bool_)
    for _ in range(15):
        if mode == "Disabled" and not waits and finished.any():
            for env in envs:
                env.reset(options={"reset_mask": finished})
        actions = rng.integers(0, 5, 4)
        real, numbered = envs[0].step(points[actions]), envs[1].step(actions)
        for one, other in zip(real[:4], numbered[:4], strict=True):
            np.testing.assert_array_equal(one, other)
        assert real[4].keys() == numbered[4].keys()
        finished = real[2] | real[3]


@pytest.mark.parametrize(
    "cost", ["time", lambda x, u: x[0] ** 2 + u[0] ** 2 + np.abs(u[1])]
)
def test_other_costs(cost: Any) -> None:
    env = made(cost=cost)
    env.reset(seed=0)
    inputs = random_inputs(np.random.default_rng(0), 4)
    observation, reward, *_ = env.step(inputs)
    wanted = np.full(4, 0.1) if cost == "time" else cost(observation.T, inputs.T)
    np.testing.assert_allclose(-reward, wanted)


def test_slots_are_independent() -> None:
    rng = np.random.default_rng(0)
    inputs = random_inputs(rng, 4)
    env = made(autoreset_mode="Disabled")
    states = []
    for change in (False, True):
        env.reset(seed=3)
        changed = inputs.copy()
        if change:
            changed[2] *= -0.5
            mask = np.array([False, False, True, False])
            env.reset(options={"reset_mask": mask})
        states.append(env.step(changed)[0])
    same = [0, 1, 3]
    np.testing.assert_array_equal(states[0][same], states[1][same])
    assert (states[0][2] != states[1][2]).all()


def test_inputs_beyond_the_bounds_saturate_and_are_left_alone() -> None:
    envs = made(), made()
    given_inputs = np.array([[9.0, 0.0], [-7.0, 2.0], [0.0, -1.5], [1.0, 1.0]])
    before = given_inputs.copy()
    for env in envs:
        env.reset(seed=0)
    found = envs[0].step(given_inputs)[0]
    np.testing.assert_array_equal(given_inputs, before)
    wanted = envs[1].step(np.clip(before, BOX.low, BOX.high))[0]
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    ("inputs", "error", "match"),
    [
        (np.zeros(4), ValueError, r"shape \(4, 2\)"),
        (np.zeros((2, 4)), ValueError, r"shape \(4, 2\)"),
        (np.full((4, 2), np.nan), ValueError, "finite"),
        ([[0.0, np.inf]] * 4, ValueError, "input 1 in slot 0"),
        ([["a", "b"]] * 4, TypeError, "real numbers"),
        (None, TypeError, "real numbers"),
        (np.zeros((4, 2), dtype=complex), TypeError, "real numbers"),
    ],
)
def test_bad_inputs(inputs: Any, error: type[Exception], match: str) -> None:
    env = made()
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros((4, 2)))
    env.reset(seed=0)
    before = env.states
    with pytest.raises(error, match=match):
        env.step(inputs)
    np.testing.assert_array_equal(env.states, before)


@pytest.mark.parametrize(
    ("box", "match"),
    [
        (spaces.Box(-np.inf, np.inf, (1,)), "finite bounds"),
        (spaces.Box(0, 5, (2,), np.int64), "Box of floats"),
        (spaces.Box(-1.0, 1.0, (2, 2)), "one axis"),
        (spaces.Box(-1.0, 1.0, ()), "one axis"),
        (spaces.Box(1.0, 1.0, (2,)), "low < high"),
    ],
)
def test_bad_boxes(box: spaces.Box, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        made(box)


def test_many_inputs_are_tried_at_their_ends_only() -> None:
    box = spaces.Box(-1.0, 1.0, (12,), np.float64)
    env = made(box, lambda x, u: [x[1], u.sum(axis=0)], cost=([1, 1], 0.1))
    assert env.system.inputs.shape == (3, 12)
    assert made().system.inputs.shape == (5, 2)


def test_what_needs_numbered_actions_says_so() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, continuous=True)
    grid = Fuzzy.from_box(env.single_observation_space, (5, 5), circular=[0])
    with pytest.raises(ValueError, match="must have Discrete actions"):
        fuzzy_q_iteration(env, grid)


# --- single environments, pictures, and the pendulum of the thesis ------------------


@pytest.mark.filterwarnings("ignore:.*recommend using a symmetric and normalized")
def test_gymnasium_checks_single_environments() -> None:
    check_env(made(num_envs=None).unwrapped, skip_render_check=True)
    check_env(gym.make("acl_gym/Pendulum-v0", continuous=True).unwrapped)


def test_single_and_vector_environments_agree() -> None:
    single = gym.make("acl_gym/Pendulum-v0", continuous=True)
    vector = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, continuous=True)
    start = [[0.3, 1.0]]
    vector.reset(options={"state": start})
    single.reset(options={"state": start[0]})
    for torque in (0.8, -0.33, 0.0, 5.0):
        one, many = single.step([torque]), vector.step([[torque]])
        np.testing.assert_array_equal(one[0], many[0][0])
        assert one[1] == many[1][0]


@MODES
def test_the_pendulum_with_a_real_torque(mode: str) -> None:
    torques = [-0.8, -0.61, 0.0, 0.123, 0.8]
    options: dict[str, Any] = {"autoreset_mode": mode, "max_episode_steps": 50}
    real = gym.make_vec("acl_gym/Pendulum-v0", 600, continuous=True, **options)
    numbered = gym.make_vec("acl_gym/Pendulum-v0", 600, torques=torques, **options)
    assert real.single_action_space == spaces.Box(-0.8, 0.8, (1,), np.float64)
    for env in (real, numbered):
        env.reset(seed=0, options={"finished": "wait"})
    rng = np.random.default_rng(1)
    for _ in range(60):  # until all wait, so that few of many are stepped as well
        actions = rng.integers(0, 5, 600)
        one = real.step(np.array(torques)[actions][:, None])
        other = numbered.step(actions)
        for a, b in zip(one[:4], other[:4], strict=True):
            np.testing.assert_array_equal(a, b)
    copied = real.with_slots(2)
    assert copied.single_action_space == real.single_action_space


@pytest.mark.parametrize(
    ("changes", "error"),
    [({"continuous": 1}, TypeError), ({"torques": [0.5, 0.5]}, ValueError)],
)
def test_bad_parameters_of_the_pendulum(
    changes: dict[str, Any], error: type[Exception]
) -> None:
    with pytest.raises(error, match="continuous"):
        gym.make_vec("acl_gym/Pendulum-v0", 1, **{"continuous": True, **changes})


def test_pictures_show_the_input() -> None:
    pytest.importorskip("pygame")
    for env in (
        gym.make("acl_gym/Pendulum-v0", continuous=True, render_mode="rgb_array"),
        made(num_envs=None, render_mode="rgb_array"),
    ):
        n = env.action_space.shape[0]
        frames = []
        for u in (0.0, 0.7):
            env.reset(options={"state": [0.0, 0.0]})
            env.step(np.full(n, u))
            env.unwrapped._state[:] = 0.1  # all but the input is alike
            frames.append(env.render())
        assert (frames[0] != frames[1]).any()
    vector = made(render_mode="rgb_array")
    vector.reset(seed=0)
    vector.step(np.zeros((4, 2)))
    assert len(vector.render()) == 4
