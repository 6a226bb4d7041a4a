"""Points of a state space: random ones without the goal, and evenly spread ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acl_gym.utils.typing import BoolArray, FloatArray

MOST_IN_VAIN = 10_000
"""How many states in a row may lie inside a region. Where 1% of all lie outside, as many
do in one of 10^43 cases."""


def sample_outside(
    draw: Callable[[int], FloatArray],
    inside: Callable[[FloatArray], BoolArray],
    count: int,
) -> FloatArray:
    """Draw states, each one again until it lies outside a region.

    Args:
        draw: returns m random states, `(state_size, m)`, for a given m.
        inside: whether each of `(state_size, m)` states lies in the region, `(m,)`.
        count: how many states, >= 0.

    Returns:
        Array of shape `(state_size, count)`.

    Raises:
        ValueError: `MOST_IN_VAIN` states that were drawn one after the other all lie
            inside the region.
    """
    states = draw(count)
    left, in_vain = count, 0
    while (again := np.flatnonzero(inside(states))).size:
        # One slot that found a state outside shows that there are some.
        in_vain = in_vain + left if again.size == left else 0
        if in_vain >= MOST_IN_VAIN:
            raise ValueError(
                "the goal must leave 1% or more of the initial states outside it, got "
                f"{in_vain:,} states drawn one after the other that all lie in it; "
                "narrow the goal, or give other initial states."
            )
        left = again.size
        states[:, again] = draw(left)
    return states


def halton_points(count: int) -> FloatArray:
    """The points 1 to `count` of Halton's sequence in four dimensions, `(count, 4)`.

    Coordinate j of point i consists of the digits of i in the j-th prime base, in
    reverse order after the radix point. They fill [0, 1)^4 evenly, without randomness.
    SciPy has the sequence too, but its import takes longer than all of this package.
    """
    points = np.zeros((count, 4))
    for column, base in enumerate((2, 3, 5, 7)):
        rest, share = np.arange(1, count + 1), 1.0
        while rest.any():
            share /= base
            points[:, column] += share * (rest % base)
            rest = rest // base
    return points
