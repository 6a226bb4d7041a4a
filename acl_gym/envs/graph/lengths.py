"""How long tours are."""

from __future__ import annotations

import numpy as np

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray


@njit
def tour_lengths(tours: CellArray, distances: FloatArray) -> FloatArray:
    """The length of each tour, the closing arc included, `(m,)`.

    Added up in the order of the steps, as an environment does, so that both come to the
    same number bit for bit.

    Args:
        tours: the cities of each in their order, int32 `(m, n)`; they are not checked.
        distances: `(n, n)`.
    """
    m, n = tours.shape
    lengths = np.zeros(m)
    for a in range(m):
        for t in range(n):
            following = tours[a, t + 1] if t + 1 < n else tours[a, 0]
            lengths[a] += distances[tours[a, t], following]
    return lengths
