"""What is no vector environment is refused, with the line that makes one of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    SubprocVecEnv,
    VecEnv,
    VecMonitor,
    VecNormalize,
)

import acl_gym
from acl_gym import (
    ACL,
    PolicyEvaluation,
    QLearning,
    ScaledVectorObservation,
    VectorEnvAdapter,
    evaluate_policy_cost,
)
from acl_gym.evaluation import actions_in, record_trajectory, with_slots_for
from acl_gym.sb3.callback import PolicyCostCallback
from acl_gym.utils.vector_envs import has_independent_slots, require_vector_env

LINE = "acl_gym/GridSearch1D-v0"


class Cart(gym.Env[Any, Any]):
    """An environment of one's own, not registered."""

    observation_space = spaces.Box(-1, 1, (1,), np.float64)
    action_space = spaces.Discrete(2)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return np.zeros(1), {}

    def step(self, action: Any) -> Any:
        return np.zeros(1), -1.0, True, False, {}


def _vec_envs() -> VecEnv:
    return make_vec_env("FrozenLake-v1", 3, env_kwargs={"is_slippery": False})


@pytest.mark.parametrize(
    ("make", "kind", "line"),
    [
        (
            lambda: gym.make("CartPole-v1"),
            "the single environment CartPoleEnv",
            'gym.make_vec("CartPole-v1", num_envs=100)',
        ),
        (
            lambda: gym.make(
                "FrozenLake-v1", is_slippery=False, render_mode="rgb_array"
            ),
            "the single environment FrozenLakeEnv",
            'acl_gym.WaitingVectorEnv.make("FrozenLake-v1", 100, '
            "map_name='4x4', is_slippery=False)",
        ),
        (
            lambda: Monitor(gym.make(LINE)),
            "the single environment GridSearch1DEnv",
            f'gym.make_vec("{LINE}", num_envs=100)',
        ),
        (
            Cart,
            "the single environment Cart",
            "acl_gym.WaitingVectorEnv([Cart] * 100)",
        ),
        (
            lambda: Cart,
            "Cart, a class or function",
            "acl_gym.WaitingVectorEnv([Cart] * 100)",
        ),
        (
            lambda: LINE,
            f"the id '{LINE}'",
            f'gym.make_vec("{LINE}", num_envs=100)',
        ),
        (
            lambda: f"acl_gym:{LINE}",
            f"the id 'acl_gym:{LINE}'",
            f'gym.make_vec("{LINE}", num_envs=100)',
        ),
        (
            _vec_envs,
            "DummyVecEnv of Stable-Baselines3",
            'acl_gym.WaitingVectorEnv.make("FrozenLake-v1", 3, '
            "map_name='4x4', is_slippery=False)",
        ),
        (
            lambda: VecNormalize(make_vec_env(Cart, 2)),
            "VecNormalize of Stable-Baselines3",
            "acl_gym.WaitingVectorEnv([Cart] * 2)",
        ),
    ],
)
def test_the_remedy_is_a_line_that_works(
    make: Callable[[], Any], kind: str, line: str
) -> None:
    with pytest.raises(TypeError, match=r"^env must be a gymnasium\.v") as caught:
        require_vector_env(make())
    assert str(caught.value) == (
        f"env must be a gymnasium.vector.VectorEnv, got {kind}; use {line}."
    )
    env = eval(line, {"gym": gym, "acl_gym": acl_gym, "Cart": Cart})
    require_vector_env(env)
    env.reset(seed=0)
    env.step(env.action_space.sample())


@pytest.mark.parametrize(
    ("wrap", "path"),
    [
        (lambda adapter: adapter, "env.env"),
        (VecMonitor, "env.unwrapped.env"),
        (lambda adapter: VecNormalize(VecMonitor(adapter)), "env.unwrapped.env"),
    ],
)
def test_behind_the_adapter_there_is_one_already(
    wrap: Callable[[Any], Any], path: str
) -> None:
    vector = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
    env = wrap(VectorEnvAdapter(vector))
    with pytest.raises(TypeError, match=rf"pass what it adapts, {path}\.$"):
        require_vector_env(env)
    assert eval(path, {"env": env}) is vector


def test_environments_in_processes_cannot_be_named() -> None:
    env = SubprocVecEnv([Cart] * 2, start_method="fork")
    with pytest.raises(TypeError, match=r"SubprocVecEnv .*make_vec\(id, num_envs=2\)"):
        require_vector_env(env)
    env.close()


@pytest.mark.parametrize("env", [None, 3, [Cart()], "no-such-id", {"a": 1}])
def test_anything_else_gets_the_general_remedy(env: Any) -> None:
    with pytest.raises(TypeError, match=r"use gym\.make_vec\(id, num_envs=100\)"):
        require_vector_env(env)


GRID = acl_gym.Crisp.from_box(spaces.Box(-1, 1, (1,)), 5)


@pytest.mark.parametrize("wrong", [Cart, _vec_envs], ids=["single", "VecEnv"])
@pytest.mark.parametrize(
    "take",
    [
        ACL,
        QLearning,
        lambda env: ACL(env, GRID),
        lambda env: QLearning(None, GRID, n_actions=2).set_env(env),
        lambda env: evaluate_policy_cost(QLearning(None, GRID, n_actions=2), env),
        PolicyEvaluation,
        PolicyCostCallback,
        VectorEnvAdapter,
        ScaledVectorObservation,
        with_slots_for,
        lambda env: record_trajectory(
            QLearning(None, GRID, n_actions=2), env, np.zeros(1)
        ),
        lambda env: actions_in(
            QLearning(None, GRID, n_actions=2), env, np.zeros((1, 1))
        ),
    ],
)
def test_whatever_takes_a_vector_environment_says_so(
    take: Callable[[Any], Any], wrong: Callable[[], Any]
) -> None:
    with pytest.raises(TypeError, match=r"VectorEnv, got .*acl_gym\.WaitingVectorEnv"):
        take(wrong())


def test_slots_of_a_swarm_are_not_independent() -> None:
    assert has_independent_slots("acl_gym/Pendulum-v0")
    assert has_independent_slots("CartPole-v1")
    assert not has_independent_slots("acl_gym/SwarmAggregation-v0")
    assert not has_independent_slots("MountainCar-v0")  # has no native one
