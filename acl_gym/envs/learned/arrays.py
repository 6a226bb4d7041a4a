"""Checks of the arrays of a recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

LARGEST = 1e100
"""The largest size of a recorded number. The squares of larger ones might overflow, and
regressions would then learn nothing from them without saying so."""

_LAST_RUN = 2**53
"""The largest number of a run, so that runs of several recordings can be counted on."""


def checked_table(
    name: str, values: Any, rows: int | None = None, columns: int | None = None
) -> FloatArray:
    """Return numbers up to `LARGEST` in size, with a row for each step, `(n, size)`.

    Raises:
        ValueError: they are no such numbers, or their shape is not `(rows, columns)`.
    """
    array = validation.real_array(name, values, finite=False)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or rows not in (None, len(array)):
        count = "n" if rows is None else str(rows)
        raise ValueError(
            f"{name} must have a row for each step, shape ({count}, size), got "
            f"{np.shape(values)}."
        )
    if columns not in (None, array.shape[1]):
        raise ValueError(
            f"{name} must have the {columns} variables of states, got {array.shape[1]}."
        )
    _check_size(name, array)
    return np.ascontiguousarray(array)


def checked_column(name: str, values: Any, count: int) -> FloatArray:
    """Return `count` numbers up to `LARGEST` in size.

    Raises:
        ValueError: their number is another, or one is not finite or too large.
    """
    array = validation.real_array(name, values, finite=False)
    if array.shape != (count,):
        raise ValueError(f"{name} must have shape ({count},), got {array.shape}.")
    _check_size(name, array[:, None])
    return array


def _check_size(name: str, array: FloatArray) -> None:
    finite = np.isfinite(array).all(axis=1)
    if not finite.all():
        row = int(np.argmin(finite))
        raise ValueError(
            f"{name} must be finite, got {array[row].tolist()} in row {row} "
            f"({np.count_nonzero(~finite)} rows of {len(array)} are not); leave such "
            "rows out or repair them."
        )
    large = (np.abs(array) > LARGEST).any(axis=1)
    if large.any():
        row = int(np.argmax(large))
        raise ValueError(
            f"{name} must be at most {LARGEST:g} in size, got {array[row].tolist()} in row "
            f"{row} ({np.count_nonzero(large)} rows of {len(array)} are larger); give them "
            "in a larger unit, or leave such rows out."
        )


def checked_flags(name: str, values: Any, count: int) -> BoolArray:
    """Return `count` booleans; 0 and 1 are taken as such.

    Raises:
        ValueError: their number is another, or they are no booleans.
    """
    array = validation.as_array(values)
    good = array is not None and array.shape == (count,) and array.dtype.kind in "biuf"
    if not good or not ((array == 0) | (array == 1)).all():  # type: ignore[union-attr]
        raise ValueError(
            f"{name} must be {count} booleans, got {validation.shown(values)}."
        )
    return np.asarray(array == 1)


def checked_runs(values: Any, count: int) -> IntArray:
    """Return the number of the run of each of `count` steps.

    Raises:
        ValueError: they are no integers, they fall, or one is beyond 2^53 in size.
    """
    array = validation.as_array(values)
    good = array is not None and array.shape == (count,) and array.dtype.kind in "iu"
    if array is None or not good or (array[1:] < array[:-1]).any():
        raise ValueError(
            f"episodes must be {count} integers that do not fall, got "
            f"{validation.shown(values)}."
        )
    if array[0] < -_LAST_RUN or array[-1] > _LAST_RUN:
        raise ValueError(
            f"episodes must be integers in [-2^53, 2^53], got {array[0]} to {array[-1]}; "
            "number the runs from 0."
        )
    return array.astype(np.int64)


def runs_of(states: FloatArray, next_states: FloatArray) -> IntArray:
    """The numbers of runs, a new one where a state does not follow the one before."""
    breaks = np.zeros(len(states), np.int64)
    breaks[1:] = (states[1:] != next_states[:-1]).any(axis=1)
    return np.cumsum(breaks)


def chosen_runs(episodes: IntArray, rows: IntArray) -> IntArray:
    """The numbers of the runs of some steps, which may have torn runs apart.

    Args:
        episodes: of all steps, `(n,)`, in order.
        rows: which were chosen, `(m,)`, without repetition.

    Returns:
        Those that they had, unless a run was torn apart or the order was changed: then
        all are numbered anew.
    """
    chosen = episodes[rows]
    begins = (np.diff(chosen) != 0) | (np.diff(rows) != 1)
    if not (begins & (np.diff(chosen) <= 0)).any():
        return chosen
    numbers: IntArray = np.concatenate([[0], np.cumsum(begins)]).astype(np.int64)
    return numbers
