"""A partition whose cells and degrees are whatever a test says they are."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.colony.solutions import Solutions
from acl_gym.partitions import Partition

Array = np.ndarray


class Listed(Partition):
    """State i has the cells `index[i]` and the degrees `degree[i]`."""

    state_ndim = 0
    checked = True

    def __init__(self, index: Array, degree: Array) -> None:
        self.index, self.degree = index.astype(np.int32), degree
        self.n_cells = int(index.max()) + 1
        self.cells_per_state = index.shape[1]

    def locate(self, states: Array, slots: Array, index: Array, degree: Array) -> None:
        rows = states[slots]
        index[: len(rows)] = self.index[rows]
        degree[: len(rows)] = self.degree[rows]

    def settings(self) -> dict[str, Any]:
        raise NotImplementedError

    def cell_states(self) -> Array:
        raise NotImplementedError


def recorded(
    index: Array,
    degree: Array,
    action: Array,
    length: Array | None = None,
    n_actions: int = 256,
) -> Solutions:
    """Solutions of ants whose steps are given, as a colony records them.

    Args:
        index: `(ants, steps, k)`.
        degree: `(ants, steps, k)`.
        action: `(ants, steps)`.
        length: how many of the steps each ant makes; None: all.
        n_actions: the number of actions.
    """
    n, steps, k = index.shape
    length = np.full(n, steps) if length is None else length
    partition = Listed(index.reshape(-1, k), degree.reshape(-1, k))
    solutions = Solutions(n, steps, n_actions, partition)
    for t in range(steps):
        ants = np.flatnonzero(length > t)
        seen = np.arange(n) * steps + t
        solutions.append(ants, seen, partition.index[seen[ants]], action[ants, t])
    return solutions
