"""Plants that tests learn from."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from acl_gym import QLearning


def pendulum() -> Any:
    """One pendulum, whose goal and cost are known."""
    return gym.make("acl_gym/Pendulum-v0")


def quick(model: Any) -> QLearning:
    """An agent that learns in a moment."""
    return QLearning(model, seed=0)


QUICK: dict[str, Any] = {"agent": quick, "restart_after": 10, "model_steps": 400}
"""A round takes a moment."""
