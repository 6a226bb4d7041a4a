"""A system from the user's own differential equation, or from a python-control model."""

from acl_gym.envs.plant.env import PlantEnv, PlantVectorEnv, plant
from acl_gym.envs.plant.system import Plant

__all__ = ["Plant", "PlantEnv", "PlantVectorEnv", "plant"]
