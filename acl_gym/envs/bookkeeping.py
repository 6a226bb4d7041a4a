"""Small parts of `control_env`: checks of what callers pass, and two kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numba import njit
from numpy.typing import ArrayLike

from acl_gym.envs.system import BoolArray, ControlSystem, FloatArray, IntArray


def checked_options(
    options: dict[str, Any] | None, allowed: tuple[str, ...]
) -> dict[str, Any]:
    """Refuse reset options that would otherwise be ignored in silence."""
    unknown = sorted(set(options or ()) - set(allowed), key=str)
    if unknown:
        raise ValueError(
            f"reset options must be among {list(allowed)}, got {unknown}; "
            "check the spelling."
        )
    return dict(options or {})


@njit(cache=True)
def gather_slots(
    slots: IntArray,
    states: FloatArray,
    actions: IntArray,
    part: FloatArray,
    part_actions: IntArray,
) -> None:
    """Copy the columns of `slots` side by side."""
    for j in range(slots.size):
        part_actions[j] = actions[slots[j]]
        for row in range(states.shape[0]):
            part[row, j] = states[row, slots[j]]


@njit(cache=True)
def put_slots_back(
    slots: IntArray,
    part: FloatArray,
    part_rewards: FloatArray,
    part_reached: BoolArray,
    limit: int,
    states: FloatArray,
    steps: IntArray,
    rewards: FloatArray,
    terminated: BoolArray,
    truncated: BoolArray,
) -> None:
    """Undo `gather_slots` after a step, and count it; `limit` 0 means none."""
    for j in range(slots.size):
        slot = slots[j]
        for row in range(states.shape[0]):
            states[row, slot] = part[row, j]
        steps[slot] += 1
        rewards[slot] = part_rewards[j]
        terminated[slot] = part_reached[j]
        truncated[slot] = limit > 0 and steps[slot] >= limit


def draw_uniforms(
    system: ControlSystem, rng: np.random.Generator, count: int
) -> FloatArray | None:
    """The random numbers of one step of `count` slots, None if the system has none."""
    if system.draws_per_step == 0:
        return None
    return rng.random((system.draws_per_step, count))


def checked_actions(actions: ArrayLike, count: int, n_actions: int) -> IntArray:
    """Return actions as a new int64 array `(count,)` within 0..n_actions - 1."""
    array = np.asarray(actions)
    if array.dtype.kind not in "iu":
        raise TypeError(
            f"actions must be integers, got dtype {array.dtype}; "
            "cast with .astype(np.int64)."
        )
    if array.shape != (count,):
        raise ValueError(
            f"actions must have shape ({count},), one a slot, got {array.shape}."
        )
    checked = array.astype(np.int64)
    # As unsigned numbers, negative actions are huge: one pass checks both ends.
    if checked.view(np.uint64).max() >= n_actions:
        slot = int(checked.view(np.uint64).argmax())
        raise ValueError(
            f"actions must lie in 0..{n_actions - 1}, got {checked[slot]} "
            f"in slot {slot}."
        )
    return checked


def checked_autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """Return the mode of that name."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        choices = ", ".join(repr(choice.value) for choice in AutoresetMode)
        raise ValueError(
            f"autoreset_mode must be one of {choices}, got {mode!r}."
        ) from None


def checked_render_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    """Return `mode` if it is None or among the modes of `metadata`."""
    if mode is not None and mode not in metadata["render_modes"]:
        raise ValueError(
            f"render_mode must be None or one of {metadata['render_modes']}, "
            f"got {mode!r}."
        )
    return mode
