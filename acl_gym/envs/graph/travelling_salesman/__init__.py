"""The travelling salesman problem of §2.4.1, whose tours ants build city by city."""

from acl_gym.envs.graph.travelling_salesman.env import (
    TravellingSalesmanEnv,
    TravellingSalesmanVectorEnv,
)
from acl_gym.envs.graph.travelling_salesman.system import TravellingSalesman

__all__ = [
    "TravellingSalesman",
    "TravellingSalesmanEnv",
    "TravellingSalesmanVectorEnv",
]
