"""Observations are float64; networks of float32 that do not cast need a wrapper.

Stable-Baselines3's own networks cast. Code that hands the observations of its replay
buffer, whose dtype is that of the space, to a network as they are does not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.wrappers import DtypeObservation
from gymnasium.wrappers.vector import DtypeObservation as DtypeVectorObservation
from stable_baselines3 import DQN
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.vec_env import DummyVecEnv

from acl_gym import VectorEnvAdapter

BOXES = pytest.mark.parametrize(
    "env_id", ["acl_gym/Pendulum-v0", "acl_gym/Navigation-v0"]
)


def single(env_id: str) -> Any:
    return gym.make(env_id, max_episode_steps=12)


def single_in_float32(env_id: str) -> Any:
    with pytest.warns(UserWarning, match="precision lowered"):  # just that
        return DtypeObservation(single(env_id), np.float32)


def vector_in_float32(env_id: str) -> Any:
    env = gym.make_vec(
        env_id, num_envs=2, max_episode_steps=12, autoreset_mode="Disabled"
    )
    with pytest.warns(UserWarning, match="precision lowered"):
        return DtypeVectorObservation(env, np.float32)


def sample(env: Any) -> torch.Tensor:
    """Observations from a replay buffer that has seen one step of `env`."""
    buffer = ReplayBuffer(8, env.observation_space, env.action_space, device="cpu")
    before, _ = env.reset(seed=0)
    after, reward, done, _, info = env.step(1)
    buffer.add(before, after, np.array(1), np.array(reward), np.array(done), [info])
    observations = buffer.sample(4).observations
    assert isinstance(observations, torch.Tensor)
    return observations


@BOXES
def test_where_float64_breaks_and_what_mends_it(env_id: str) -> None:
    env = single(env_id)
    network = torch.nn.Linear(*env.observation_space.shape, 3)
    with pytest.raises(RuntimeError, match="same dtype"):
        network(sample(env))
    assert network(sample(single_in_float32(env_id))).shape == (4, 3)


@BOXES
@pytest.mark.parametrize(
    ("make", "dtype"),
    [
        (lambda env_id: DummyVecEnv([lambda: single(env_id)]), np.float64),
        (
            lambda env_id: DummyVecEnv([lambda: single_in_float32(env_id)]),
            np.float32,
        ),
        (lambda env_id: VectorEnvAdapter(vector_in_float32(env_id)), np.float32),
    ],
    ids=["float64", "float32", "vector float32"],
)
def test_dqn_learns_from_both(
    env_id: str, make: Callable[[str], Any], dtype: Any
) -> None:
    model = DQN(
        "MlpPolicy",
        make(env_id),
        learning_starts=16,
        buffer_size=100,
        seed=0,
        device="cpu",
    ).learn(64)
    assert model.replay_buffer.observations.dtype == dtype
    assert model.observation_space.dtype == dtype


@BOXES
def test_rounded_observations_stay_in_the_space(env_id: str) -> None:
    env = vector_in_float32(env_id)
    plain = env.unwrapped
    rounded, _ = env.reset(seed=0)
    high = plain.single_observation_space.high
    extreme = np.stack([high, plain.single_observation_space.low])
    shown, _ = env.reset(options={"state": extreme})
    for observation in (*rounded, *shown):
        assert observation.dtype == np.float32
        assert env.single_observation_space.contains(observation)
