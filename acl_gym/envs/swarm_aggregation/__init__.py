"""Swarm aggregation, §6.3.3, as environments in which agents learn."""

from acl_gym.envs.swarm_aggregation.env import SwarmAggregationEnv
from acl_gym.envs.swarm_aggregation.system import SwarmAggregation
from acl_gym.envs.swarm_aggregation.vector import SwarmAggregationVectorEnv

__all__ = ["SwarmAggregation", "SwarmAggregationEnv", "SwarmAggregationVectorEnv"]
