"""Environments made of recorded data."""

from acl_gym.envs.learned.dynamics import LearnedDynamics
from acl_gym.envs.learned.env import LearnedVectorEnv
from acl_gym.envs.learned.quality import DataWarning
from acl_gym.envs.learned.transitions import Transitions

__all__ = ["DataWarning", "LearnedDynamics", "LearnedVectorEnv", "Transitions"]
