"""Local searches that shorten tours of the travelling salesman."""

from acl_gym.colony.local_search.neighbours import nearest_neighbours
from acl_gym.colony.local_search.search import (
    METHODS,
    LocalSearch,
    or_opt,
    three_opt,
    two_opt,
)

__all__ = [
    "METHODS",
    "LocalSearch",
    "nearest_neighbours",
    "or_opt",
    "three_opt",
    "two_opt",
]
