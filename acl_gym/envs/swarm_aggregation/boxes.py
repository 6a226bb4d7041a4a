"""A tree of boxes that finds the nearest agents wherever these are.

A grid of equal cells is faster where agents are spread evenly. On a line, or in a few
dense groups that are far apart, most cells are empty and the others hold too many agents.
The boxes of the tree hold equal numbers of agents instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from acl_gym.envs.swarm_aggregation.kernels import keep_nearest, write_nearest
from acl_gym.swarm.cells import squared_reach
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

_IN_A_LEAF = 8
"""The most agents in a box that is not divided further."""

_DEEPEST = 64
"""More levels than a tree of any number of agents has."""


def tree_of_boxes(positions: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Sort agents so that those who are close to each other are in the same box.

    Args:
        positions: `(n, 2)`, finite.

    Returns:
        The numbers of the agents in the order of the boxes, `(n,)`; their places in this
        order, `(2, n)`; and the least and the largest coordinates in each box, x before
        y, `(n_boxes, 4)`. Box 0 holds all agents, and boxes 2 i + 1 and 2 i + 2 the two
        halves of box i. Box p of level l, counted from 0, begins at agent p n // 2^l.
    """
    order = cKDTree(positions, _IN_A_LEAF).indices
    order = np.asarray(order, np.int64)
    place = np.ascontiguousarray(positions[order].T)
    return order, place, _boxes_of(place)


@njit
def _boxes_of(place: FloatArray) -> FloatArray:
    n = place.shape[1]
    leaves = 1
    while leaves * _IN_A_LEAF < n:
        leaves *= 2
    boxes = np.empty((2 * leaves - 1, 4))
    for leaf in range(leaves):
        box = boxes[leaves - 1 + leaf]
        first, last = leaf * n // leaves, (leaf + 1) * n // leaves
        for axis in range(2):
            box[2 * axis] = place[axis, first:last].min()
            box[2 * axis + 1] = place[axis, first:last].max()
    for i in range(leaves - 2, -1, -1):
        one, other = boxes[2 * i + 1], boxes[2 * i + 2]
        for axis in range(2):
            low, high = 2 * axis, 2 * axis + 1
            boxes[i, low] = min(one[low], other[low])
            boxes[i, high] = max(one[high], other[high])
    return boxes


@njit
def look_in_boxes(
    tree: tuple[Any, ...],
    collision_distance: float,
    collisions: IntArray,
    nearest: FloatArray,
) -> int:
    """Count collisions and find the nearest agents, as `look_around` does.

    Squares of distances are computed in the same way for agents and for the corners of
    boxes. Rounding is monotonic, so that no agent of a box is closer than the nearest
    point of the box nor farther than its farthest corner, to the last bit.

    Args:
        tree: what `tree_of_boxes` returns.
        collision_distance: agents that are closer than this collide.
        collisions: see `look_around`.
        nearest: see `look_around`; nobody is too far to be heard.

    Returns:
        How many boxes and agents were looked at.
    """
    order, place, boxes = tree
    n, count = order.size, nearest.shape[1] // 2
    n_boxes = len(boxes)
    x, y = place[0], place[1]
    contact = squared_reach(collision_distance)
    squares, who = np.empty(count + 1), np.empty(count + 1, np.int64)
    stack = np.empty(_DEEPEST, np.int64)
    looks = 0
    for at in range(n):
        here, there = x[at], y[at]
        n_hit = found = 0
        beyond = np.inf if count > 0 else 0.0  # nobody as far away is among the nearest
        stack[0], height = 0, 1
        while height > 0:
            height -= 1
            i = stack[height]
            looks += 1
            least = _least_square(here, there, boxes[i])
            if least >= beyond:
                if least >= contact:
                    continue
                if _largest_square(here, there, boxes[i]) < contact:
                    first, last = _agents_in(i, n)
                    n_hit += last - first - (first <= at < last)
                    continue
            if 2 * i + 1 < n_boxes:
                one, other = 2 * i + 1, 2 * i + 2
                nearer = _least_square(here, there, boxes[one])
                if _least_square(here, there, boxes[other]) < nearer:
                    one, other = other, one
                stack[height], stack[height + 1] = other, one
                height += 2
                continue
            first, last = _agents_in(i, n)
            looks += last - first
            for j in range(first, last):
                dx, dy = x[j] - here, y[j] - there
                square = dx * dx + dy * dy
                if j == at:
                    continue
                n_hit += square < contact
                if square < beyond:
                    found = keep_nearest(found, square, j, squares, who)
                    if found == count:
                        beyond = squares[count - 1]
        agent = order[at]
        collisions[agent] = n_hit
        write_nearest(nearest[agent], found, who, x, y, here, there)
    return looks


@njit(inline="always")
def _agents_in(i: int, n: int) -> tuple[int, int]:
    """Where the agents of box i begin, and where they end."""
    boxes = 1
    while 2 * boxes <= i + 1:
        boxes *= 2
    p = i + 1 - boxes
    return p * n // boxes, (p + 1) * n // boxes


@njit(inline="always")
def _least_square(x: float, y: float, box: FloatArray) -> float:
    """The square of the distance from a box; 0 inside."""
    dx = max(box[0] - x, x - box[1], 0.0)
    dy = max(box[2] - y, y - box[3], 0.0)
    return float(dx * dx + dy * dy)


@njit(inline="always")
def _largest_square(x: float, y: float, box: FloatArray) -> float:
    """The square of the distance from the farthest corner of a box."""
    dx = max(x - box[0], box[1] - x)
    dy = max(y - box[2], box[3] - y)
    return float(dx * dx + dy * dy)
