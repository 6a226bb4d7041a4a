"""What pictures of graphs share: where cities lie, and which arcs are drawn."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.envs.graph.instances import TravellingSalesmanInstance
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray

ARCS_A_CITY = 8
"""Of each city the arcs with the highest levels are drawn; all would hide the map."""


def places_of(instance: TravellingSalesmanInstance) -> FloatArray:
    """Where the cities are drawn, `(n, 2)`: on a circle where nothing tells."""
    if instance.coordinates is not None:
        return instance.coordinates
    angles = 2.0 * np.pi * np.arange(instance.n_cities) / instance.n_cities
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


def checked_levels(levels: Any, n_cities: int) -> FloatArray:
    """Return levels of pheromone if there is one for each arc.

    Args:
        levels: the candidate; it is not copied.
        n_cities: how many cities there are.

    Raises:
        TypeError: it is not a NumPy array.
        ValueError: it has another shape, or levels are negative or not finite.
    """
    if not isinstance(levels, np.ndarray):
        raise TypeError(
            "the table of pheromone must be a NumPy array, got "
            f"{type(levels).__name__}."
        )
    if levels.shape != (n_cities, n_cities) or levels.dtype.kind not in "fiu":
        raise ValueError(
            "the table of pheromone must have a row and a column for each city, shape "
            f"({n_cities}, {n_cities}), got {validation.shown(levels.dtype)} of shape "
            f"{levels.shape}."
        )
    if not (np.isfinite(levels) & (levels >= 0)).all():
        raise ValueError(
            "the table of pheromone must hold finite levels >= 0; subtract the least "
            "value from other values."
        )
    return levels


def strongest_arcs(levels: FloatArray) -> tuple[IntArray, FloatArray]:
    """The arcs with the highest levels of each city, the highest of all last.

    Args:
        levels: >= 0, `(n, n)`; the diagonal does not count.

    Returns:
        Pairs of cities `(m, 2)`, and their levels as shares of the way from the lowest
        to the highest of all, `(m,)` in [0, 1]. Arcs with the lowest level are left
        out; so all are, where all are equal.
    """
    n = len(levels)
    off = np.where(np.eye(n, dtype=np.bool_), -1.0, levels)
    count = min(ARCS_A_CITY, n - 1)
    heads = np.argpartition(off, n - count, axis=1)[:, n - count :]
    tails = np.repeat(np.arange(n), count)
    arcs = np.stack([tails, heads.ravel()], axis=1)
    found = off[arcs[:, 0], arcs[:, 1]]
    lowest = off[off >= 0].min()
    span = found.max() - lowest
    shares = (found - lowest) / (span if span > 0 else 1.0)
    order = np.argsort(shares, kind="stable")
    order = order[shares[order] > 0.0]
    return arcs[order], shares[order]
