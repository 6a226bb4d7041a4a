"""Learning from few interactions with a plant, in a model of what was recorded."""

from acl_gym.model_based.loop import learn_from_plant
from acl_gym.model_based.result import PlantLearning

__all__ = ["PlantLearning", "learn_from_plant"]
