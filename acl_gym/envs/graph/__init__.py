"""Tasks on graphs: the travelling salesman problem of §2.4.1, and its instances."""

from acl_gym.envs.graph.instances import (
    TravellingSalesmanInstance,
    load_instance,
    optimal_tour,
)
from acl_gym.envs.graph.tsplib import read_tour, read_tsplib

__all__ = [
    "TravellingSalesmanInstance",
    "load_instance",
    "optimal_tour",
    "read_tour",
    "read_tsplib",
]
