"""What an ant deposits: `ACL(deposit=...)`, see `acl_gym.colony.deposits`."""

from acl_gym.colony.deposits import (
    Deposit,
    FunctionDeposit,
    InverseCost,
    Rank,
    Return,
)

__all__ = [
    "Deposit",
    "FunctionDeposit",
    "InverseCost",
    "Rank",
    "Return",
]
