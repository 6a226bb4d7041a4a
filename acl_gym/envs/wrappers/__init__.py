"""Wrappers around environments, of this package or of others."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from acl_gym.envs.wrappers.scaling import (
    ScaledObservation,
    ScaledVectorObservation,
    Scaling,
)
from acl_gym.envs.wrappers.waiting import WaitingVectorEnv

if TYPE_CHECKING:
    from acl_gym.envs.wrappers.action_grid import ActionGrid
    from acl_gym.envs.wrappers.changing import ChangingVectorEnv, Drift, Jump
    from acl_gym.envs.wrappers.inner_loop import InnerLoop
    from acl_gym.envs.wrappers.pid import PID
    from acl_gym.envs.wrappers.shield import Shield
    from acl_gym.envs.wrappers.state_feedback import StateFeedback

# Imported on first use: they know the systems of this package and load compiled kernels.
# New worker processes, which import this folder, do not have to wait for that.
_LAZY = {
    "ActionGrid": "acl_gym.envs.wrappers.action_grid",
    "ChangingVectorEnv": "acl_gym.envs.wrappers.changing",
    "Drift": "acl_gym.envs.wrappers.changing",
    "InnerLoop": "acl_gym.envs.wrappers.inner_loop",
    "Jump": "acl_gym.envs.wrappers.changing",
    "PID": "acl_gym.envs.wrappers.pid",
    "Shield": "acl_gym.envs.wrappers.shield",
    "StateFeedback": "acl_gym.envs.wrappers.state_feedback",
}

__all__ = [
    "PID",
    "ActionGrid",
    "ChangingVectorEnv",
    "Drift",
    "InnerLoop",
    "Jump",
    "ScaledObservation",
    "ScaledVectorObservation",
    "Scaling",
    "Shield",
    "StateFeedback",
    "WaitingVectorEnv",
]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
