"""The two-state system of Figure 3.2."""

from acl_gym.envs.two_state.env import TwoStateEnv, TwoStateVectorEnv
from acl_gym.envs.two_state.system import TwoState

__all__ = [
    "TwoState",
    "TwoStateEnv",
    "TwoStateVectorEnv",
]
