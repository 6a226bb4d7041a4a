"""The kernel that looks at the neighbours of every agent."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.swarm.cells import MOST_AXES, squared_reach
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

_ROW, _COLUMN = MOST_AXES - 2, MOST_AXES - 1
"""The axes of a plane in a grid of cells."""


@njit
def look_around(
    cells: tuple[Any, ...],
    sensing_radius: float,
    collision_distance: float,
    heard: IntArray,
    towards: FloatArray,
    collisions: IntArray,
    nearest: FloatArray,
) -> None:
    """Find the neighbours of agents in a plane, ring after ring of cells around each.

    Args:
        cells: the fields of `Cells`.
        sensing_radius: agents hear the others that are closer; infinity lets `heard` and
            `towards` as they are, because they follow without a look at each pair.
        collision_distance: agents that are closer than this collide.
        heard: `(n,)`, receives how many others each one hears.
        towards: `(n, 2)`, receives the sum of their positions relative to it.
        collisions: `(n,)`, receives how many others it collides with.
        nearest: `(n, 2 k)`, receives the positions of the k nearest that it hears,
            relative to it and the nearest one first, and 0 where it hears fewer.
    """
    shape, first, agent, cell, place, width = cells
    n, count = agent.size, nearest.shape[1] // 2
    rows, columns = shape[_ROW], shape[_COLUMN]
    narrowest = min(width[_ROW], width[_COLUMN])
    limited = sensing_radius < np.inf
    reach, contact = squared_reach(sensing_radius), squared_reach(collision_distance)
    x, y = place[_ROW], place[_COLUMN]
    squares, who = np.empty(count + 1), np.empty(count + 1, np.int64)
    for at in range(n):
        here, there = x[at], y[at]
        row, column = divmod(cell[at], columns)
        n_heard = n_hit = found = ring = 0
        east = north = 0.0
        beyond = np.inf if count > 0 else 0.0  # nobody as far away is among the nearest
        while True:
            for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                # Whole rows at the ends of the ring, else one cell on either side.
                whole = abs(r - row) == ring
                for side in range(1 if whole else 2):
                    west = column - ring if side == 0 else column + ring
                    west, past = max(west, 0), (column + ring if whole else west) + 1
                    past = min(past, columns)
                    if west >= past:
                        continue
                    line = r * columns
                    for j in range(first[line + west], first[line + past]):
                        # Without a branch but for the few that come nearer than those
                        # that are kept: half of all would be predicted wrongly.
                        dx, dy = x[np.uint64(j)] - here, y[np.uint64(j)] - there
                        square = dx * dx + dy * dy
                        other = j != at
                        n_hit += other & (square < contact)
                        near = other & (square < reach)
                        if limited:
                            n_heard += near
                            east += dx if near else 0.0
                            north += dy if near else 0.0
                        if near & (square < beyond):
                            found = keep_nearest(found, square, j, squares, who)
                            if found == count:
                                beyond = squares[count - 1]
            # All within this distance have been seen; one cell may be infinitely wide.
            seen = ring * narrowest if ring > 0 else 0.0
            needed = collision_distance
            if limited:
                needed = max(needed, sensing_radius)
            elif count > 0:
                farthest = np.sqrt(squares[count - 1]) if found == count else np.inf
                needed = max(needed, farthest)
            if seen >= needed or ring >= max(rows, columns):
                break
            ring += 1
        i = agent[at]
        collisions[i] = n_hit
        if limited:
            heard[i], towards[i, 0], towards[i, 1] = n_heard, east, north
        write_nearest(nearest[i], found, who, x, y, here, there)


@njit(inline="always")
def keep_nearest(
    found: int, square: float, j: int, squares: FloatArray, who: IntArray
) -> int:
    """Put an agent among the nearest ones found so far, the nearest one first.

    Args:
        found: how many there are.
        square: the square of its distance, less than that of the last one of a full list.
        j: its number.
        squares: of the nearest ones, `(count + 1,)`; the place after the last is for the
            one that drops out.
        who: their numbers, likewise.

    Returns:
        How many there are now, at most count.
    """
    count = squares.size - 1
    k = min(found, count)
    while k > 0 and square < squares[k - 1]:
        squares[k], who[k] = squares[k - 1], who[k - 1]
        k -= 1
    squares[k], who[k] = square, j
    return min(found + 1, count)


@njit(inline="always")
def write_nearest(
    row: FloatArray,
    found: int,
    who: IntArray,
    x: FloatArray,
    y: FloatArray,
    here: float,
    there: float,
) -> None:
    """Write the positions of the nearest agents relative to one at (here, there).

    Args:
        row: receives them, `(2 count,)`, and 0 where fewer were found.
        found: how many were.
        who: their numbers.
        x: first coordinates of all agents.
        y: second coordinates.
        here: first coordinate of the agent.
        there: second coordinate.
    """
    for k in range(row.size // 2):
        row[2 * k] = x[who[k]] - here if k < found else 0.0
        row[2 * k + 1] = y[who[k]] - there if k < found else 0.0
