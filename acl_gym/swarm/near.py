"""Which agents are near each other: within a radius, or nearest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from acl_gym.swarm.cells import MOST_AXES, SLACK, sort_into_cells, squared_reaches
from acl_gym.swarm.rows import check_room
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

_FEW_PAIRS = 4_000_000
"""Pairs of agents in neighbouring cells up to which room for all of them is reserved."""

_SAMPLE = 100
"""Agents whose links are counted to see whether there is room for those of all."""

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
    counts, room = np.empty(n, np.int64), _pairs(sigma, cells, _FEW_PAIRS)
    if room > _FEW_PAIRS:
        room = n + _counted(x, sigma, include_self, cells, counts)
    sender = np.empty(room, np.int64)
    n_links = _within(x, sigma, include_self, cells, 1, counts, sender)
    return _transposed(*_by_sender(sender[:n_links], counts, cells[2]))


def _counted(
    x: FloatArray,
    sigma: FloatArray,
    include_self: bool,
    cells: tuple[Any, ...],
    counts: IntArray,
) -> int:
    """Count the links before there is room for them; see `within_radius`."""
    n = len(x)
    step = max(1, n // _SAMPLE)
    sampled = _within(x, sigma, include_self, cells, step, counts, _NOTHING)
    about = sampled * n // -(-n // step)
    check_room(about, "use a smaller radius or fewer agents")
    return int(_within(x, sigma, include_self, cells, 1, counts, _NOTHING))


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
    check_room(n * (k + 1), "use a smaller k")
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
    step: int,
    counts: IntArray,
    sender: IntArray,
) -> int:
    """Count the links of some receivers, and list the senders if there is room.

    Args:
        x: see `within_radius`.
        sigma: see there.
        include_self: see there.
        cells: the fields of `Cells`, of the first three coordinates.
        step: 1 for all receivers, 2 for every other one in the order of the cells.
        counts: `(n,)`, receives how many links each receiver has.
        sender: receives the senders, receiver after receiver in the order of the cells,
            and has room for n more; or of no length.

    Returns:
        How many links they are.
    """
    _, first, agent, _, place, _ = cells
    dim = x.shape[1]
    listing = sender.size > 0
    reaches = squared_reaches(sigma)
    total = 0
    for at in range(0, agent.size, step):
        i = agent[at]
        planes, rows, columns = _block(at, sigma[i], cells)
        reach = reaches[i]
        x0, x1, x2 = place[0, at], place[1, at], place[2, at]
        count = 0
        for p in range(planes[0], planes[1]):
            for q in range(rows[0], rows[1]):
                line = _line(p, q, cells)
                for j in range(first[line + columns[0]], first[line + columns[1]]):
                    d0, d1, d2 = x0 - place[0, j], x1 - place[1, j], x2 - place[2, j]
                    square = d0 * d0 + d1 * d1 + d2 * d2
                    for k in range(MOST_AXES, dim):
                        d = x[i, k] - x[agent[j], k]
                        square += d * d
                    if listing:
                        # Overwritten by the next one if it is too far: no branch.
                        sender[np.uint64(total + count)] = agent[j]
                    count += (square < reach) & (include_self | (j != at))
        total += count
        counts[i] = count
    return total


@njit(error_model="numpy")
def _pairs(sigma: FloatArray, cells: tuple[Any, ...], enough: int) -> int:
    """How many pairs of agents `_within` looks at; it stops beyond `enough`."""
    _, first, agent, _, _, _ = cells
    total = 0
    for at in range(agent.size):
        planes, rows, columns = _block(at, sigma[agent[at]], cells)
        for p in range(planes[0], planes[1]):
            for q in range(rows[0], rows[1]):
                line = _line(p, q, cells)
                total += first[line + columns[1]] - first[line + columns[0]]
        if total > enough:
            break
    return total


Span = tuple[int, int]


@njit(inline="always")
def _block(at: int, radius: float, cells: tuple[Any, ...]) -> tuple[Span, Span, Span]:
    """The planes, rows and columns of cells that the radius of an agent reaches."""
    shape, _, _, cell, _, width = cells
    rest, column = divmod(cell[at], shape[2])
    plane, row = divmod(rest, shape[1])
    return (
        _span(plane, radius, width[0], shape[0]),
        _span(row, radius, width[1], shape[1]),
        _span(column, radius, width[2], shape[2]),
    )


@njit(error_model="numpy")
def _span(index: int, radius: float, width: float, count: int) -> Span:
    """The cells along an axis that a radius reaches: the first, and the one after the last."""
    cells = np.ceil(radius * SLACK / width)
    reach = int(cells) if cells < count else count
    return max(index - reach, 0), min(index + reach + 1, count)


@njit(inline="always")
def _line(plane: int, row: int, cells: tuple[Any, ...]) -> int:
    """The number of the first cell of a row."""
    shape = cells[0]
    return int((plane * shape[1] + row) * shape[2])


@njit
def _by_sender(
    sender: IntArray, counts: IntArray, order: IntArray
) -> tuple[IntArray, IntArray]:
    """The receivers of each sender, in any order, and where those of each begin.

    Args:
        sender: of all links, receiver after receiver.
        counts: how many links each receiver has.
        order: the receivers in that order.
    """
    n = order.size
    begin = _begins(sender, n)
    free = begin[:-1].copy()
    receivers = np.empty_like(sender)
    link = 0
    for i in order:
        for _ in range(counts[i]):
            j = sender[link]
            receivers[free[j]] = i
            free[j] += 1
            link += 1
    return receivers, begin


@njit
def _begins(agents: IntArray, n: int) -> IntArray:
    """Where the links of each of `n` agents begin, if they stand one agent after another.

    Args:
        agents: whose each link is, in any order.
        n: the number of agents.

    Returns:
        `(n + 1,)`; the last entry is the number of links.
    """
    begin = np.zeros(n + 1, np.int64)
    for i in agents:
        begin[i + 1] += 1
    for i in range(n):
        begin[i + 1] += begin[i]
    return begin


@njit
def _transposed(receivers: IntArray, begin: IntArray) -> tuple[IntArray, IntArray]:
    """The senders of each receiver, in ascending order."""
    n = begin.size - 1
    offsets = _begins(receivers, n)
    free = offsets[:-1].copy()
    senders = np.empty_like(receivers)
    for j in range(n):
        for link in range(begin[j], begin[j + 1]):
            i = receivers[link]
            senders[free[i]] = j
            free[i] += 1
    return senders, offsets
