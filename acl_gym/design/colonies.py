"""Which colony learns a plant, so that nobody needs to choose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.agents.returning import ReturningACL
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.plant import Plant
from acl_gym.partitions import Partition
from acl_gym.partitions.automatic import automatic_partition

FEW_ANTS, MORE_ANTS = 5, 10
"""Ants for a plant of at most two variables, and of more, unless the plant says."""

# Found on the cart-pole swing-up, as were the cells: with the settings for few variables
# 100,000 steps take 25 s and more, for most of the time goes into walking back.
_MANY_VARIABLES: dict[str, Any] = {
    "steps_per_walk": 1_200,
    "walks_back": 3,
    "older_steps": 7_200,
    "learning_rate": 0.7,
    "visits_to_grow": 1.5,
    "max_cells": 80_000,
    "memory_size": 1_000_000,
}

_LEAST_CELLS = {3: 5, 4: 5, 5: 4, 6: 3}
_MOST_CELLS = {3: 15, 4: 12, 5: 7, 6: 5}


def colony_for(env: ControlVectorEnv, seed: int) -> ReturningACL:
    """Make a colony for a plant: few ants, and their settings by its number of variables.

    Args:
        env: the plant. If it has two slots or more, there are as many ants. A plant has
            one slot by default, which leaves the number to this function.
        seed: of the colony.

    Returns:
        A `ReturningACL` with an environment of its own.

    Raises:
        ValueError: there are more than six variables.
    """
    system = env.system
    if not isinstance(system, Plant) or system.low.size <= 2:
        return ReturningACL(_with_ants(env, FEW_ANTS), seed=seed)
    own = _with_ants(env, MORE_ANTS)
    partition = first_cells(own, system)
    return ReturningACL(own, partition, grows=True, seed=seed, **_MANY_VARIABLES)


def _with_ants(env: ControlVectorEnv, count: int) -> ControlVectorEnv:
    """A copy with a slot for each ant, `count` of them where the plant has a single one."""
    return env.with_slots(env.num_envs if env.num_envs > 1 else count)


def first_cells(env: ControlVectorEnv, plant: Plant) -> Partition:
    """Coarse cells to begin with: the finer the goal, the more of them.

    Along each variable there are as many as goals fit into its range, within limits: what
    must be met exactly must be told apart.

    Args:
        env: the plant as an environment.
        plant: its system, of three variables or more.
    """
    size, goal = plant.low.size, plant.goal_box
    if goal is None or size not in _LEAST_CELLS:
        return automatic_partition(env)
    least, most = _LEAST_CELLS[size], _MOST_CELLS[size]
    cells = []
    for axis in range(size):
        span = plant.high[axis] - plant.low[axis]
        width = goal[1, axis] - goal[0, axis]
        fits = span / width if width > 0.0 else math.inf
        count = int(np.clip(fits, least, most))
        # Not circular: an odd number, so that the middle of the range is a centre.
        round_axis = axis in plant.circular
        cells.append(count if round_axis or count % 2 else count - 1)
    return automatic_partition(env, cells=[max(count, 2) for count in cells])
