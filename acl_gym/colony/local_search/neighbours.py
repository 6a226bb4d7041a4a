"""Nearest neighbours of cities: the candidates of local searches and of ants."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray


def nearest_neighbours(distances: Any, k: int) -> CellArray:
    """The k cities that are nearest from each city, the nearest first.

    Of cities equally far, that with the lower number comes first.

    Args:
        distances: from city i (row) to city j (column), `(n, n)`; the diagonal does
            not count.
        k: >= 1; of fewer than k other cities, all are returned.

    Returns:
        Indices of cities, `(n, min(k, n - 1))`.

    Raises:
        TypeError: `k` is not an integer.
        ValueError: the distances are no square matrix of numbers >= 0, or k < 1.
    """
    matrix = checked_distances(distances)
    n = len(matrix)
    k = min(validation.integer("k", k, at_least=1), n - 1)
    neighbours = np.empty((n, k), np.int32)
    if k:
        _fill_nearest(matrix, neighbours)
    return neighbours


def checked_distances(distances: Any) -> FloatArray:
    """Distances as kernels take them: float64, C-contiguous, read-only.

    They are copied only where they must be converted.

    Raises:
        ValueError: they are no square matrix of finite numbers >= 0.
    """
    if type(distances) is not np.ndarray or distances.dtype != np.float64:
        distances = validation.real_array("distances", distances, ndim=2)
    validation.check_square("distances", distances.shape, "city")
    # Kernels are compiled once, for arrays that may not be written to.
    matrix: FloatArray = validation.read_only(np.ascontiguousarray(distances))
    if not (matrix.min() >= 0.0 and matrix.max() < np.inf):  # NaN fails both
        raise ValueError(
            "distances must be finite numbers >= 0, got some that are negative, "
            "infinite or NaN; give arcs that do not exist a distance longer than any "
            "tour."
        )
    return matrix


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
    """Fill in the distances of neighbours; -1, or the first city whose are wrong.

    They are wrong where they are no other cities or not in the order of distance.
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
