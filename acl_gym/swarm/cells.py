"""Which agents are near each other, found through a grid of cells.

Positions are sorted by the cell in which they lie, over the first three axes at most.
An agent then looks only at cells within its reach, row by row of cells: those of a row
follow one another in the sorted list. Only cells with agents in them take memory. The
distance itself is that of all axes.
"""

from __future__ import annotations

import math

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

_MOST_CELLS = 2.0**20  # along an axis, so that three coordinates fit into 63 bits
_BITS = 20
_SLIGHTLY = 1.0 + 1e-6  # so that rounding of coordinates puts nobody out of reach
_A_LITTLE_MORE = 1.0 + 3e-6  # so that the usual radius still reaches one cell only


def within_radius(
    x: FloatArray, sigma: FloatArray, include_self: bool
) -> tuple[IntArray, IntArray]:
    """For each agent i all agents j with |x_i - x_j| < sigma_i.

    Args:
        x: positions, `(n, dim)`, finite.
        sigma: radii, `(n,)`, >= 0 or infinite.
        include_self: whether j may be i.

    Returns:
        The senders j of each receiver i in ascending order, and where those of each
        receiver begin, `(n + 1,)`.

    Raises:
        ValueError: no memory is large enough for them.
    """
    side = _side_for_radii(sigma)
    cells = _sorted_by_cell(x, side)
    offsets = np.zeros(len(x) + 1, np.int64)
    _within(x, sigma, include_self, *cells, offsets, np.empty(0, np.int64))
    np.cumsum(offsets, out=offsets)
    n_links = int(offsets[-1])
    validation.check_memory(
        f"{n_links:,} links", 16 * n_links, "use a smaller radius or fewer agents"
    )
    sender = np.empty(n_links, np.int64)
    _within(x, sigma, include_self, *cells, offsets, sender)
    return sender, offsets


def nearest(x: FloatArray, k: int, include_self: bool) -> tuple[IntArray, IntArray]:
    """For each agent the k others that are nearest to it.

    Args:
        x: positions, `(n, dim)`, finite, of more than k agents.
        k: how many, >= 1.
        include_self: whether to add the agent itself.

    Returns:
        See `within_radius`.

    Raises:
        ValueError: no memory is large enough for them.
    """
    n, each = len(x), k + include_self
    validation.check_memory(f"{n * each:,} links", 16 * n * each, "use a smaller k")
    sender = np.empty((n, each), np.int64)
    cells = _sorted_by_cell(x, _side_for_number(x, k + 1))
    _nearest(x, k, include_self, *cells, sender)
    return sender.reshape(-1), np.arange(n + 1) * each


Cells = tuple[IntArray, IntArray, IntArray, float]
"""Coordinates of the cells that agents lie in, `(n, 1 to 3)`; the numbers of these cells
in ascending order, and which agents those are, `(n,)`; the side of a cell."""


def _side_for_radii(sigma: FloatArray) -> float:
    """A side of cells that suits most of the agents."""
    useful = sigma[(sigma > 0.0) & np.isfinite(sigma)]
    return float(np.median(useful)) if useful.size else math.inf


def _side_for_number(x: FloatArray, wanted: int) -> float:
    """A side of cells, of which a block of three by three holds about so many agents."""
    axes = min(x.shape[1], 3)
    extent = np.sort(np.ptp(x[:, :axes], axis=0))
    share = (wanted / len(x)) ** (1.0 / axes)
    # What is flat counts with the axes that are not.
    return float(np.mean(extent) * share / 2.0)


def _sorted_by_cell(x: FloatArray, side: float) -> Cells:
    axes = min(x.shape[1], 3)
    low = x[:, :axes].min(axis=0)
    extent = float(np.max(x[:, :axes].max(axis=0) - low))
    side = max(side * _A_LITTLE_MORE, extent / (_MOST_CELLS - 2.0))
    if not 0.0 < side < math.inf:  # all agents in one place, or in each other's reach
        side = math.inf
        cell = np.zeros((len(x), axes), np.int64)
    else:
        cell = np.floor((x[:, :axes] - low) / side).astype(np.int64)
    key = _number(cell)
    order = np.argsort(key, kind="stable")
    return cell, key[order], order, side


def _number(cell: IntArray) -> IntArray:
    """The number of a cell; those of a row, along the last axis, follow one another."""
    number = cell[:, 0].copy()
    for axis in range(1, cell.shape[1]):
        number = (number << _BITS) + cell[:, axis]
    return number


