"""What speaks against learning from a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acl_gym.envs.learned.description import Description
from acl_gym.utils.typing import FloatArray

FEW = 10
"""Steps for each variable and input, below which a recording is called short."""

MANY_TURNS = 20
"""Turns of an angle in one recording that are hardly turns."""

OFTEN_TWICE = 0.25
"""The share of rows that may be there twice; a plant at rest repeats itself."""

FAR = 0.5
"""How many times its recorded range a goal may lie beyond it, in a variable, before that
is said."""

UNITS = {
    180 / np.pi: "degrees instead of radians",
    60.0: "minutes instead of seconds",
    30 / np.pi: "revolutions per minute instead of radians per second",
    1000.0: "thousandths",
    100.0: "hundredths",
}
"""Factors between units that are often mixed up."""


class DataWarning(UserWarning):
    """Something speaks against learning from a recording."""


def doubts(
    states: FloatArray,
    inputs: FloatArray,
    next_states: FloatArray,
    description: Description,
) -> list[str]:
    """What speaks against learning from this data, a sentence each.

    Args:
        states: `(n, d)`, circular variables between their ends.
        inputs: `(n, m)`.
        next_states: `(n, d)`.
        description: of both.
    """
    count, size = states.shape
    found = []
    wanted = FEW * (size + inputs.shape[1])
    if count < wanted:
        found.append(
            f"there are only {_count(count, 'step')} for {_count(size, 'variable')} and "
            f"{_count(inputs.shape[1], 'input')}; record {wanted} or more."
        )
    for name, column in zip(description.input_names, inputs.T, strict=True):
        if count > 1 and np.ptp(column) == 0.0:
            found.append(
                f"the input {name} is always {column[0]:g}, so that its effect is "
                "unknown; record with an input that changes."
            )
    for axis, name in enumerate(description.state_names):
        both = np.concatenate([states[:, axis], next_states[:, axis]])
        if count > 1 and np.ptp(both) == 0.0:
            found.append(
                f"the variable {name} is always {both[0]:g}; leave it out, or check its "
                "sensor."
            )
    rows = np.concatenate([states, inputs, next_states], axis=1)
    twice = count - len(np.unique(rows, axis=0))
    if twice > OFTEN_TWICE * count and not _discrete(states):
        found.append(
            f"{twice} of {count} rows occur more than once; check that no file "
            "was read twice, and that no sensor stands still."
        )
    return found


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _discrete(states: FloatArray) -> bool:
    """Whether states are whole numbers, which repeat themselves."""
    return bool((states == np.rint(states)).all())


def unit_doubts(
    states: FloatArray, next_states: FloatArray, description: Description
) -> list[str]:
    """What speaks for units that are mixed up, a sentence each.

    A variable is the rate of change of another, but for a factor between units; or an
    angle goes round more often than any.

    Args:
        states: as they were recorded, `(n, d)`, angles not brought back.
        next_states: the same.
        description: of both.
    """
    found = []
    for axis in description.circular:
        span = description.high[axis] - description.low[axis]
        turns = float(np.ptp(np.concatenate([states, next_states])[:, axis]) / span)
        if turns > MANY_TURNS:
            found.append(
                f"the angle {description.state_names[axis]} goes through {turns:.0f} "
                f"turns of {span:.4g}; if it is in degrees, give low= and high= such as "
                "0 and 360, or radians."
            )
    time = description.sampling_time
    if time is None or len(states) < FEW:
        return found
    change = next_states - states
    for axis in description.circular:
        span = description.high[axis] - description.low[axis]
        if np.abs(change[:, axis]).max() <= span:  # else it is no angle in this unit
            change[:, axis] -= span * np.rint(change[:, axis] / span)
    middle = 0.5 * (states + next_states)
    names = description.state_names
    for axis in range(states.shape[1]):
        for rate in range(states.shape[1]):
            factor = _factor(change[:, axis], middle[:, rate] * time)
            if axis == rate or factor is None:
                continue
            near = min(
                (
                    (abs(np.log(factor / times)), words)
                    for unit, words in UNITS.items()
                    for times in (unit, 1 / unit)
                ),
            )
            if near[0] < 0.1:
                found.append(
                    f"{names[axis]} changes {factor:.3g} times as fast as "
                    f"{names[rate]} says, as if one of them were in {near[1]}; give both "
                    "in the same unit."
                )
    return found


def goal_doubts(
    recorded: FloatArray, goal: FloatArray, names: Sequence[str]
) -> list[str]:
    """What speaks against a goal that is far from what was recorded, a sentence each.

    Args:
        recorded: the least and the largest value of each variable, `(2, d)`; none of
            them wraps around.
        goal: the lower and the upper end of the goal, `(2, d)`.
        names: of these variables.
    """
    found = []
    (least, most), (goal_low, goal_high) = recorded, goal
    span = np.maximum(most - least, 1e-3 * (1.0 + np.abs(most)))
    beyond = np.maximum(least - goal_high, goal_low - most) / span
    for axis, name in enumerate(names):
        if beyond[axis] <= FAR:
            continue
        near = goal_high[axis] if goal_high[axis] < least[axis] else goal_low[axis]
        found.append(
            f"the goal begins at {name} = {near:.4g}, {beyond[axis]:.2g} times the "
            f"recorded range ({least[axis]:.4g} to {most[axis]:.4g}) beyond it, where the "
            "model knows nothing and only extrapolates; record on the way to the goal, or "
            "check the unit of goal."
        )
    return found


def _factor(change: FloatArray, expected: FloatArray) -> float | None:
    """By which factor one follows the other; None if it does not."""
    if change.std() == 0.0 or expected.std() == 0.0:
        return None
    if np.corrcoef(change, expected)[0, 1] < 0.98:
        return None
    return float(change @ expected / (expected @ expected))
