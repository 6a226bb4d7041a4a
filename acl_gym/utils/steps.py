"""Values that hold until the next one, as those of a policy between two evaluations."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.utils.typing import FloatArray


def hold_last_value(x: Any, values: Any, points: Any) -> FloatArray:
    """The values at some points; before the first place, the first value.

    Args:
        x: where each value begins, increasing, `(n,)`.
        values: `(n,)`.
        points: `(m,)`.

    Returns:
        `(m,)`.
    """
    place = np.searchsorted(np.asarray(x), np.asarray(points), side="right") - 1
    return np.asarray(np.asarray(values)[np.maximum(place, 0)])
