"""The pendulum swing-up of §5.2."""

from acl_gym.envs.pendulum.env import PendulumEnv, PendulumVectorEnv
from acl_gym.envs.pendulum.system import Pendulum

__all__ = [
    "Pendulum",
    "PendulumEnv",
    "PendulumVectorEnv",
]
