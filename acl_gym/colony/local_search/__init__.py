"""Local searches that shorten tours of the travelling salesman."""

from acl_gym.colony.local_search.neighbours import nearest_neighbours
from acl_gym.colony.local_search.search import METHODS, LocalSearch

__all__ = ["METHODS", "LocalSearch", "nearest_neighbours"]
