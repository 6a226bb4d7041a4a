"""Rows of what environments return, one a slot: taken, replaced, kept."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, IntArray


def rows_of(observation: Any, slots: IntArray) -> Any:
    """The observations of some slots, copied; of dicts and tuples part by part."""
    if isinstance(observation, dict):
        return {key: rows_of(part, slots) for key, part in observation.items()}
    if isinstance(observation, tuple):
        return tuple(rows_of(part, slots) for part in observation)
    return observation[slots]


def set_row(observation: Any, slot: int, row: Any) -> None:
    """Replace the observation of one slot.

    Raises:
        ValueError: `row` is not an observation of the same shape and kind.
    """
    if isinstance(observation, dict):
        if not isinstance(row, dict) or set(row) != set(observation):
            raise _not_final(slot, f"the keys {sorted(observation)}", row)
        for key, part in observation.items():
            set_row(part, slot, row[key])
        return
    if isinstance(observation, tuple):
        if not isinstance(row, tuple) or len(row) != len(observation):
            raise _not_final(slot, f"a tuple of {len(observation)} parts", row)
        for part, one in zip(observation, row, strict=True):
            set_row(part, slot, one)
        return
    array = validation.as_array(row)
    shape = observation.shape[1:]
    if (
        array is None
        or array.shape != shape
        or not np.can_cast(array.dtype, observation.dtype, "same_kind")
    ):
        raise _not_final(slot, f"shape {shape} and type {observation.dtype}", row)
    observation[slot] = array


def with_final_rows(
    observation: Any, infos: Any, stopped: IntArray, n_slots: int
) -> Any:
    """Observations; where an episode has just ended, its final observation.

    Args:
        observation: of all slots, `(n_slots, ...)`, from an environment that resets
            slots in the step in which they finish.
        infos: of that step.
        stopped: the slots that have finished, `(m,)`.
        n_slots: how many slots there are.

    Returns:
        A copy.

    Raises:
        ValueError: `infos["final_obs"]` does not hold them.
    """
    final = infos.get("final_obs")
    if final is None or len(final) != n_slots:
        raise ValueError(
            "infos['final_obs'] must hold the last observation of each slot that has "
            f"finished, as autoreset in the same step asks for, got {list(infos)}; "
            'check the environment, or make it with autoreset_mode="NextStep".'
        )
    shown = _copied(observation)
    for slot in stopped:
        set_row(shown, int(slot), final[slot])
    return shown


def _copied(observation: Any) -> Any:
    """A copy, part by part."""
    if isinstance(observation, dict):
        return {key: _copied(part) for key, part in observation.items()}
    if isinstance(observation, tuple):
        return tuple(map(_copied, observation))
    return observation.copy()


def _not_final(slot: int, expected: str, row: Any) -> ValueError:
    return ValueError(
        f"infos['final_obs'] must have {expected} in slot {slot}, got "
        f"{validation.shown(row)}; check the environment's step."
    )


def with_rows(observation: NDArray[Any], rows: NDArray[Any], mask: BoolArray) -> Any:
    """Observations in which some slots have those of `rows`.

    Raises:
        ValueError: they are of different shapes.
    """
    if rows.shape != observation.shape:
        raise ValueError(
            "observations must have the same shape in reset and step, got "
            f"{rows.shape[1:]} and {observation.shape[1:]}; check the environment."
        )
    merged = observation.astype(np.result_type(observation, rows))
    merged[mask] = rows[mask]
    return merged


def require_array(observation: Any) -> None:
    """Refuse observations of dicts and tuples.

    Raises:
        ValueError: it is no array.
    """
    if not isinstance(observation, np.ndarray):
        raise ValueError(
            "a cost of complete solutions needs observations that are arrays, got "
            f"{validation.shown(observation)}; leave the cost out, or flatten them with "
            "gymnasium.wrappers.vector.FlattenObservation."
        )


def fixed(array: NDArray[Any]) -> NDArray[Any]:
    """The same new array, which from now on cannot be written to."""
    array.setflags(write=False)
    return array
