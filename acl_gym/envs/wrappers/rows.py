"""Observations of all slots, in which each slot has a row.

They are an array `(num_envs, ...)`; of a Dict or Tuple space a dict or tuple of such
arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array

from acl_gym.utils import validation

_INT = np.dtype(np.int64)


def empty_rows(space: spaces.Space[Any], n_slots: int) -> Any:
    """Rows of zeros for the observations of `n_slots` slots.

    Raises:
        ValueError: observations of `space` are not numbers, such as those of Text.
    """
    if not _is_numeric(space):
        raise ValueError(
            "observations must be numbers: of a Box, Discrete, MultiDiscrete or "
            "MultiBinary space, or a Dict or Tuple of such, got "
            f"{validation.shown(space)}; wrap each single environment in "
            "gymnasium.wrappers.TransformObservation."
        )
    return create_empty_array(space, n=n_slots, fn=np.zeros)


def _is_numeric(space: spaces.Space[Any]) -> bool:
    if isinstance(space, spaces.Dict):
        return all(_is_numeric(part) for part in space.spaces.values())
    if isinstance(space, spaces.Tuple):
        return all(_is_numeric(part) for part in space.spaces)
    return space.shape is not None and space.dtype is not None


def set_row(rows: Any, slot: int, observation: Any) -> None:
    """Write the observation of one slot.

    Args:
        rows: of all slots.
        slot: which row.
        observation: as a single environment returns it.

    Raises:
        ValueError: it has another shape or kind than its space.
    """
    if type(rows) is np.ndarray:
        if type(observation) is int and rows.dtype is _INT and rows.ndim == 1:
            rows[slot] = observation  # without the checks, which cost more
            return
        array = validation.as_array(observation)
        if (
            array is None
            or array.shape != rows.shape[1:]
            or not np.can_cast(array.dtype, rows.dtype, "same_kind")
        ):
            expected = f"shape {rows.shape[1:]} and type {rows.dtype}"
            raise _not_of_its_space(slot, expected, observation)
        rows[slot] = array
    elif isinstance(rows, dict):
        if not isinstance(observation, Mapping) or set(observation) != set(rows):
            expected = f"the keys {validation.shown(list(rows))}"
            raise _not_of_its_space(slot, expected, observation)
        for key, part in rows.items():
            set_row(part, slot, observation[key])
    else:
        if not isinstance(observation, tuple) or len(observation) != len(rows):
            raise _not_of_its_space(slot, f"{len(rows)} parts", observation)
        for part, own in zip(rows, observation, strict=True):
            set_row(part, slot, own)


def row_of(rows: Any, slot: int) -> Any:
    """The observation of one slot, copied."""
    if isinstance(rows, dict):
        return {key: row_of(part, slot) for key, part in rows.items()}
    if isinstance(rows, tuple):
        return tuple(row_of(part, slot) for part in rows)
    return rows[slot].copy()


def copied(rows: Any) -> Any:
    """The same observations in arrays of their own."""
    if isinstance(rows, dict):
        return {key: copied(part) for key, part in rows.items()}
    if isinstance(rows, tuple):
        return tuple(copied(part) for part in rows)
    return rows.copy()


def same_row(row: Any, observation: Any) -> bool:
    """Whether an observation is that of a row, to the bit."""
    if isinstance(row, dict):
        return all(same_row(part, observation[key]) for key, part in row.items())
    if isinstance(row, tuple):
        return all(map(same_row, row, observation))
    given = np.asarray(observation).astype(row.dtype)
    return bool(given.shape == row.shape and given.tobytes() == row.tobytes())


def _not_of_its_space(slot: int, expected: str, observation: Any) -> ValueError:
    return ValueError(
        f"the observation of slot {slot} must have {expected}, as its space says, got "
        f"{validation.shown(observation)}; check the environment's reset and step."
    )
