"""Candidate lists: the few actions of each cell that ants look at first."""

from __future__ import annotations

import numpy as np

from acl_gym.utils.typing import CellArray, FloatArray

NONE: CellArray = np.empty((0, 0), dtype=np.int32)
"""What kernels take as candidates where there are no lists: every action is one."""


def candidate_lists(heuristic: FloatArray, count: int) -> CellArray:
    """The actions with the largest heuristic variables of each cell, `(n_cells, k)`.

    With 1 / distance they are the nearest neighbours. Of equal ones, the first.

    Args:
        heuristic: eta, `(n_cells, n_actions)`.
        count: how many, >= 1; k is the number of actions where there are not so many.

    Returns:
        Each row ascending, so that choosing among all actions and choosing among
        candidates adds up weights in the same order.
    """
    count = min(count, heuristic.shape[1])
    lists = np.empty((len(heuristic), count), dtype=np.int32)
    for cell, row in enumerate(heuristic):  # all at once would take twice the table
        lists[cell] = np.sort(np.argsort(-row, kind="stable")[:count])
    return lists


def inverse_distances(distances: FloatArray) -> FloatArray:
    """eta_ij = 1 / d_ij of the travelling salesman (§2.4.2), `(n, n)`, 0 where i = j.

    Between different cities at the same place: ten times the largest of the others, so
    that an ant all but surely goes there next; 1 where all cities are at the same place.

    Args:
        distances: `(n, n)`, >= 0.
    """
    apart = distances > 0.0
    nearest = distances[apart].min() if apart.any() else 10.0
    eta = np.divide(
        1.0, distances, out=np.full(distances.shape, 10.0 / nearest), where=apart
    )
    np.fill_diagonal(eta, 0.0)
    return eta
