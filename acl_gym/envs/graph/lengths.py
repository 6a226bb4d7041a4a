"""How long tours are."""

from __future__ import annotations

import numpy as np

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray


@njit
def tour_length(tour: CellArray, distances: FloatArray) -> float:
    """The length of a tour, the closing arc included.

    It is added up in the order of the steps, as in an environment, so that both give the
    same number to the last bit.

    Args:
        tour: the cities in their order, int32 `(n,)`; they are not checked.
        distances: `(n, n)`.
    """
    length = 0.0
    for t in range(tour.size):
        following = tour[t + 1] if t + 1 < tour.size else tour[0]
        length += distances[tour[t], following]
    return length


@njit
def tour_lengths(tours: CellArray, distances: FloatArray) -> FloatArray:
    """The `tour_length` of each tour, `(m,)`.

    Args:
        tours: the cities of each in their order, int32 `(m, n)`; they are not checked.
        distances: `(n, n)`.
    """
    lengths = np.empty(len(tours))
    for a in range(len(tours)):
        lengths[a] = tour_length(tours[a], distances)
    return lengths
