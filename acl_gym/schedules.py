"""Parameters that change: `ACL(epsilon=...)`, see `acl_gym.colony.schedules`."""

from acl_gym.colony.schedules import (
    Exponential,
    Harmonic,
    Linear,
    Schedule,
)

__all__ = [
    "Exponential",
    "Harmonic",
    "Linear",
    "Schedule",
]
