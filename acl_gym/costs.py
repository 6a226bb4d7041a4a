"""What a solution costs: `ACL(cost=...)`, see `acl_gym.colony.costs`."""

from acl_gym.colony.cost import Constant, Cost, Sum, Weighted
from acl_gym.colony.costs import FunctionCost, Quadratic, StageCosts, Steps
from acl_gym.colony.episodes import Episode, Episodes
from acl_gym.colony.response_costs import Overshoot, RiseTime, SettlingTime

__all__ = [
    "Constant",
    "Cost",
    "Episode",
    "Episodes",
    "FunctionCost",
    "Overshoot",
    "Quadratic",
    "RiseTime",
    "SettlingTime",
    "StageCosts",
    "Steps",
    "Sum",
    "Weighted",
]
