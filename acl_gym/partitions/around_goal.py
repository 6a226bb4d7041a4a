"""Cells that become smaller towards a goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.partitions.grid import Fuzzy
from acl_gym.utils.typing import FloatArray

CELLS = {3: 9, 4: 5, 5: 5, 6: 5}
"""Number of variables -> centres of each. With one or two variables an evenly spaced grid
can grow until its cells are as small as the goal."""


def partition_around_goal(
    low: ArrayLike, high: ArrayLike, goal_low: ArrayLike, goal_high: ArrayLike
) -> Fuzzy | None:
    """Build a fuzzy partition that is dense at the goal, if an even one is too coarse.

    With evenly spaced centres that are further from each other than the goal is wide, a
    colony cannot tell states in the goal from those beside it: it learns to arrive, and
    as its levels settle, to hover where every step costs little. Here each variable has
    centres at the middle and at the ends of the goal, and others whose distances from
    the middle grow by equal factors up to the bounds.

    Args:
        low: lower ends of the variables, `(n_variables,)`, none of which is circular.
        high: upper ends.
        goal_low: lower ends of the goal.
        goal_high: upper ends.

    Returns:
        The partition; None where there are less than three variables or more than six,
        where the goal has no finite ends within the bounds, or where even cells would be
        as small as the goal.
    """
    ends = [np.asarray(each, np.float64) for each in (low, high, goal_low, goal_high)]
    count = CELLS.get(ends[0].size)
    low, high, goal_low, goal_high = ends
    if count is None or not all(np.isfinite(each).all() for each in ends):
        return None
    inside = (low < goal_low) & (goal_low < goal_high) & (goal_high < high)
    spacing = (high - low) / (count - 1)
    if not inside.all() or (goal_high - goal_low >= spacing).all():
        return None
    return Fuzzy(
        [
            _centres(*bounds, count)
            for bounds in zip(low, high, goal_low, goal_high, strict=True)
        ]
    )


def _centres(
    low: float, high: float, goal_low: float, goal_high: float, count: int
) -> FloatArray:
    """Centres of one variable, `(count,)`, whose number is odd."""
    each_side = (count - 1) // 2
    middle = 0.5 * (goal_low + goal_high)
    half = goal_high - middle
    below = middle - np.geomspace(half, middle - low, each_side)[::-1]
    above = middle + np.geomspace(half, high - middle, each_side)
    # The ends to the bit, whatever a power of a factor has rounded.
    below[0], above[-1] = low, high
    return np.concatenate([below, [middle], above])
