"""Numbered actions over real inputs, in environments of this package and of others."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import DiscretizeAction
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from acl_gym import (
    ActionGrid,
    ReturningACL,
    WaitingVectorEnv,
    evaluate_policy_cost,
    plant,
)
from acl_gym.envs.control.lookup import signals_of
from acl_gym.evaluation import with_slots_for


def point(x: np.ndarray, u: np.ndarray) -> list[np.ndarray]:
    return [x[1], u[0] - 0.2 * u[1]]


def two_inputs(num_envs: int, **options: Any) -> Any:
    return plant(
        point,
        low=[-1.0, -1.0],
        high=[1.0, 1.0],
        inputs=spaces.Box(
            np.array([-2.0, 0.0]), np.array([2.0, 3.0]), dtype=np.float64
        ),
        sampling_time=0.1,
        goal=[0.0, 0.0],
        max_episode_steps=20,
        num_envs=num_envs,
        **options,
    )


def test_the_grid_holds_both_bounds_and_the_last_input_varies_fastest() -> None:
    env = ActionGrid(two_inputs(2), (3, 2))
    assert env.counts == (3, 2)
    assert env.values.tolist() == [[a, b] for a in (-2, 0, 2) for b in (0, 3)]
    assert env.single_action_space == spaces.Discrete(6)
    assert env.action_space == spaces.MultiDiscrete([6, 6])
    assert ActionGrid(two_inputs(2), 3).counts == (3, 3)
    with pytest.raises(ValueError, match="read-only"):
        env.values[0] = 1.0


@pytest.mark.parametrize("count", range(2, 12))
def test_symmetric_ranges_give_symmetric_values(count: int) -> None:
    box = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, continuous=True)
    values = ActionGrid(box, count).values.ravel()
    np.testing.assert_array_equal(values, -values[::-1])
    np.testing.assert_allclose(values, np.linspace(-0.8, 0.8, count), atol=1e-15)
    assert values[[0, -1]].tolist() == [-0.8, 0.8]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_steps_are_those_of_the_environment_with_these_inputs(mode: str) -> None:
    options: dict[str, Any] = {"autoreset_mode": mode, "max_episode_steps": 4}
    box = gym.make_vec("acl_gym/Pendulum-v0", num_envs=3, continuous=True, **options)
    env = ActionGrid(box, 5)
    torques = env.values.ravel().tolist()
    twin = gym.make_vec("acl_gym/Pendulum-v0", num_envs=3, torques=torques, **options)
    assert env.metadata["autoreset_mode"] is twin.metadata["autoreset_mode"]
    starts = [env.reset(seed=3), twin.reset(seed=3)]
    np.testing.assert_array_equal(starts[0][0], starts[1][0])
    rng = np.random.default_rng(0)
    for step in range(9):
        if mode == "Disabled" and step in (4, 8):
            some = np.array([True, False, True])
            if step == 4:
                with pytest.raises(gym.error.ResetNeeded):
                    env.step([0, 1, 2])
            for mask in (some, ~some):
                for each in (env, twin):
                    each.reset(options={"reset_mask": mask})
        actions = rng.integers(0, 5, 3)
        found, wanted = env.step(actions), twin.step(actions)
        for one, other in zip(found[:4], wanted[:4], strict=True):
            np.testing.assert_array_equal(one, other)
        assert found[4].keys() == wanted[4].keys()


def test_slots_that_are_not_reset_stay_as_they_are() -> None:
    box = gym.make_vec(
        "acl_gym/Pendulum-v0", num_envs=4, continuous=True, autoreset_mode="Disabled"
    )
    env = ActionGrid(box, 7)
    env.reset(seed=0)
    env.step([0, 1, 2, 3])
    before = box.states
    mask = np.array([False, True, False, False])
    env.reset(options={"reset_mask": mask, "state": np.zeros((4, 2))})
    np.testing.assert_array_equal(box.states[~mask], before[~mask])
    assert (box.states[1] == 0.0).all()


def test_an_agent_learns_the_same_bits_as_on_numbered_torques() -> None:
    box = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5, continuous=True)
    env = ActionGrid(box, 5)
    torques = env.values.ravel().tolist()
    twin = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5, torques=torques)
    tables = [
        ReturningACL(each, seed=1).learn(total_timesteps=2_000).table
        for each in (env, twin)
    ]
    np.testing.assert_array_equal(*tables)


def test_evaluation_copies_what_it_wraps() -> None:
    box = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5, continuous=True)
    env = ActionGrid(box, 3)
    copied = with_slots_for(env)
    assert isinstance(copied, ActionGrid)
    assert copied.num_envs == 100
    assert with_slots_for(copied) is copied
    agent = ReturningACL(env, seed=0).learn(total_timesteps=500)
    result = evaluate_policy_cost(agent, env)
    assert result.costs.shape == (100,)
    assert env.num_envs == 5


def test_any_vector_environment() -> None:
    env = ActionGrid(WaitingVectorEnv.make("Pendulum-v1", 3), 5)
    assert env.values.dtype == np.float32
    twin = SyncVectorEnv(
        [lambda: gym.make("Pendulum-v1")] * 3,
        autoreset_mode=gym.vector.AutoresetMode.DISABLED,
    )
    np.testing.assert_array_equal(env.reset(seed=5)[0], twin.reset(seed=5)[0])
    for actions in ([0, 2, 4], [1, 1, 3]):
        found, wanted = env.step(actions), twin.step(env.values[actions])
        np.testing.assert_array_equal(found[0], wanted[0])
        np.testing.assert_array_equal(found[1], wanted[1])


def test_statistics_around_it() -> None:
    box = gym.make_vec("acl_gym/Pendulum-v0", 2, continuous=True, max_episode_steps=3)
    env = RecordEpisodeStatistics(ActionGrid(box, 3))
    env.reset(seed=0)
    for _ in range(3):
        infos = env.step(np.array([1, 1]))[4]
    assert infos["episode"]["l"].tolist() == [3, 3]
    assert signals_of(env) is not None


def test_what_the_actions_mean_is_known() -> None:
    box = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2, continuous=True)
    signals = signals_of(ActionGrid(box, 2))
    assert signals is not None
    assert signals.inputs == ("torque u, N m",)
    assert signals.values == ((-0.8,), (0.8,))
    assert len(signals.observations) == 2
    foreign = signals_of(ActionGrid(WaitingVectorEnv.make("Pendulum-v1", 2), 3))
    assert foreign is not None
    assert (foreign.inputs, foreign.dtype) == (("u[0]",), "float32")
    assert foreign.observations == ()
    discretised = WaitingVectorEnv(
        [lambda: DiscretizeAction(gym.make("Pendulum-v1"), bins=4)]
    )
    signals = signals_of(discretised)
    assert signals is not None
    assert signals.values == ((-1.5,), (-0.5,), (0.5,), (1.5,))


@pytest.mark.parametrize(
    ("counts", "error", "match"),
    [
        (1, ValueError, "counts"),
        (2.5, TypeError, "counts"),
        ("5", TypeError, "counts"),
        ((3, 3, 3), ValueError, "each of the 2 inputs"),
        ((101, 101), ValueError, "at most 10,000 actions"),
        (10**9, ValueError, "counts"),
    ],
)
def test_bad_counts(counts: Any, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        ActionGrid(two_inputs(1), counts)


def test_bad_environments() -> None:
    with pytest.raises(TypeError, match="VectorEnv"):
        ActionGrid(gym.make("Pendulum-v1"))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="must be a Box of floats"):
        ActionGrid(gym.make_vec("acl_gym/Pendulum-v0", num_envs=1))
    unbounded = gym.wrappers.vector.TransformAction(
        gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, continuous=True),
        lambda u: u,
        action_space=spaces.Box(-np.inf, np.inf, (1, 1)),
        single_action_space=spaces.Box(-np.inf, np.inf, (1,)),
    )
    with pytest.raises(ValueError, match="finite bounds"):
        ActionGrid(unbounded)


@pytest.mark.parametrize(
    ("actions", "error"),
    [
        ([0, 3], ValueError),
        ([0], ValueError),
        ([0.0, 1.0], TypeError),
        (None, TypeError),
    ],
)
def test_bad_actions(actions: Any, error: type[Exception]) -> None:
    env = ActionGrid(gym.make_vec("acl_gym/Pendulum-v0", 2, continuous=True), 3)
    env.reset(seed=0)
    with pytest.raises(error, match="actions"):
        env.step(actions)