@njit
def _found(
    i: int,
    reach: int,
    cell: IntArray,
    keys: IntArray,
    order: IntArray,
    buffer: IntArray,
) -> int:
    """Gather the agents in all cells within `reach` cells of that of agent i.

    Args:
        i: the agent.
        reach: how many cells to each side; negative: all cells there are.
        cell: see `Cells`.
        keys: see `Cells`.
        order: see `Cells`.
        buffer: `(n,)`, receives their numbers, in no particular order.

    Returns:
        How many they are.
    """
    n: int = cell.shape[0]
    axes = cell.shape[1]
    if reach < 0:
        for j in range(n):
            buffer[j] = j
        return n
    most = (1 << _BITS) - 1
    count = 0
    planes = reach if axes > 2 else 0
    rows = reach if axes > 1 else 0
    last = axes - 1
    first, end = max(cell[i, last] - reach, 0), min(cell[i, last] + reach, most)
    for p in range(-planes, planes + 1):
        plane = cell[i, 0] + p if axes > 2 else 0
        if plane < 0 or plane > most:
            continue
        for r in range(-rows, rows + 1):
            row = cell[i, axes - 2] + r if axes > 1 else 0
            if row < 0 or row > most:
                continue
            base = ((plane << _BITS) + row) << _BITS
            at = np.searchsorted(keys, base + first)
            while at < n and keys[at] <= base + end:
                buffer[count] = order[at]
                count += 1
                at += 1
    return count


@njit
def _reach_for(radius: float, side: float, axes: int, n: int) -> int:
    """How many cells a radius reaches; -1 where to look at all agents is cheaper."""
    if not radius < side * n:
        return -1
    reach = math.ceil(radius * _SLIGHTLY / side)
    if (2.0 * reach + 1.0) ** (axes - 1) > n:
        return -1
    return reach


@njit
def _distance(x: FloatArray, i: int, j: int) -> float:
    total = 0.0
    for k in range(x.shape[1]):
        total += (x[i, k] - x[j, k]) ** 2
    return math.sqrt(total)


@njit
def _within(
    x: FloatArray,
    sigma: FloatArray,
    include_self: bool,
    cell: IntArray,
    keys: IntArray,
    order: IntArray,
    side: float,
    offsets: IntArray,
    sender: IntArray,
) -> None:
    """Count the links of receiver i in `offsets[i + 1]`, or fill in the senders."""
    n, axes = cell.shape
    buffer = np.empty(n, np.int64)
    counting = sender.size == 0
    for i in range(n):
        reach = _reach_for(sigma[i], side, axes, n)
        looked_at = _found(i, reach, cell, keys, order, buffer)
        count = 0
        for c in range(looked_at):
            j = buffer[c]
            if _distance(x, i, j) < sigma[i] and (include_self or i != j):
                buffer[count] = j
                count += 1
        if counting:
            offsets[i + 1] = count
        else:
            sender[offsets[i] : offsets[i + 1]] = np.sort(buffer[:count])


@njit
def _nearest(
    x: FloatArray,
    k: int,
    include_self: bool,
    cell: IntArray,
    keys: IntArray,
    order: IntArray,
    side: float,
    sender: IntArray,
) -> None:
    n, axes = cell.shape
    buffer = np.empty(n, np.int64)
    distance = np.empty(k)
    chosen = np.empty(k + 1, np.int64)
    for i in range(n):
        reach = 1
        while True:
            rows = (2.0 * reach + 1.0) ** (axes - 1)
            all_of_them = rows > n or not side < math.inf
            if all_of_them:
                reach = -1
            looked_at = _found(i, reach, cell, keys, order, buffer)
            count = 0
            for c in range(looked_at):
                j = buffer[c]
                if j == i:
                    continue
                d = _distance(x, i, j)
                # Insert by distance, then by number.
                if count == k and (
                    d > distance[k - 1] or (d == distance[k - 1] and j > chosen[k - 1])
                ):
                    continue
                place = min(count, k - 1)
                while place > 0 and (
                    d < distance[place - 1]
                    or (d == distance[place - 1] and j < chosen[place - 1])
                ):
                    distance[place] = distance[place - 1]
                    chosen[place] = chosen[place - 1]
                    place -= 1
                distance[place], chosen[place] = d, j
                count = min(count + 1, k)
            # Whoever has not been looked at is farther away than `reach` sides.
            if all_of_them or (
                count == k and distance[k - 1] < reach * side / _SLIGHTLY
            ):
                break
            reach *= 2
        if include_self:
            chosen[k] = i
            sender[i] = np.sort(chosen)
        else:
            sender[i] = np.sort(chosen[:k])
