"""The mask of slots that a partial reset of a vector environment starts."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded

from acl_gym.utils.typing import BoolArray


def checked_reset_mask(mask: Any, num_envs: int, *, begun: bool) -> BoolArray | None:
    """Return the mask of a partial reset, None for a full one.

    Raises:
        TypeError: it is not a bool array.
        ValueError: it has the wrong shape or nothing is True.
        ResetNeeded: there was no full reset yet.
    """
    if mask is None:
        return None
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        actual = mask.dtype if isinstance(mask, np.ndarray) else type(mask)
        raise TypeError(
            f"options['reset_mask'] must be a NumPy array of bool, got {actual}."
        )
    if mask.shape != (num_envs,) or not mask.any():
        raise ValueError(
            f"options['reset_mask'] must have shape ({num_envs},) and at least one "
            f"True, got shape {mask.shape} with {int(mask.sum())} True."
        )
    if not begun:
        raise ResetNeeded(
            "the first reset must start all slots; leave 'reset_mask' out."
        )
    return mask
