"""The scaled observations: values, spaces, parity of single and vector, bad input."""

import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st

import acl_gym
from acl_gym.envs.wrappers import Scaling

PENDULUM = "acl_gym/Pendulum-v0"
BOX = spaces.Box(np.array([0.0, -9.0]), np.array([2 * math.pi, 9.0]), dtype=np.float64)


def reference(observation: np.ndarray) -> np.ndarray:
    """The pendulum's features, written down one by one."""
    theta, omega = observation
    return np.array([math.cos(theta), math.sin(theta), omega / 9.0], dtype=np.float32)


@given(st.floats(0, 2 * math.pi), st.floats(-9, 9))
def test_pendulum_features(theta: float, omega: float) -> None:
    scaling = Scaling(BOX, [0])
    features = scaling(np.array([theta, omega]))
    np.testing.assert_allclose(features, reference(np.array([theta, omega])), atol=1e-6)
    assert scaling.space.contains(features)


def test_order_and_places_of_mixed_variables() -> None:
    box = spaces.Box(np.array([-2, 10, 0, -1]), np.array([2, 20, 4, 1]), dtype=np.int64)
    scaling = Scaling(box, (2, 0))
    assert scaling.circular == (0, 2)
    # 0 and 1 are circular 0: (cos, sin); 2 is linear 1; 3 and 4 circular 2; 5 linear 3.
    np.testing.assert_allclose(
        scaling([[-2, 10, 1, 0], [1, 20, 2, -1]]),
        [[1, 0, -1, 0, 1, 0], [0, -1, 1, -1, 0, -1]],
        atol=1e-6,
    )
    assert scaling.space == spaces.Box(-1, 1, (6,), np.float32)


def test_both_ends_of_a_circle_are_one_place() -> None:
    low, high = Scaling(BOX, [0])([[0.0, 1.0], [2 * math.pi, 1.0]])
    np.testing.assert_allclose(low, high, atol=1e-6)


def test_without_circles_all_is_linear() -> None:
    assert Scaling(BOX)([math.pi / 2, -4.5]).tolist() == [-0.5, -0.5]


def test_any_leading_axes() -> None:
    scaling = Scaling(BOX, [0])
    batch = np.random.default_rng(0).uniform(BOX.low, BOX.high, (4, 5, 2))
    features = scaling(batch)
    assert features.shape == (4, 5, 3)
    np.testing.assert_allclose(features[2, 3], scaling(batch[2, 3]), atol=1e-7)
    assert scaling(np.empty((0, 2))).shape == (0, 3)


def test_input_is_left_alone_and_output_is_new() -> None:
    scaling = Scaling(BOX, [0])
    batch = np.ones((3, 2))
    first, second = scaling(batch), scaling(batch)
    assert not np.shares_memory(first, second)
    assert (batch == 1).all()


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
def test_single_environment_passes_the_checker() -> None:
    env = acl_gym.ScaledObservation(gym.make(PENDULUM, max_episode_steps=20), [0])
    assert env.observation_space == spaces.Box(-1, 1, (3,), np.float32)
    check_env(env, skip_render_check=True)


def test_single_and_vector_give_the_same() -> None:
    states = gym.make(PENDULUM).unwrapped.system.evaluation_states()[:12]
    vector = acl_gym.ScaledVectorObservation(
        gym.make_vec(PENDULUM, num_envs=12, autoreset_mode="Disabled"), [0]
    )
    singles = [acl_gym.ScaledObservation(gym.make(PENDULUM), [0]) for _ in states]
    batch, _ = vector.reset(options={"state": states})
    rows = [
        single.reset(options={"state": state})[0]
        for single, state in zip(singles, states, strict=True)
    ]
    np.testing.assert_allclose(batch, rows, atol=1e-7)
    for step in range(20):
        actions = np.arange(step, step + 12) % 3
        batch, rewards, *_ = vector.step(actions)
        results = [
            single.step(action) for single, action in zip(singles, actions, strict=True)
        ]
        assert vector.observation_space.contains(batch)
        np.testing.assert_allclose(batch, [r[0] for r in results], atol=1e-7)
        np.testing.assert_allclose(rewards, [r[1] for r in results])


