"""The 2-D navigation with variable damping of §4.5."""

from acl_gym.envs.navigation.env import NavigationEnv, NavigationVectorEnv
from acl_gym.envs.navigation.system import Navigation

__all__ = [
    "Navigation",
    "NavigationEnv",
    "NavigationVectorEnv",
]
