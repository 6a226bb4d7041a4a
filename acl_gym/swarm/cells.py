"""A grid of cells that finds the agents within a radius in linear time.

Agents are sorted by cells that are at least one radius wide, so that all within the
radius of an agent lie in its own cell or in one beside it. No axis has more cells than
about the root of the number of agents: agents that are far apart cost no memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

MOST_AXES = 3
"""Axes of a grid: with more, cells would be many and mostly empty."""

SLACK = 1.0 + 1e-9
"""Cells are wider than the radius by this factor, so that rounding moves nobody too far."""


class Cells(NamedTuple):
    """Agents sorted by cells, as `sort_into_cells` returns them.

    Axes that the positions lack are the first ones and have one cell.

    Attributes:
        shape: the number of cells along each axis, `(3,)`.
        first: where the agents of each cell begin, and where the last end,
            `(n_cells + 1,)`. Cells along the last axis lie side by side.
        agent: the numbers of the agents, sorted by cells, then by number, `(n,)`.
        cell: the cell of each of these, `(n,)`.
        place: where each of these is, `(3, n)`.
        width: of the cells along each axis, `(3,)`; infinity where there is one cell.
    """

    shape: IntArray
    first: IntArray
    agent: IntArray
    cell: IntArray
    place: FloatArray
    width: FloatArray


@njit
def sort_into_cells(
    positions: FloatArray, radius: float
) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray, FloatArray]:
    """Sort agents by cells: the fields of `Cells`.

    Args:
        positions: `(n, dim)` with dim 1 to 3, finite.
        radius: the least width of a cell, > 0.
    """
    n, dim = positions.shape
    absent = MOST_AXES - dim
    shape = np.ones(MOST_AXES, np.int64)
    low, scale = np.zeros(MOST_AXES), np.zeros(MOST_AXES)
    width = np.full(MOST_AXES, np.inf)
    most = max(1.0, np.floor((2.0 * n) ** (1.0 / dim)))
    for k in range(dim):
        least = largest = positions[0, k]
        for i in range(1, n):
            least = min(least, positions[i, k])
            largest = max(largest, positions[i, k])
        extent = largest - least
        count = min(most, np.floor(extent / (radius * SLACK)))
        # Where agents are too close to each other to be told apart, `count / extent` is
        # infinite: one cell holds them.
        if count >= 1.0 and extent < np.inf and count / extent < np.inf:
            axis = absent + k
            shape[axis] = int(count)
            low[axis], scale[axis] = least, count / extent
            if count > 1.0:
                width[axis] = extent / count

    cell_of = np.empty(n, np.int64)
    first = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    for i in range(n):
        cell = 0
        for k in range(dim):
            axis = absent + k
            index = int((positions[i, k] - low[axis]) * scale[axis])
            cell = cell * shape[axis] + max(0, min(index, shape[axis] - 1))
        cell_of[i] = cell
        first[cell + 1] += 1
    for cell in range(1, first.size):
        first[cell] += first[cell - 1]

    following = first[:-1].copy()
    agent, cell_sorted = np.empty(n, np.int64), np.empty(n, np.int64)
    place = np.zeros((MOST_AXES, n))
    for i in range(n):
        cell = cell_of[i]
        at = following[cell]
        following[cell] += 1
        agent[at], cell_sorted[at] = i, cell
        for k in range(dim):
            place[absent + k, at] = positions[i, k]
    return shape, first, agent, cell_sorted, place, width


@njit(error_model="numpy")
def squared_reach(radius: float) -> float:
    """The limit of squared distances, by which agents are within a radius or not.

    All kernels compare with it. A squared distance is less than it exactly where its
    square root is less than the radius. The square of the radius would not do, because it
    is rounded, and 0 for a radius of 1e-200.

    Args:
        radius: >= 0 or infinite.

    Returns:
        The least float whose square root is not less than the radius.
    """
    least = radius * radius
    while least > 0.0 and np.sqrt(np.nextafter(least, 0.0)) >= radius:
        least = np.nextafter(least, 0.0)
    while np.sqrt(least) < radius:
        least = np.nextafter(least, np.inf)
    return float(least)


@njit
def squared_reaches(radii: FloatArray) -> FloatArray:
    """`squared_reach` of each radius, `(n,)`; of equal ones in a row computed once."""
    reaches = np.empty_like(radii)
    for i in range(radii.size):
        if i > 0 and radii[i] == radii[i - 1]:
            reaches[i] = reaches[i - 1]
        else:
            reaches[i] = squared_reach(radii[i])
    return reaches


@njit(inline="always")
def beside(index: int, count: int) -> tuple[int, int]:
    """The first cell beside one along an axis, and the one after the last."""
    return max(index - 1, 0), min(index + 2, count)
