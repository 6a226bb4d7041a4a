"""Wrappers around environments, of this package or of others."""

from acl_gym.envs.wrappers.changing import ChangingVectorEnv, Drift, Jump
from acl_gym.envs.wrappers.scaling import (
    ScaledObservation,
    ScaledVectorObservation,
    Scaling,
)
from acl_gym.envs.wrappers.waiting import WaitingVectorEnv

__all__ = [
    "ChangingVectorEnv",
    "Drift",
    "Jump",
    "ScaledObservation",
    "ScaledVectorObservation",
    "Scaling",
    "WaitingVectorEnv",
]
