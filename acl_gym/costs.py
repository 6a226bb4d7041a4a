"""What a solution costs: `ACL(cost=...)`, see `acl_gym.colony.costs`."""

from acl_gym.colony.costs import (
    Constant,
    Cost,
    FunctionCost,
    Overshoot,
    Quadratic,
    RiseTime,
    SettlingTime,
    StageCosts,
    Steps,
    Sum,
    Weighted,
)
from acl_gym.colony.episodes import Episode, Episodes

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
