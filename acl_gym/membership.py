"""The kernels of partitions: membership functions (4.7), products (4.8), integers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
CellArray = NDArray[np.int32]


@njit(cache=True, error_model="numpy")
def locate_on_axis(
    x: float, edges: FloatArray, first: int, count: int, period: float, rate: float
) -> tuple[int, float]:
    """Find the interval of `x` between centres, and how far along it x lies.

    Args:
        x: one state variable, finite.
        edges: the centres of all axes in a row; this axis owns
            `edges[first : first + count]`. A circular axis repeats its first centre
            at the end, one period on.
        first: see `edges`.
        count: see `edges`.
        period: of a circular axis, 0 for any other.
        rate: 1 / spacing of a regular axis, 0 for an irregular one.

    Returns:
        `(i, fraction)`: x lies between centres i and i + 1, and the membership (4.7)
        is 1 - fraction to the former, fraction to the latter. Outside the centres
        the fraction saturates at 0 or 1.
    """
    if count == 1:
        return 0, 0.0
    if period > 0.0:
        turns = np.floor((x - edges[first]) / period)
        x -= period * turns
    last = count - 2
    if x <= edges[first]:
        return 0, 0.0
    if x >= edges[first + count - 1]:
        return last, 1.0
    if rate > 0.0:
        # On a regular axis the interval is known but for the rounding of the guess.
        low = min(int((x - edges[first]) * rate), last)
        while x < edges[first + low]:
            low -= 1
        while x >= edges[first + low + 1]:
            low += 1
    else:
        low, high = 0, count - 1
        while high - low > 1:
            middle = (low + high) // 2
            if x < edges[first + middle]:
                high = middle
            else:
                low = middle
    left = edges[first + low]
    return low, (x - left) / (edges[first + low + 1] - left)


@njit(cache=True, error_model="numpy")
def locate(
    states: FloatArray,
    slots: IntArray,
    edges: FloatArray,
    first: IntArray,
    count: IntArray,
    cells: IntArray,
    periods: FloatArray,
    rates: FloatArray,
    fuzzy: bool,
    index: CellArray,
    degree: FloatArray,
) -> int:
    """Fill rows of `index` and `degree`; return a slot that is not finite, or -1."""
    dimensions = cells.size
    for j in range(slots.size):
        slot = slots[j]
        index[j, 0] = 0
        degree[j, 0] = 1.0
        corners = 1
        for axis in range(dimensions):
            x = states[slot, axis]
            if not np.isfinite(x):
                return int(slot)
            low, fraction = locate_on_axis(
                x, edges, first[axis], count[axis], periods[axis], rates[axis]
            )
            n = cells[axis]
            # A circular axis ends where it begins; one cell alone is its own end.
            high = (low + 1) % n
            if not fuzzy:
                index[j, 0] = index[j, 0] * n + (high if fraction >= 0.5 else low)
                continue
            # Each corner splits in two along this axis: product of memberships (4.8).
            for c in range(corners - 1, -1, -1):
                cell = index[j, c] * n
                weight = degree[j, c]
                index[j, 2 * c] = cell + low
                degree[j, 2 * c] = weight * (1.0 - fraction)
                index[j, 2 * c + 1] = cell + high
                degree[j, 2 * c + 1] = weight * fraction
            corners *= 2
    return -1


@njit(cache=True)
def locate_discrete(
    states: NDArray[Any],
    slots: IntArray,
    sizes: IntArray,
    starts: IntArray,
    index: CellArray,
    degree: FloatArray,
) -> tuple[int, int]:
    """Fill rows of `index` and `degree` with the cells of integer states.

    Args:
        states: int64 or float64 `(n, d)`.
        slots: which rows of `states` to locate, `(m,)`.
        sizes: how many values each variable has, `(d,)`.
        starts: the smallest of them, `(d,)`.
        index: `(>= m, 1)`, receives the cells.
        degree: `(>= m, 1)`, receives ones.

    Returns:
        A slot and a variable whose value is not whole or not in range, or (-1, -1).
    """
    for j in range(slots.size):
        slot = slots[j]
        cell = 0
        for axis in range(sizes.size):
            x = states[slot, axis]
            # False for NaN; only after it is `int` sure to be exact.
            if not starts[axis] <= x < starts[axis] + sizes[axis]:
                return int(slot), axis
            value = int(x)
            if value != x:
                return int(slot), axis
            cell = cell * sizes[axis] + value - starts[axis]
        index[j, 0] = cell
        degree[j, 0] = 1.0
    return -1, -1
