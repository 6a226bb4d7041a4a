"""The grid searches of §3.6.2 and §3.6.6."""

from acl_gym.envs.grid_search.env import (
    GridSearch1DEnv,
    GridSearch1DVectorEnv,
    GridSearch2DEnv,
    GridSearch2DVectorEnv,
)
from acl_gym.envs.grid_search.system import GridSearch, GridSearch1D, GridSearch2D

__all__ = [
    "GridSearch",
    "GridSearch1D",
    "GridSearch1DEnv",
    "GridSearch1DVectorEnv",
    "GridSearch2D",
    "GridSearch2DEnv",
    "GridSearch2DVectorEnv",
]