@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_vector_spaces_and_modes(mode: str) -> None:
    base = gym.make_vec(PENDULUM, num_envs=4, autoreset_mode=mode, max_episode_steps=3)
    env = acl_gym.ScaledVectorObservation(base, [0])
    assert env.single_observation_space == spaces.Box(-1, 1, (3,), np.float32)
    assert env.observation_space == spaces.Box(-1, 1, (4, 3), np.float32)
    assert env.metadata["autoreset_mode"] is AutoresetMode(mode)
    observation, _ = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    for _ in range(3):
        observation, *_, truncated, _ = env.step(np.zeros(4, dtype=np.int64))
        assert env.observation_space.contains(observation)
    assert truncated.all()


def test_masked_reset_goes_through() -> None:
    env = acl_gym.ScaledVectorObservation(
        gym.make_vec(PENDULUM, num_envs=2, autoreset_mode="Disabled"), [0]
    )
    env.reset(options={"state": [[1.0, 2.0], [3.0, 4.0]]})
    observation, _ = env.reset(
        options={
            "state": np.array([[0.0, 9.0], [0.0, 9.0]]),
            "reset_mask": np.array([False, True]),
        }
    )
    np.testing.assert_allclose(observation[0], reference(np.array([1.0, 2.0])))
    np.testing.assert_allclose(observation[1], reference(np.array([0.0, 9.0])))


def test_synchronous_environments_of_others() -> None:
    env = acl_gym.ScaledVectorObservation(
        SyncVectorEnv([lambda: gym.make("MountainCar-v0")] * 2)
    )
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)


def test_same_step_is_refused() -> None:
    env = gym.make_vec(PENDULUM, num_envs=2, autoreset_mode="SameStep")
    with pytest.raises(ValueError, match=r"SAME_STEP.*Disabled"):
        acl_gym.ScaledVectorObservation(env, [0])


def test_a_single_environment_is_refused_by_the_vector_wrapper() -> None:
    with pytest.raises(TypeError, match="VectorEnv"):
        acl_gym.ScaledVectorObservation(gym.make(PENDULUM), [0])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "space",
    [
        spaces.Discrete(4),
        spaces.Box(0, 1, (2, 2)),
        spaces.Box(0, 1, ()),
        spaces.Dict({"x": spaces.Box(0, 1, (2,))}),
    ],
    ids=str,
)
def test_other_spaces_are_refused(space: spaces.Space[Any]) -> None:
    with pytest.raises(ValueError, match="Box of one axis"):
        Scaling(space)


@pytest.mark.parametrize(
    ("low", "high"),
    [([0, -np.inf], [1, 1]), ([0, 0], [1, np.inf]), ([0, 2], [1, 2])],
)
def test_bad_bounds_are_refused(low: list[float], high: list[float]) -> None:
    space = spaces.Box(np.array(low), np.array(high), dtype=np.float64)
    with pytest.raises(ValueError, match=r"finite bounds.*variable 1"):
        Scaling(space)


def test_an_unbounded_environment_is_refused() -> None:
    with pytest.raises(ValueError, match="finite bounds"):
        acl_gym.ScaledObservation(gym.make("CartPole-v1"))


@pytest.mark.parametrize("circular", [[2], [-1], [0, 0]])
def test_bad_indices_are_refused(circular: list[int]) -> None:
    with pytest.raises(ValueError, match=r"variables of 0\.\.1"):
        Scaling(BOX, circular)


@pytest.mark.parametrize("circular", [0, [0.5], ["theta"]])
def test_what_is_no_index_is_refused(circular: Any) -> None:
    with pytest.raises(TypeError, match="indices"):
        Scaling(BOX, circular)


def test_wrong_number_of_variables_is_refused() -> None:
    with pytest.raises(ValueError, match=r"2 variables.*\(5, 3\)"):
        Scaling(BOX)(np.zeros((5, 3)))


def test_wrapped_environments_can_be_made_again() -> None:
    env = acl_gym.ScaledObservation(gym.make(PENDULUM), iter([0]))
    again = gym.make(env.spec)
    assert again.observation_space.shape == (3,)
    assert pickle.loads(pickle.dumps(env.scaling)).circular == (0,)


@pytest.mark.parametrize("observation", ["ab", [1j, 0.0], [np.nan, 0.0], [np.inf, 0.0]])
def test_what_is_no_finite_observation_is_refused(observation: object) -> None:
    """NaN would otherwise reach a network."""
    scaling = Scaling(gym.spaces.Box(-1.0, 1.0, (2,)))
    with pytest.raises(ValueError, match="observations must be"):
        scaling(observation)  # type: ignore[arg-type]
