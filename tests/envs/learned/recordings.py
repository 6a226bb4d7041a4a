"""Recordings that several tests learn from."""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np

from acl_gym import LearnedVectorEnv, Transitions

TASK: dict[str, Any] = {
    "goal": [np.pi, 0.0],
    "tolerance": [0.1, 0.1],
    "cost": ([1.0, 0.1], 0.05),
}
"""Goal and cost of the pendulum, as its own environment has them."""


@cache
def pendulum(steps: int = 60) -> Transitions:
    """Short runs of the pendulum from anywhere, random torques held for three steps."""
    env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=10)
    return Transitions.record(env, steps, hold=3, seed=0)


@cache
def _model() -> LearnedVectorEnv:
    return LearnedVectorEnv(pendulum(), 4, max_episode_steps=50, **TASK)


def model(num_envs: int = 4) -> LearnedVectorEnv:
    """The pendulum as it was learned from them; fitted once."""
    return _model().with_slots(num_envs)


def line(n: int = 40, seed: int = 0) -> dict[str, Any]:
    """Arguments of `Transitions` for x' = 0.9 x + 0.5 u."""
    rng = np.random.default_rng(seed)
    x, u = rng.uniform(-1, 1, (n, 1)), rng.choice([-1.0, 0.0, 1.0], (n, 1))
    return {"states": x, "inputs": u, "next_states": 0.9 * x + 0.5 * u}
