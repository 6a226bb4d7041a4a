"""Nearest neighbours of cities, to which local searches lead new arcs.

Ants have lists of their own, `colony.candidates`: those follow the heuristic, which may
be any, and are in the order of the cities.
"""

from __future__ import annotations

import numpy as np

from acl_gym.envs.graph.cities import TravellingSalesmanInstance, checked_instance
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray


def nearest_neighbours(instance: TravellingSalesmanInstance, k: int) -> CellArray:
    """The k cities that are nearest from each city, the nearest first.

    Of cities equally far, that with the lower number comes first.

    Args:
        instance: the cities.
        k: >= 1; of fewer than k other cities, all are returned.

    Returns:
        Indices of cities, `(n, min(k, n - 1))`.

    Raises:
        TypeError: `instance` is none, or `k` is not an integer.
        ValueError: k < 1.
    """
    n = checked_instance(instance).n_cities
    k = min(validation.integer("k", k, at_least=1), n - 1)
    neighbours = np.empty((n, k), np.int32)
    _fill_nearest(instance.distances, neighbours)
    return neighbours


@njit
def _fill_nearest(distances: FloatArray, neighbours: CellArray) -> None:
    n, k = neighbours.shape
    nearest = np.empty(k)
    for city in range(n):
        found = 0
        for other in range(n):
            distance = distances[city, other]
            if other == city or (found == k and distance >= nearest[k - 1]):
                continue
            if found < k:
                found += 1
            i = found - 1
            while i > 0 and distance < nearest[i - 1]:
                nearest[i] = nearest[i - 1]
                neighbours[city, i] = neighbours[city, i - 1]
                i -= 1
            nearest[i] = distance
            neighbours[city, i] = other


@njit
def fill_nearby(
    distances: FloatArray, neighbours: CellArray, nearby: FloatArray
) -> int:
    """Fill in the distances of neighbours.

    Returns:
        -1, or the first city with wrong neighbours: one that is not another city, or is
        nearer than the one before it.
    """
    n, k = neighbours.shape
    for city in range(n):
        last = 0.0
        for i in range(k):
            other = neighbours[city, i]
            if not 0 <= other < n or other == city:
                return city
            nearby[city, i] = distances[city, other]
            if nearby[city, i] < last:
                return city
            last = nearby[city, i]
    return -1
