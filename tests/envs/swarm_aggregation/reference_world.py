"""What agents see of each other and what it costs them, written out pair by pair."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.envs.swarm_aggregation import SwarmAggregation
from acl_gym.swarm.aggregation import BoundedRepulsion
from tests.swarm.aggregation.reference import force


def others_by_distance(x: np.ndarray, agent: int) -> list[tuple[float, int]]:
    """All other agents, the nearest first."""
    return sorted(
        (math.dist(x[agent], x[other]), other)
        for other in range(len(x))
        if other != agent
    )


def heard_by(system: SwarmAggregation, x: np.ndarray, agent: int) -> list[int]:
    """Those within the sensing radius, the nearest first."""
    return [other for r, other in others_by_distance(x, agent) if not r >= system.reach]


def rule(system: SwarmAggregation, x: np.ndarray, agent: int) -> np.ndarray:
    """The mean of (6.5) over those heard minus the slopes, as long as it may be."""
    heard = heard_by(system, x, agent)
    law = BoundedRepulsion(
        attraction=system.attraction, repulsion=system.repulsion, spread=system.spread
    )
    u = np.array(force(law, agent, x, x, heard)) / max(1, len(heard))
    for cx, cy, depth, width in system.valleys:
        y = x[agent] - [cx, cy]
        u -= depth / width**2 * math.exp(-0.5 * (y @ y) / width**2) * y
    for cx, cy, radius in system.obstacles:
        y = x[agent] - [cx, cy]
        r = math.hypot(*y)
        overlap = 0.5 - (r - radius)
        if overlap > 0:
            u += overlap / system.time_step * y / r
    norm = math.hypot(*u)
    most = system.max_force if system.point_mass else system.max_speed
    return u * min(1.0, most / norm) if norm > 0 else u


def observation(
    system: SwarmAggregation, states: np.ndarray, agent: int
) -> list[float]:
    """What an agent observes, number by number."""
    x, own = states[:, :2], states[agent]
    if system.observe == "potential":
        return [*own[2:], *rule(system, x, agent)]
    heard = heard_by(system, x, agent)
    seen: list[Any] = [*own]
    if system.sensing_radius is not None:
        seen.append(len(heard) / max(1, len(x) - 1))
    mean = np.mean([x[other] - own[:2] for other in heard], axis=0) if heard else [0, 0]
    seen += [*mean]
    for k in range(system.nearest):
        seen += [*(x[heard[k]] - own[:2])] if k < len(heard) else [0.0, 0.0]
    return [float(each) for each in seen]


def cost(system: SwarmAggregation, states: np.ndarray, agent: int, hit: bool) -> float:
    """The stage cost of an agent, which an obstacle has stopped or not."""
    x = states[:, :2]
    distance = math.dist(x[agent], x.mean(axis=0))
    near = [r for r, _ in others_by_distance(x, agent) if r < system.collision_distance]
    total = system.distance_weight * distance
    total += system.collision_weight * (len(near) + hit)
    for cx, cy, depth, width in system.valleys:
        square = math.dist(x[agent], (cx, cy)) ** 2
        height = -depth * math.exp(-0.5 * square / width**2)
        total += system.profile_weight * (height + max(depth, 0.0))
    return total
