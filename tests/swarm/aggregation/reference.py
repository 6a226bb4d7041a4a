"""Equation (6.5) and its parts written out, agent by agent and in plain Python."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from acl_gym.swarm.aggregation import BoundedRepulsion, Interaction, UnboundedRepulsion

Vector = Sequence[float]


def parameter(value: object, agent: int) -> float:
    """The parameter of an agent, which may be the same for all."""
    array = np.asarray(value, dtype=np.float64)
    return float(array if array.ndim == 0 else array[agent])


def g(interaction: Interaction, agent: int, y: Vector) -> list[float]:
    """g(y) = -y [g_a(|y|) - g_r(|y|)] of an agent."""
    r = math.hypot(*y)
    if r == 0.0:
        return [0.0] * len(y)
    a = parameter(interaction.attraction, agent)
    b = parameter(interaction.repulsion, agent)
    if isinstance(interaction, BoundedRepulsion):
        repulsion = b * math.exp(-r * r / parameter(interaction.spread, agent))
    else:
        assert isinstance(interaction, UnboundedRepulsion)
        repulsion = b / (r * r)
    return [-each * (a - repulsion) for each in y]


def force(
    interaction: Interaction,
    agent: int,
    own: np.ndarray,
    heard: np.ndarray,
    neighbours: Sequence[int],
) -> list[float]:
    """The sum of g over some neighbours, oneself left out."""
    total = [0.0] * own.shape[1]
    for other in neighbours:
        if other == agent:
            continue
        y = [float(p - q) for p, q in zip(own[agent], heard[other], strict=True)]
        for axis, each in enumerate(g(interaction, agent, y)):
            total[axis] += each
    return total


def magnitude(
    interaction: Interaction,
    agent: int,
    own: np.ndarray,
    heard: np.ndarray,
    neighbours: Sequence[int],
) -> float:
    """What the rounding of `force` is measured by: the sizes of all parts of the sum."""
    a = parameter(interaction.attraction, agent)
    total = 0.0
    for other in neighbours:
        y = [float(p - q) for p, q in zip(own[agent], heard[other], strict=True)]
        r = math.hypot(*y)
        total += math.hypot(*g(interaction, agent, y)) + 2.0 * a * r
    return total
