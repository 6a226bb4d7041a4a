"""The bounds that a Box declares, which may be none, and real inputs within bounds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

INFINITE = 1e30
"""A larger bound counts as none: some spaces use the largest float for infinity."""

MOST_ACTIONS = 10_000
"""How many numbered actions may be made of real inputs: no table is good for more."""

_WIDE = 4
"""Integers of as many bytes or more: their extremes stand for infinity. Those of smaller
ones do not, because they are ordinary values, such as 0 and 255 of an image."""


def declared_bounds(space: spaces.Box) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of a Box, infinite where it has none.

    Gymnasium writes the largest integers of the type for infinity.

    Args:
        space: of any shape.

    Returns:
        `(low, high)`, float64 arrays of that shape.
    """
    low, high = space.low.astype(np.float64), space.high.astype(np.float64)
    no_low, no_high = ~space.bounded_below, ~space.bounded_above
    kind: Any = space.dtype
    if kind.kind in "iu" and kind.itemsize >= _WIDE:
        extremes = np.iinfo(kind)
        # The smallest unsigned integer, 0, is a bound like any other.
        no_low |= (space.low == extremes.min) & (kind.kind == "i")
        no_high |= space.high == extremes.max
    low[no_low | (low < -INFINITE)] = -np.inf
    high[no_high | (high > INFINITE)] = np.inf
    return low, high


def finite_bounds(
    space: spaces.Box, variables: Iterable[int] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of observations that must be bounded.

    Args:
        space: of one axis.
        variables: those that must have bounds; None: all.

    Returns:
        `(low, high)`, float64 arrays `(n_variables,)`, infinite where others have none.

    Raises:
        ValueError: a variable has no finite bounds, low < high.
    """
    low, high = declared_bounds(space)
    for axis in range(low.size) if variables is None else variables:
        if not (np.isfinite([low[axis], high[axis]]).all() and low[axis] < high[axis]):
            raise ValueError(
                "every variable must have finite bounds, low < high, got "
                f"[{low[axis]:g}, {high[axis]:g}] of variable {axis}; give the environment "
                "a bounded space with gymnasium's TransformObservation."
            )
    return low, high


def input_bounds(name: str, space: Any) -> tuple[FloatArray, FloatArray]:
    """The bounds of real inputs: of a bounded Box of one axis.

    Args:
        name: what the space is called in messages, such as "env's actions".
        space: the candidate.

    Returns:
        `(low, high)`, float64 arrays `(n_inputs,)`.

    Raises:
        ValueError: it is no such box, or the ends of an input are not low < high.
    """
    kind = getattr(space, "dtype", None)
    fits = isinstance(space, spaces.Box) and len(space.shape) == 1 and space.shape[0]
    if not fits or kind is None or kind.kind != "f":
        raise ValueError(
            f"{name} must be a Box of floats with one axis, got "
            f"{validation.shown(space)}; reshape them with "
            "gymnasium.wrappers.TransformAction."
        )
    low, high = declared_bounds(space)
    if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
        raise ValueError(
            f"{name} must have finite bounds, low < high, for each input, got low = "
            f"{low.tolist()} and high = {high.tolist()}; bound them with "
            "gymnasium.wrappers.RescaleAction or ClipAction, or with another Box."
        )
    return low, high
