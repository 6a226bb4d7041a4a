"""The double bridge of §2.3.2."""

from acl_gym.envs.graph.double_bridge.env import DoubleBridgeEnv, DoubleBridgeVectorEnv
from acl_gym.envs.graph.double_bridge.system import DoubleBridge, Place

__all__ = [
    "DoubleBridge",
    "DoubleBridgeEnv",
    "DoubleBridgeVectorEnv",
    "Place",
]
