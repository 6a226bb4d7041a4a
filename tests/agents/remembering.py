"""Environments for agents that remember, and whether two of them are the same."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from acl_gym import Crisp, WaitingVectorEnv
from acl_gym.agents.remembering import RememberingAgent
from acl_gym.partitions import Partition

J_STAR = 38.4  # of the pendulum, by value iteration on a fine grid


def pendulum(ants: int = 5) -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=ants)


def gymnasium_env(env_id: str, ants: int = 5, **kwargs: Any) -> Any:
    return WaitingVectorEnv([lambda: gym.make(env_id, **kwargs)] * ants)


def crisp() -> Partition:
    return Crisp([np.linspace(0, 6, 7), np.linspace(-9, 9, 7)], [2 * np.pi, None])


def assert_same(one: RememberingAgent, other: RememberingAgent) -> None:
    assert one.table.tobytes() == other.table.tobytes()
    assert one.num_timesteps == other.num_timesteps
    assert np.array_equal(one._ranks, other._ranks)
    assert np.array_equal(one._known, other._known)
    assert one.rng.bit_generator.state == other.rng.bit_generator.state
    assert np.array_equal(one._memory.evidence, other._memory.evidence)
    assert [{**row, "seconds": 0} for row in one.history] == [
        {**row, "seconds": 0} for row in other.history
    ]
