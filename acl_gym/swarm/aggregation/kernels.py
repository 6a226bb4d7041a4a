"""The kernels that sum the interaction (6.5) over those that an agent hears.

There is one for each way to say who hears whom: everyone, links, and a radius. An agent
does not act on itself. What acts on one agent is added up in a fixed order, so that the
bits do not depend on how many threads share the agents.

Common arguments:
    own: where each agent is.
    heard: where the others say that they are; the same as `own` where messages arrive
        at once.
    law: kind, attraction, repulsion and rate of each agent, see `Coefficients`.
    force: `(n, dim)`, receives the sum for each agent.
    block: the kernel concerns the `BLOCK` agents from `block * BLOCK` on.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from acl_gym.swarm.cells import beside
from acl_gym.utils.compiling import njit
from acl_gym.utils.fast_math import exponential
from acl_gym.utils.threads import shared_among_threads
from acl_gym.utils.typing import FloatArray, IntArray

BOUNDED, UNBOUNDED = 0, 1
"""Kinds of repulsion: b exp(-r^2 / c), and b / r^2."""

BLOCK = 128
"""Agents that one thread takes at a time."""

BATCH = 256
"""Neighbours whose weights are computed side by side, so that LLVM vectorises them."""


@njit(error_model="numpy")
def weigh(
    values: FloatArray, count: int, kind: int, a: float, b: float, rate: float
) -> None:
    """Replace squared distances by g_a - g_r of (6.5), for one agent.

    Where b / r^2 repels, the weight is 0 at distance 0: there is no direction to part in.
    """
    if kind == BOUNDED:
        for i in range(count):
            values[i] = a - b * exponential(-values[i] * rate)
    else:
        for i in range(count):
            strength = a - b / values[i]
            values[i] = strength if values[i] > 0.0 else 0.0


@njit(error_model="numpy")
def of_everyone(
    own: FloatArray,
    heard: FloatArray,
    law: tuple[Any, ...],
    force: FloatArray,
    block: int,
) -> None:
    """What all others do; `own` and `heard` have the coordinates first, `(dim, n)`.

    The inner loops run over the agents of the block, for each of which the sum is in the
    order of the others' numbers.
    """
    kind, attraction, repulsion, rate = law
    dim, n = own.shape
    first = block * BLOCK
    size = min(first + BLOCK, n) - first
    part = slice(first, first + size)
    a, b, c, x = attraction[part], repulsion[part], rate[part], own[:, part]
    total, weight = np.zeros((dim, size)), np.empty(size)
    for j in range(n):
        weight[:] = 0.0
        for k in range(dim):
            row, place = x[k], heard[k, j]
            for i in range(size):
                y = row[i] - place
                weight[i] += y * y
        if kind == BOUNDED:
            for i in range(size):
                weight[i] = a[i] - b[i] * exponential(-weight[i] * c[i])
        else:
            for i in range(size):
                strength = a[i] - b[i] / weight[i]
                weight[i] = strength if weight[i] > 0.0 else 0.0
        if first <= j < first + size:
            weight[j - first] = 0.0
        for k in range(dim):
            row, place, sums = x[k], heard[k, j], total[k]
            for i in range(size):
                sums[i] -= weight[i] * (row[i] - place)
    for k in range(dim):
        for i in range(size):
            force[first + i, k] = total[k, i]


@njit(error_model="numpy")
def of_links(
    own: FloatArray,
    heard: FloatArray,
    sender: IntArray,
    offsets: IntArray,
    law: tuple[Any, ...],
    force: FloatArray,
    block: int,
) -> None:
    """What the senders of an agent's links do; `own` and `heard` are `(n, dim)`.

    `sender` and `offsets` are those of `Links`: the links of receiver i are
    `offsets[i]:offsets[i + 1]`.
    """
    kind, attraction, repulsion, rate = law
    n, dim = own.shape
    weight, by = np.empty(BATCH), np.empty(BATCH, np.int64)
    for i in range(block * BLOCK, min((block + 1) * BLOCK, n)):
        force[i] = 0.0
        link, last = offsets[i], offsets[i + 1]
        while link < last:
            count = 0
            while link < last and count < BATCH:
                j = sender[link]
                square = 0.0
                for k in range(dim):
                    y = own[i, k] - heard[j, k]
                    square += y * y
                weight[count], by[count] = square, j
                count += j != i
                link += 1
            weigh(weight, count, kind, attraction[i], repulsion[i], rate[i])
            for k in range(dim):
                total = force[i, k]
                for m in range(count):
                    total -= weight[m] * (own[i, k] - heard[by[m], k])
                force[i, k] = total


@njit(error_model="numpy")
def of_radius(
    cells: tuple[Any, ...],
    reaches: FloatArray,
    law: tuple[Any, ...],
    force: FloatArray,
    block: int,
) -> None:
    """What those do that are closer than an agent's radius, in the order of the cells.

    `cells` are the fields of `Cells`, and `reaches` is `squared_reach` of the radius sigma
    of each agent, `(n,)`, which is at most that of the cells.
    """
    kind, attraction, repulsion, rate = law
    shape, first, agent, cell, place, _ = cells
    n, dim = force.shape
    planes, rows, columns = shape
    y0, y1, y2 = np.empty(BATCH), np.empty(BATCH), np.empty(BATCH)
    weight = np.empty(BATCH)
    for at in range(block * BLOCK, min((block + 1) * BLOCK, n)):
        i = agent[at]
        a, b, c, reach = attraction[i], repulsion[i], rate[i], reaches[i]
        x0, x1, x2 = place[0, at], place[1, at], place[2, at]
        rest, column = divmod(cell[at], columns)
        plane, row = divmod(rest, rows)
        from_plane, to_plane = beside(plane, planes)
        from_row, to_row = beside(row, rows)
        from_column, to_column = beside(column, columns)
        f0 = f1 = f2 = 0.0
        count = 0
        for p in range(from_plane, to_plane):
            for q in range(from_row, to_row):
                line = (p * rows + q) * columns
                for j in range(first[line + from_column], first[line + to_column]):
                    m = np.uint64(count)  # unsigned: no check for indices from the end
                    d0, d1, d2 = x0 - place[0, j], x1 - place[1, j], x2 - place[2, j]
                    square = d0 * d0 + d1 * d1 + d2 * d2
                    y0[m], y1[m], y2[m], weight[m] = d0, d1, d2, square
                    # Overwritten by the next one if it is too far: no branch here.
                    count += (square < reach) & (j != at)
                    if count == BATCH:
                        weigh(weight, count, kind, a, b, c)
                        for one in range(count):
                            f0 -= weight[one] * y0[one]
                            f1 -= weight[one] * y1[one]
                            f2 -= weight[one] * y2[one]
                        count = 0
        weigh(weight, count, kind, a, b, c)
        for one in range(count):
            f0 -= weight[one] * y0[one]
            f1 -= weight[one] * y1[one]
            f2 -= weight[one] * y2[one]
        # The axes that are missing come first in the cells.
        force[i, dim - 1] = f2
        if dim > 1:
            force[i, dim - 2] = f1
        if dim > 2:
            force[i, dim - 3] = f0


@njit
def sum_everyone(
    own: FloatArray, heard: FloatArray, law: tuple[Any, ...], force: FloatArray
) -> None:
    """Do what `of_everyone` does for all blocks."""
    for block in range((len(force) + BLOCK - 1) // BLOCK):
        of_everyone(own, heard, law, force, block)


@shared_among_threads
@njit(parallel=True)
def sum_everyone_in_parallel(
    own: FloatArray, heard: FloatArray, law: tuple[Any, ...], force: FloatArray
) -> None:
    """Do what `sum_everyone` does, its blocks shared among threads."""
    kind, attraction, repulsion, rate = law
    for block in prange((len(force) + BLOCK - 1) // BLOCK):
        of_everyone(own, heard, (kind, attraction, repulsion, rate), force, block)


@njit
def sum_links(
    own: FloatArray,
    heard: FloatArray,
    sender: IntArray,
    offsets: IntArray,
    law: tuple[Any, ...],
    force: FloatArray,
) -> None:
    """Do what `of_links` does for all blocks."""
    for block in range((len(force) + BLOCK - 1) // BLOCK):
        of_links(own, heard, sender, offsets, law, force, block)


@shared_among_threads
@njit(parallel=True)
def sum_links_in_parallel(
    own: FloatArray,
    heard: FloatArray,
    sender: IntArray,
    offsets: IntArray,
    law: tuple[Any, ...],
    force: FloatArray,
) -> None:
    """Do what `sum_links` does, its blocks shared among threads."""
    kind, attraction, repulsion, rate = law
    for block in prange((len(force) + BLOCK - 1) // BLOCK):
        each = kind, attraction, repulsion, rate
        of_links(own, heard, sender, offsets, each, force, block)


@njit
def sum_radius(
    cells: tuple[Any, ...], reaches: FloatArray, law: tuple[Any, ...], force: FloatArray
) -> None:
    """Do what `of_radius` does for all blocks."""
    for block in range((len(force) + BLOCK - 1) // BLOCK):
        of_radius(cells, reaches, law, force, block)


@shared_among_threads
@njit(parallel=True)
def sum_radius_in_parallel(
    cells: tuple[Any, ...], reaches: FloatArray, law: tuple[Any, ...], force: FloatArray
) -> None:
    """Do what `sum_radius` does, its blocks shared among threads."""
    kind, attraction, repulsion, rate = law
    shape, first, agent, cell, place, width = cells
    for block in prange((len(force) + BLOCK - 1) // BLOCK):
        grid = shape, first, agent, cell, place, width
        of_radius(grid, reaches, (kind, attraction, repulsion, rate), force, block)
