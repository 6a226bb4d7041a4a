"""Partitions: a batch of states becomes `(index, degree)`, all that an agent sees.

Every state belongs to k cells, to each with a degree >= 0, and the degrees of a state
sum to 1. Plain discrete states (§3.2) and a crisp partition (§4.2) have k = 1, a fuzzy
one (§4.3) k = 2^d, d counting the variables with several centres. Equations written over
`(index, degree)` therefore hold for all.

`base` defines what a partition is, `discrete` and `grid` hold the kinds of them, and
`automatic` builds one for an environment: that of the thesis, or a general one.
"""

from acl_gym.partitions.base import (
    Partition,
    checked_partition,
    locate_all,
    locate_checked,
)
from acl_gym.partitions.discrete import Discrete
from acl_gym.partitions.grid import KINDS, Crisp, Fuzzy, Grid
from acl_gym.partitions.settings import (
    given_partition,
    partition_from_settings,
    partition_to_settings,
)

__all__ = [
    "KINDS",
    "Crisp",
    "Discrete",
    "Fuzzy",
    "Grid",
    "Partition",
    "checked_partition",
    "given_partition",
    "locate_all",
    "locate_checked",
    "partition_from_settings",
    "partition_to_settings",
]
