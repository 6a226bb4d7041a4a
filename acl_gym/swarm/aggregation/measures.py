"""What a swarm as a whole is like: where it is, how large, how close its agents are."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from acl_gym.swarm.rows import checked_positions
from acl_gym.utils.typing import FloatArray


def centre(positions: ArrayLike) -> FloatArray:
    """The mean of `(n, dim)` positions, `(dim,)`."""
    return np.asarray(checked_positions(positions).mean(axis=0))


def size(positions: ArrayLike) -> float:
    """The distance of the outermost agent from the centre, of `(n, dim)` positions."""
    return float(_distances(positions).max())


def rms_distance(positions: ArrayLike) -> float:
    """The root mean square distance from the centre, of `(n, dim)` positions."""
    return float(np.sqrt(np.square(_distances(positions)).mean()))


def sum_of_squares(positions: ArrayLike) -> float:
    """S, the sum of |x_i - centre|^2, of `(n, dim)` positions."""
    return float(np.square(_distances(positions)).sum())


def nearest_distances(positions: ArrayLike) -> FloatArray:
    """The distance of each agent from the one nearest to it; infinity for one agent.

    Args:
        positions: `(n, dim)`.

    Returns:
        `(n,)`.
    """
    x = checked_positions(positions)
    if len(x) == 1:
        return np.full(1, np.inf)
    # The nearest of all is oneself, or another one in the same place.
    return np.asarray(cKDTree(x).query(x, k=2)[0][:, 1])


def _distances(positions: ArrayLike) -> FloatArray:
    x = checked_positions(positions)
    return np.asarray(np.linalg.norm(x - x.mean(axis=0), axis=1))
