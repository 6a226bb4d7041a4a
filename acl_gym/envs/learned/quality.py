"""What speaks against learning from a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acl_gym.envs.learned.copies import copied_steps, stalled_steps
from acl_gym.envs.learned.description import Description
from acl_gym.utils.angles import FULL_CIRCLE
from acl_gym.utils.typing import FloatArray, IntArray

FEW = 10
"""Steps for each variable and input below which a recording is called short."""

MANY_TURNS = 20
"""Turns of an angle in one recording above which its unit is doubted."""

OFTEN_TWICE = 0.25
"""The share of moving steps that may be there twice; runs with the same start may begin
alike."""

OFTEN_STALLED = 0.02
"""The share of steps that may stall between moving ones, see `stalled_steps`."""

PARTS = 20
"""Parts of a recording in which units are compared, to see whether they change."""

ALIKE = 0.1
"""The share by which two factors may differ that are taken for the same one."""

ROUGHLY = 0.5
"""The same for factors of parts, which are less certain; those between units are larger."""

FAR = 0.5
"""How many times its recorded range a goal may lie beyond that range, in a variable, before
a doubt is raised."""

UNSURE = 0.5
"""A spread above which a model is called unsure of a step: half of what a step changes on
the average."""

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
    episodes: IntArray,
    description: Description,
) -> list[str]:
    """What speaks against learning from this data, a sentence each.

    Args:
        states: `(n, d)`, circular variables between their ends.
        inputs: `(n, m)`.
        next_states: `(n, d)`.
        episodes: the number of the run of each step, `(n,)`.
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
    twice = copied_steps(states, inputs, next_states, episodes)
    if twice > OFTEN_TWICE * count:
        found.append(
            f"{twice} of {count} steps are copies of others; check that no file was read "
            "twice, and remove rows that are there twice."
        )
    stalled = stalled_steps(states, inputs, next_states, episodes)
    if stalled > OFTEN_STALLED * count:
        found.append(
            f"in {_count(stalled, 'step')} of {count} nothing moves, though the plant moves "
            "before and, with the same input, after; remove rows that are there twice, and "
            "check that each sensor is read anew for each row."
        )
    return found


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def unit_doubts(
    states: FloatArray, next_states: FloatArray, description: Description
) -> list[str]:
    """What suggests that units are mixed up, a sentence each.

    Either a variable is the rate of change of another except for a factor between units,
    or an angle makes more turns than angles usually do.

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
    moved = time * 0.5 * (states + next_states)  # what each variable says as a rate
    names = description.state_names
    for axis in range(states.shape[1]):
        for rate in range(states.shape[1]):
            if axis == rate or _is_told(
                axis, change[:, axis], moved[:, rate], description
            ):
                continue
            words = _unit_of_rate(
                change[:, axis], moved[:, rate], names[axis], names[rate]
            )
            if words is not None:
                found.append(words)
    return found


def _unit_of_rate(
    change: FloatArray, expected: FloatArray, name: str, rate: str
) -> str | None:
    """What speaks against the units of a variable and its rate of change, a sentence.

    Args:
        change: of the variable in each step, `(n,)`.
        expected: what the rate says it is, `(n,)`.
        name: of the variable.
        rate: name of the rate.
    """
    factor = _factor(change, expected)
    if factor is not None:
        unit = _unit(factor)
        if unit is None:
            return None
        return (
            f"{name} changes {factor:.3g} times as fast as {rate} says, as if one of them "
            f"were in {unit}; give both in the same unit."
        )
    # Together they do not fit. Do they in parts?
    size = max(FEW, -(-len(change) // PARTS))
    factors = [
        (first, each)
        for first in range(0, len(change), size)
        if (each := _factor(change[first:][:size], expected[first:][:size])) is not None
    ]
    if not factors:
        return None
    same = [each for _, each in factors if _alike(each, factors[0][1], ROUGHLY)]
    others = [
        (first, each)
        for first, each in factors
        if not _alike(each, factors[0][1], ROUGHLY)
    ]
    # Two parts of each, since one may look so by chance. The unit changes within a part,
    # whose factor may be anything.
    if len(same) < 2 or len(others) < 2:
        return None
    before, after = float(np.median(same)), float(np.median([f for _, f in others]))
    unit = _unit(after / before)
    meant = any(
        _alike(each, 1.0) or _unit(each) is not None for each in (before, after)
    )
    if unit is None or not meant:
        return None
    return (
        f"{name} changes by {before:.3g} times what {rate} says at first, and by "
        f"{after:.3g} times that from about step {others[0][0]} on, as if one of them were "
        f"in {unit} in a part of the recording; give all of it in the same unit."
    )


def _is_told(
    axis: int, change: FloatArray, expected: FloatArray, description: Description
) -> bool:
    """Whether the ends of an angle tell that its unit differs from that of its rate.

    A turn from -180 to 180 is one in degrees, and its rate may be in radians per second.
    """
    factor = _factor(change, expected)
    if axis not in description.circular or factor is None:
        return False
    turn = description.high[axis] - description.low[axis]
    return _alike(factor, turn / FULL_CIRCLE)


def _alike(one: float, other: float, share: float = ALIKE) -> bool:
    return bool(abs(np.log(one / other)) < share)


def _unit(factor: float) -> str | None:
    """The units that are mixed up where there is such a factor, in words."""
    for unit, words in UNITS.items():
        if _alike(factor, unit) or _alike(factor, 1 / unit):
            return words
    return None


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
    factor = float(change @ expected / (expected @ expected))
    return factor if factor > 0.0 else None
