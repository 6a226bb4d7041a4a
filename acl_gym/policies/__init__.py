"""Policies over a partition: the result of every method of this package."""

from acl_gym.policies.base import Action, PartitionPolicy
from acl_gym.policies.interpolated import InterpolatedPolicy
from acl_gym.policies.soft import SoftPolicy
from acl_gym.policies.table import TablePolicy, random_ranks

__all__ = [
    "Action",
    "InterpolatedPolicy",
    "PartitionPolicy",
    "SoftPolicy",
    "TablePolicy",
    "random_ranks",
]
