"""Which agents are near each other: within a radius, or nearest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from acl_gym.swarm.cells import MOST_AXES, SLACK, sort_into_cells
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

_PAIRS_AT_ONCE = 10_000_000
"""Pairs of agents that are looked at before the room for links is checked."""

_NOTHING: IntArray = np.empty(0, np.int64)


def within_radius(
    x: FloatArray, sigma: FloatArray, include_self: bool
) -> tuple[IntArray, IntArray]:
    """For each agent i all agents j with |x_i - x_j| < sigma_i.

    Args:
        x: positions, `(n, dim)`, as `checked_positions` returns them.
        sigma: radii, `(n,)`, >= 0 or infinite.
        include_self: whether j may be i.

    Returns:
        The senders j of each receiver i in ascending order, and where those of each
        receiver begin, `(n + 1,)`.

    Raises:
        ValueError: no memory is large enough for them.
    """
    n = len(x)
    useful = sigma[(sigma > 0.0) & np.isfinite(sigma)]
    side = float(np.median(useful)) if useful.size else math.inf
    cells = sort_into_cells(np.ascontiguousarray(x[:, :MOST_AXES]), side)
    offsets = np.zeros(n + 1, np.int64)
    n_links, at_once = 0, max(1, _PAIRS_AT_ONCE // n)
    for begin in range(0, n, at_once):
        n_links += _within(
            *(x, sigma, include_self, cells),
            *(begin, min(begin + at_once, n), offsets, _NOTHING),
        )
        # Now and then, because counting what has no room would take long.
        validation.check_memory(
            f"{n_links:,} links", 24 * n_links, "use a smaller radius or fewer agents"
        )
    np.cumsum(offsets, out=offsets)
    sender = np.empty(n_links, np.int64)
    _within(x, sigma, include_self, cells, 0, n, offsets, sender)
    # Transposed twice, the senders of each receiver are sorted.
    return _transposed(*_transposed(sender, offsets))


def nearest(x: FloatArray, k: int, include_self: bool) -> tuple[IntArray, IntArray]:
    """For each agent the k others that are nearest to it; of ties, any.

    Args:
        x: positions, `(n, dim)`, as `checked_positions` returns them, of more than k
            agents.
        k: how many, >= 1.
        include_self: whether to add the agent itself.

    Returns:
        See `within_radius`.

    Raises:
        ValueError: no memory is large enough for them.
    """
    n = len(x)
    validation.check_memory(
        f"the {k} nearest of {n:,} agents", 40 * n * (k + 1), "use a smaller k"
    )
    _, found = cKDTree(x).query(x, k + 1)
    found = np.asarray(found, np.int64)
    others = found != np.arange(n)[:, None]
    # Where more than k others are in the same place, the agent itself may be missing.
    missing = np.flatnonzero(others.all(axis=1))
    found[missing, k], others[missing, k] = missing, False
    if not include_self:
        found = found[others].reshape(n, k)
    found.sort(axis=1)
    return found.reshape(-1), np.arange(n + 1) * found.shape[1]


@njit(error_model="numpy")
def _within(
    x: FloatArray,
    sigma: FloatArray,
    include_self: bool,
    cells: tuple[Any, ...],
    begin: int,
    end: int,
    offsets: IntArray,
    sender: IntArray,
) -> int:
    """Count the links of receiver i in `offsets[i + 1]`, or fill in the senders.

    Args:
        x: see `within_radius`.
        sigma: see there.
        include_self: see there.
        cells: the fields of `Cells`, of the first three coordinates.
        begin: the first of the receivers, in the order of the cells.
        end: the one after the last.
        offsets: receives the numbers of links; else where those of each receiver begin.
        sender: of no length, to count; else receives the senders, in any order.

    Returns:
        How many links they are.
    """
    shape, first, agent, cell, place, width = cells
    n, dim = x.shape
    planes, rows, columns = shape
    counting = sender.size == 0
    found = np.empty(0 if counting else n + 1, np.int64)
    total = 0
    for at in range(begin, end):
        i = agent[at]
        radius = sigma[i]
        rest, column = divmod(cell[at], columns)
        plane, row = divmod(rest, rows)
        to_planes = _reach(radius, width[0], planes)
        to_rows = _reach(radius, width[1], rows)
        to_columns = _reach(radius, width[2], columns)
        from_column = max(column - to_columns, 0)
        to_column = min(column + to_columns + 1, columns)
        x0, x1, x2 = place[0, at], place[1, at], place[2, at]
        count = 0
        for p in range(max(plane - to_planes, 0), min(plane + to_planes + 1, planes)):
            for q in range(max(row - to_rows, 0), min(row + to_rows + 1, rows)):
                line = (p * rows + q) * columns
                for j in range(first[line + from_column], first[line + to_column]):
                    d0, d1, d2 = x0 - place[0, j], x1 - place[1, j], x2 - place[2, j]
                    square = d0 * d0 + d1 * d1 + d2 * d2
                    for k in range(MOST_AXES, dim):
                        d = x[i, k] - x[agent[j], k]
                        square += d * d
                    if not counting:
                        # Overwritten by the next one if it is too far: no branch.
                        found[np.uint64(count)] = agent[j]
                    count += (np.sqrt(square) < radius) & (include_self | (j != at))
        total += count
        if counting:
            offsets[i + 1] = count
        else:
            for link in range(count):
                sender[offsets[i] + link] = found[link]
    return total


@njit(error_model="numpy")
def _reach(radius: float, width: float, count: int) -> int:
    """How many cells along an axis a radius reaches to either side."""
    cells = np.ceil(radius * SLACK / width)
    return int(cells) if cells < count else count


@njit
def _transposed(receivers: IntArray, begin: IntArray) -> tuple[IntArray, IntArray]:
    """The senders of each receiver, in ascending order."""
    n = begin.size - 1
    offsets = np.zeros(n + 1, np.int64)
    for i in receivers:
        offsets[i + 1] += 1
    for i in range(n):
        offsets[i + 1] += offsets[i]
    free = offsets[:-1].copy()
    senders = np.empty_like(receivers)
    for j in range(n):
        for link in range(begin[j], begin[j + 1]):
            i = receivers[link]
            senders[free[i]] = j
            free[i] += 1
    return senders, offsets
