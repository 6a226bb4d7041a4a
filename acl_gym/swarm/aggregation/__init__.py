"""Swarm aggregation by potential functions, §6.3.3: agents that form a cohesive swarm.

Agents attract each other from far and repel each other from near, (6.5), so that they
come together and keep a distance. In a `Field` with a profile they forage: the swarm
goes where the profile is low. docs/swarm-aggregation.md has it in words and pictures.

Example:
    >>> from acl_gym.swarm import Radius, run
    >>> from acl_gym.swarm.aggregation import AggregatingAgents, Field, size
    >>> field = Field(200, time_step=0.002)
    >>> history = run(AggregatingAgents(), field, 500, 0, Radius(6.0))
    >>> size(field.positions) < 3.0
    True
"""

from acl_gym.swarm.aggregation.agents import AggregatingAgents
from acl_gym.swarm.aggregation.bounds import (
    resting_sum_of_squares,
    rms_bound,
    size_bound,
)
from acl_gym.swarm.aggregation.field import Field
from acl_gym.swarm.aggregation.flow import flow
from acl_gym.swarm.aggregation.forces import forces_over_links, forces_within
from acl_gym.swarm.aggregation.interaction import (
    BoundedRepulsion,
    Interaction,
    UnboundedRepulsion,
)
from acl_gym.swarm.aggregation.measures import (
    centre,
    nearest_distances,
    rms_distance,
    size,
    sum_of_squares,
)
from acl_gym.swarm.aggregation.obstacles import Obstacles
from acl_gym.swarm.aggregation.particles import Kinematic, Particles, PointMass
from acl_gym.swarm.aggregation.profiles import Gaussians, Plane, Profile, Quadratic

__all__ = [
    "AggregatingAgents",
    "BoundedRepulsion",
    "Field",
    "Gaussians",
    "Interaction",
    "Kinematic",
    "Obstacles",
    "Particles",
    "Plane",
    "PointMass",
    "Profile",
    "Quadratic",
    "UnboundedRepulsion",
    "centre",
    "flow",
    "forces_over_links",
    "forces_within",
    "nearest_distances",
    "resting_sum_of_squares",
    "rms_bound",
    "rms_distance",
    "size",
    "size_bound",
    "sum_of_squares",
]
