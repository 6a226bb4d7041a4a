"""The kernels of partitions: membership functions (4.7), products (4.8), integers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from acl_gym.utils.compiling import njit
from acl_gym.utils.threads import shared_among_threads
from acl_gym.utils.typing import CellArray, FloatArray, IntArray

OUTSIDE = -2
"""What `locate` returns if a slot is not a row of the states."""

BLOCK = 256
"""States that `locate` handles at a time, so that scratch stays in the nearest cache."""

Axes = tuple[
    tuple[int, ...],
    tuple[int, ...],
    tuple[int, ...],
    tuple[float, ...],
    tuple[float, ...],
]
"""What `locate` knows about each axis: where its centres begin in `edges` and how many
there are (a circular axis repeats its first centre at the end, one period on), its
number of cells, its period (0: none), and 1 / spacing (0: irregular)."""

MOST_WRITTEN_OUT = 16
"""The longest loop that `written_out` unrolls."""

MOST_COUNTED = 32
"""Number of irregular centres up to which a vectorised loop over the centres is faster
than a search for each state."""


def written_out(size: int) -> tuple[int, ...]:
    """Return a tuple of `size` zeros, for kernels with a short loop of that length.

    The length of a tuple belongs to its type: a kernel that takes one is compiled for
    that number of actions, or of cells per state, with the loop unrolled, which halves
    its time. Longer loops than `MOST_WRITTEN_OUT` get an empty tuple and stay
    loops.
    """
    return (0,) * size if size <= MOST_WRITTEN_OUT else ()


@njit(error_model="numpy")
def locate_on_axis(
    x: FloatArray,
    edges: FloatArray,
    period: float,
    rate: float,
    low: CellArray,
    fraction: FloatArray,
    left: FloatArray,
    right: FloatArray,
) -> None:
    """Find the interval of each x between centres, and how far along it x lies.

    x lies between centres `low` and `low` + 1, and the membership (4.7) is 1 -
    `fraction` to the former, `fraction` to the latter. Outside the centres the
    fraction saturates at 0 or 1. The loops are short and separate, so that all but the
    look-up of centres are vectorised.

    Args:
        x: values of one state variable, finite, `(m,)`; changed into values between
            the outermost centres.
        edges: the centres of the axis.
        period: of a circular axis, 0 for any other.
        rate: 1 / spacing of a regular axis, 0 for an irregular one.
        low: receives the intervals, `(>= m,)`.
        fraction: receives the fractions, `(>= m,)`.
        left: scratch, `(>= m,)`.
        right: scratch, `(>= m,)`.
    """
    first, last, end = edges[0], edges.size - 2, edges[edges.size - 1]
    if last < 0:
        low[: x.size] = 0
        fraction[: x.size] = 0.0
        return
    if period > 0.0:
        for i in range(x.size):
            x[i] -= period * np.floor((x[i] - first) / period)
    for i in range(x.size):
        # Written so that NaN, to which huge values of a circular variable may overflow,
        # does not pass: kernels index by the result.
        value = x[i] if x[i] > first else first
        x[i] = value if value < end else end
    if rate > 0.0:
        # On a regular axis the interval is known but for the rounding of the guess.
        highest = float(last)
        for i in range(x.size):
            low[i] = np.int32(min((x[i] - first) * rate, highest))
    elif last < MOST_COUNTED:
        low[: x.size] = 0
        for interval in range(1, last + 1):
            bound = edges[interval]
            for i in range(x.size):
                low[i] += x[i] >= bound
    else:
        for i in range(x.size):
            low[i] = min(np.searchsorted(edges, x[i], side="right") - 1, last)
    for i in range(x.size):
        centre = np.uint64(low[i])  # unsigned: no check for indices from the end
        left[i] = edges[centre]
        right[i] = edges[centre + np.uint64(1)]
    wrong = 0
    for i in range(x.size):
        wrong += (x[i] < left[i]) | ((x[i] >= right[i]) & (right[i] < end))
        fraction[i] = (x[i] - left[i]) / (right[i] - left[i])
    if wrong == 0:
        return
    # Rarely: only states within rounding of a centre are guessed wrong.
    for i in range(x.size):
        interval = low[i]
        while x[i] < edges[interval]:
            interval -= 1
        while x[i] >= edges[interval + 1] and interval < last:
            interval += 1
        low[i] = interval
        width = edges[interval + 1] - edges[interval]
        fraction[i] = (x[i] - edges[interval]) / width


@njit
def _first_not_finite(states: FloatArray, slots: IntArray) -> int:
    for slot in slots:
        if not np.isfinite(states[slot]).all():
            return int(slot)
    return -1


@njit
def scratch_for(dimensions: int) -> tuple[CellArray, FloatArray]:
    """Return the scratch of `locate_block`, for states with this many variables."""
    ends = np.empty((2 * dimensions, BLOCK), np.int32)
    return ends, np.empty((3 + dimensions, BLOCK))


@njit(error_model="numpy")
def locate_block(
    states: FloatArray,
    slots: IntArray,
    edges: FloatArray,
    axes: Axes,
    fuzzy: bool,
    index: CellArray,
    degree: FloatArray,
    block: int,
    ends: CellArray,
    reals: FloatArray,
) -> int:
    """Do what `locate` does for the `BLOCK` slots from `block` * `BLOCK` on.

    `ends` and `reals` are scratch, see `scratch_for`.
    """
    start = block * BLOCK
    size = min(BLOCK, slots.size - start)
    rows = np.uint64(states.shape[0])
    outside: Any = 0
    for i in range(size):
        # Unsigned, so that negative ones become huge.
        outside += bool(np.uint64(slots[start + i]) >= rows)
    if outside > 0:
        return OUTSIDE
    first, count, cells, period, rate = axes
    dimensions = len(cells)
    # What the cells below and above each state add to the index (4.8), per axis.
    low, high, fraction = ends[:dimensions], ends[dimensions:], reals[3:]
    x, left, right = reals[0, :size], reals[1], reals[2]
    stride = 1
    for a in range(dimensions - 1, -1, -1):
        finite = True
        for i in range(size):
            x[i] = states[np.uint64(slots[start + i]), a]
            finite &= np.isfinite(x[i])
        if not finite:
            return _first_not_finite(states, slots[start : start + size])
        own_edges = edges[first[a] : first[a] + count[a]]
        below, above, share = low[a], high[a], fraction[a]
        locate_on_axis(x, own_edges, period[a], rate[a], below, share, left, right)
        # A circular axis ends where it begins; one cell alone is its own end.
        step, top = np.int32(stride), np.int32((cells[a] - 1) * stride)
        for i in range(size):
            below[i] *= step
            above[i] = below[i] + step if below[i] < top else 0
        stride *= cells[a]
    if fuzzy:
        _corners(low, high, fraction, cells, index, degree, start, size)
        return -1
    nearest = low[0]
    for a in range(dimensions):
        below, above, share = low[a], high[a], fraction[a]
        for i in range(size):
            chosen = above[i] if share[i] >= 0.5 else below[i]
            nearest[i] = chosen if a == 0 else nearest[i] + chosen
    for i in range(size):
        index[start + i, 0] = nearest[i]
        degree[start + i, 0] = 1.0
    return -1


@njit(error_model="numpy", inline="always")
def _corners(
    low: CellArray,
    high: CellArray,
    fraction: FloatArray,
    cells: tuple[int, ...],
    index: CellArray,
    degree: FloatArray,
    start: int,
    size: int,
) -> None:
    """The cells around each state and their degrees, the products (4.8)."""
    dimensions = len(cells)
    for i in range(size):
        j, state = np.uint64(start + i), np.uint64(i)
        if dimensions <= 2:
            # So few that the compiler unrolls the loops and keeps values in registers.
            for c in range(1 << dimensions):
                cell, weight = np.int32(0), 1.0
                for a in range(dimensions):
                    share = fraction[a, state]
                    up = (c >> (dimensions - 1 - a)) & 1
                    cell += high[a, state] if up else low[a, state]
                    weight *= share if up else 1.0 - share
                index[j, np.uint64(c)] = cell
                degree[j, np.uint64(c)] = weight
            continue
        index[j, 0] = 0
        degree[j, 0] = 1.0
        corners = 1
        for a in range(dimensions):
            below, above = low[a, state], high[a, state]
            share = fraction[a, state]
            # Each corner splits in two along this axis.
            for c in range(corners - 1, -1, -1):
                corner, even, odd = np.uint64(c), np.uint64(2 * c), np.uint64(2 * c + 1)
                cell, weight = index[j, corner], degree[j, corner]
                index[j, even] = cell + below
                degree[j, even] = weight * (1.0 - share)
                index[j, odd] = cell + above
                degree[j, odd] = weight * share
            corners *= 2


@njit(error_model="numpy")
def locate(
    states: FloatArray,
    slots: IntArray,
    edges: FloatArray,
    axes: Axes,
    fuzzy: bool,
    index: CellArray,
    degree: FloatArray,
) -> int:
    """Fill rows of `index` and `degree`; return -1.

    If a state is not finite, its slot is returned; `OUTSIDE` if a slot is not a row of
    `states`. `axes` holds tuples, so that the number of axes is known when the kernel is
    compiled and the loops over them are unrolled.
    """
    ends, reals = scratch_for(len(axes[0]))
    for block in range((slots.size + BLOCK - 1) // BLOCK):
        bad = locate_block(
            states, slots, edges, axes, fuzzy, index, degree, block, ends, reals
        )
        if bad != -1:
            return bad
    return -1


@shared_among_threads
@njit(parallel=True, error_model="numpy")
def locate_in_parallel(
    states: FloatArray,
    slots: IntArray,
    edges: FloatArray,
    axes: Axes,
    fuzzy: bool,
    index: CellArray,
    degree: FloatArray,
) -> int:
    """Do what `locate` does, its blocks shared among threads."""
    # Threads are given plain tuples only, not tuples of tuples.
    first, count, cells, period, rate = axes
    n_blocks = (slots.size + BLOCK - 1) // BLOCK
    bad = np.empty(n_blocks, np.int64)
    for block in prange(n_blocks):
        own = first, count, cells, period, rate
        ends, reals = scratch_for(len(first))
        bad[block] = locate_block(
            states, slots, edges, own, fuzzy, index, degree, block, ends, reals
        )
    for slot in bad:
        if slot != -1:
            return int(slot)
    return -1


@njit
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
        A slot and a variable whose value is not whole or not in range, `OUTSIDE` if the
        slot is not a row of `states`, or (-1, -1).
    """
    for j in range(slots.size):
        slot = slots[j]
        if not 0 <= slot < states.shape[0]:
            return OUTSIDE, -1
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
