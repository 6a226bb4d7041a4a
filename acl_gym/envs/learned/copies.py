"""Rows of a recording that are there more than once."""

from __future__ import annotations

import numpy as np

from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

COARSE = 100
"""States that the levels of the sensors can tell apart, for each step, up to which steps
may well be equal by chance."""

CLEAR = 4.0
"""Levels that a variable must pass in a step so that it surely moves."""


def copied_steps(
    states: FloatArray, inputs: FloatArray, next_states: FloatArray, episodes: IntArray
) -> int:
    """How many steps, of those that move, are exactly like an earlier one.

    What a plant repeats on its own is not counted: steps at rest; the first steps of
    runs that begin in the same state with the same inputs, and whole runs if all begin
    in one state; and any step where the sensors have so few levels that steps are equal
    by chance.

    Args:
        states: `(n, d)`.
        inputs: `(n, m)`.
        next_states: `(n, d)`.
        episodes: the number of the run of each step, `(n,)`.
    """
    distances, spans = levels(states), np.ptp(states, axis=0)
    if (distances > 0.0)[spans > 0.0].all():
        some = spans > 0.0
        cells = np.prod(spans[some] / distances[some] + 1.0)
        if cells <= COARSE * len(states):
            return 0
    rows = np.concatenate([states, inputs, next_states], axis=1)
    _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    copied = first[number] < np.arange(len(rows))
    copied &= (next_states != states).any(axis=1)
    if copied.any():
        starts = np.flatnonzero(np.diff(episodes, prepend=episodes[0] - 1))
        one_start = len(np.unique(states[starts], axis=0)) == 1 < len(starts)
        half = len(number) // 2
        read_twice = np.array_equal(number[:half], number[half:])
        copied &= ~_begun_alike(number, starts, one_start and not read_twice)
    return int(np.count_nonzero(copied))


def _begun_alike(number: IntArray, starts: IntArray, whole: bool) -> BoolArray:
    """Which steps belong to the beginning of a run that is that of an earlier run too.

    Args:
        number: equal for equal steps, `(n,)`.
        starts: the first step of each run.
        whole: count runs that are copies from end to end as well.
    """
    alike = np.zeros(len(number), np.bool_)
    seen: dict[tuple[int, int], int] = {}  # the node before and a step: the next node
    for first, end in zip(starts, [*starts[1:], len(number)], strict=True):
        node, shared = 0, 0
        for step in number[first:end].tolist():
            key = (node, step)
            shared += key in seen
            node = seen.setdefault(key, len(seen) + 1)
        if whole or shared < end - first:
            alike[first : first + shared] = True
    return alike


def stalled_steps(
    states: FloatArray, inputs: FloatArray, next_states: FloatArray, episodes: IntArray
) -> int:
    """How many steps stand still between moving ones, as those of a row that is there twice.

    The same state and input lead to no motion, and in the next step to motion. What a
    plant does on its own is not counted:

    - at rest, in its goal or at a stop it does not move until the input changes. At a
      stop, where noise may move it, a variable is the least or the largest recorded;
    - a sensor with coarse levels repeats a value where the plant is slow, passing a
      level or two in the steps beside. So a variable must pass `CLEAR` levels in the
      same direction before and after.

    Args:
        states: `(n, d)`.
        inputs: `(n, m)`.
        next_states: `(n, d)`.
        episodes: the number of the run of each step, `(n,)`.
    """
    change = next_states - states
    still = np.asarray(~change.any(axis=1))
    if len(states) < 3 or not still.any():
        return 0
    linked = (episodes[1:] == episodes[:-1]) & (states[1:] == next_states[:-1]).all(
        axis=1
    )
    held = linked & (inputs[1:] == inputs[:-1]).all(axis=1)
    extreme = (states == states.min(axis=0)) | (states == states.max(axis=0))
    least = CLEAR * levels(states)
    found = 0
    for first, end in _blocks(still):
        # The block is `first` to `end` - 1; a step of the same run goes before and after.
        if first == 0 or end == len(states) or not linked[first - 1]:
            continue
        if not held[first:end].all() or extreme[first].any():
            continue
        before, after = change[first - 1], change[end]
        clear = (np.abs(before) >= least) & (np.abs(after) >= least)
        if (clear & (before * after > 0.0)).any():
            found += end - first
    return found


def levels(states: FloatArray) -> FloatArray:
    """The distance between the levels that each variable takes, 0 where there are none.

    Args:
        states: `(n, d)`.

    Returns:
        `(d,)`: the least distance of two values, if all others are multiples of it.
    """
    found = np.zeros(states.shape[1])
    for axis, column in enumerate(states.T):
        gaps = np.diff(np.unique(column))
        gaps = gaps[gaps > 1e-9 * np.ptp(column)]  # what is less is rounding
        if gaps.size:
            times = gaps / gaps.min()
            if (np.abs(times - np.rint(times)) < 0.01).all():
                found[axis] = gaps.min()
    return found


def _blocks(flags: BoolArray) -> list[tuple[int, int]]:
    """First and one past the last of each row of neighbouring flags."""
    padded = np.concatenate([[False], flags, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
