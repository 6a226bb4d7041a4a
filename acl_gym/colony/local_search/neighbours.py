"""Nearest neighbours of cities: the candidates of local searches and of ants."""

from __future__ import annotations

import numpy as np

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray


@njit
def _fill_nearest(distances: FloatArray, neighbours: CellArray) -> None:
    n, k = neighbours.shape
    nearest = np.empty(k)
    for city in range(n):
        found = 0
        for other in range(n):
            distance = distances[city, other]
            if other == city or (found == k and not distance < nearest[k - 1]):
                continue
            i = found if found < k else k - 1
            while i > 0 and distance < nearest[i - 1]:
                nearest[i] = nearest[i - 1]
                neighbours[city, i] = neighbours[city, i - 1]
                i -= 1
            nearest[i] = distance
            neighbours[city, i] = other
            if found < k:
                found += 1


@njit
def distances_to(distances: FloatArray, neighbours: CellArray) -> FloatArray:
    n, k = neighbours.shape
    nearby = np.empty((n, k))
    for city in range(n):
        for i in range(k):
            nearby[city, i] = distances[city, neighbours[city, i]]
    return nearby
