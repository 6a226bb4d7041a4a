"""The bounds that a Box declares, which may be none."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.utils.typing import FloatArray

INFINITE = 1e30
"""A larger bound counts as none: some spaces use the largest float for infinity."""

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
