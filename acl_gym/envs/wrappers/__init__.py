"""Wrappers around environments, of this package or of others."""

from acl_gym.envs.wrappers.action_grid import ActionGrid
from acl_gym.envs.wrappers.scaling import (
    ScaledObservation,
    ScaledVectorObservation,
    Scaling,
)
from acl_gym.envs.wrappers.waiting import WaitingVectorEnv

__all__ = [
    "ActionGrid",
    "ScaledObservation",
    "ScaledVectorObservation",
    "Scaling",
    "WaitingVectorEnv",
]
