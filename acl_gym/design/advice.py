"""What to try where the goal is not reached from enough starts, or in a poor model."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from acl_gym.design.learning import CLOSE, GOOD, Learned
from acl_gym.design.limits import Limits
from acl_gym.design.measures import Measures
from acl_gym.envs.plant import Plant
from acl_gym.utils.text import digits, percent

NEAR = 3.0
"""Multiples of the half-widths of the goal within which a failure was close."""

MOSTLY = 0.5
"""The share of starts with an unsure model, above which its figures say nothing."""

NOTHING = 0.95
"""The error in cross-validation from which on a variable is not predicted at all."""

TURNS = (2.0 * math.pi, 360.0)
"""A full turn in radians and in degrees."""

ANGLE = re.compile(
    r"\bangle|\b(theta|phi|psi)\b|[θφψ]|(\b(rad|deg|degrees?)\b|°)(?!\s*/)",
    re.IGNORECASE,
)
"""What the name of a variable that is an angle says, but not the name of a rate."""

_MORE = {
    "time": "Give it more time, --seconds with a larger number",
    "steps": "Give it more interactions, --steps with a larger number",
    "interrupted": "Do not interrupt it",
}


_OPTIONS = {
    "circular=": "--circular",
    "max_episode_steps=": "--max-steps",
    "tolerance=": "--tolerance",
    "inputs=": "--actions",
    "low=": "--low",
    "high=": "--high",
    "initial=": "--starts",
}
"""What the arguments are called where a plant is known by recordings."""


def fault_of_model(model: Mapping[str, Any] | None) -> str | None:
    """Why the figures of a learned model say nothing about the plant, a clause.

    Args:
        model: what `model_facts` has found; None for a plant with equations.

    Returns:
        None where they may be believed.
    """
    if model is None:
        return None
    spread, errors = model["spread"], model["errors"]
    if spread["unsure"] > MOSTLY:
        return (
            f"the model is unsure (spread above {spread['limit']:g}) on the way from "
            f"{spread['unsure']:.1%} of the starts"
        )
    name = max(errors, key=errors.__getitem__)
    if errors[name] > NOTHING:
        return (
            f"the model does not predict {name}: its error in cross-validation is "
            f"{errors[name]:.2f}, where 1 is no better than the mean"
        )
    return None


def advice_on_model(model: Mapping[str, Any]) -> list[str]:
    """Sentences on what to try where the model has a fault, the most promising first.

    Args:
        model: what `model_facts` has found.
    """
    found = [
        f"Repair the recording or its description: {_as_options(doubt)}"
        for doubt in model["doubts"]
    ]
    if not found:
        found.append(
            "Check that --state names all that decides what happens next, that angles "
            "are named by --circular, with their ends by --low and --high if they are not "
            "in radians, and that the sampling time is right. Filter noise, or sample less "
            "often, where it is more than what a step changes."
        )
    found.append(
        f"Record more than these {model['steps']:,} steps, from all states that the plant "
        "is to pass."
    )
    return found


def advice(learned: Learned, measures: Measures, plant: Plant) -> list[str]:
    """Sentences on what to try, the most promising first; empty where all is well.

    Args:
        learned: what learning came to.
        measures: of the policy.
        plant: the system.
    """
    if measures.success_rate >= GOOD:
        return []
    from_data = hasattr(plant, "dynamics")
    failed = 1.0 - measures.success_rate
    late = measures.late_rate > 0.5 * failed
    near = measures.nearest is not None and measures.nearest < NEAR
    longer = (
        "Allow more time for an episode (max_episode_steps=): it ends after "
        f"{digits(plant.evaluation_steps * plant.sampling_time)} s"
    )
    finer = [
        "Sample more finely (sampling_time=, with as many more max_episode_steps): now "
        f"the input is held for {digits(plant.sampling_time)} s.",
        f"Allow more actions (inputs=, now {len(plant.inputs)}), in particular weaker ones "
        "between the strongest.",
    ]
    if from_data:
        finer = ["Record more, in particular where the report shows an unsure model."]
    found = [
        f"Name {plant.variable_names[axis].split(', ')[0]} in circular= if it is an angle: "
        f"it is not named there, so that {digits(plant.low[axis])} and "
        f"{digits(plant.high[axis])} count as far apart."
        for axis in forgotten_angles(plant)
    ]
    none_round = not found and not plant.circular
    if learned.ended in _MORE:
        found.append(
            f"{_MORE[learned.ended]}: learning was not finished after "
            f"{learned.seconds:.0f} s."
        )
    if late:
        found.append(
            f"{longer}, and from most of the starts that fail the goal is reached later."
        )
    if near:
        found.append(
            "Make the goal larger (tolerance=): from the starts that fail, the state "
            f"comes as near as {digits(measures.nearest or 0.0)} times the distance from "
            "the middle of the goal to its border."
        )
        found += finer
    found.append(
        "Make the inputs stronger (inputs=), if the actuator allows it: from "
        f"{state_in_words(measures.worst_start, plant)}, the worst start, the goal may be "
        "out of reach."
    )
    if not late:
        found.append(f"{longer}.")
    if not near:
        found += finer
    if not from_data:
        found.append(
            "Begin with easier starts (initial=), if the plant never is in all states "
            "between low and high."
        )
    if none_round:
        found.append(
            "Name the angles that can turn all the way round in circular=, if there are "
            "any: now no variable wraps around."
        )
    if from_data:
        found = [_as_options(each) for each in found]
    return found


def advice_on_limits(limits: Limits, measures: Measures, plant: Plant) -> list[str]:
    """What to do where success may be owed to the limits of the range; mostly empty.

    The model stops a state at `low` and `high` like a wall, which the plant may not have.
    A limit that is only touched does no harm, such as that of a speed which is there to
    bound the table. So what counts is by how much the success rate falls if nothing stops
    the state; where this is not known, the share of the paths to the goal that touch a
    limit. Up to `CLOSE` is neglected, below which success rates count as equal when
    policies are compared.

    Args:
        limits: how often they are touched.
        measures: of the policy.
        plant: the system.
    """
    free = limits.success_rate_unlimited
    if free is None:
        doubtful = limits.touched_success_rate > CLOSE
        what = (
            f"{percent(limits.touched_success_rate)} of the paths to the goal may not "
            "reach it"
        )
    else:
        doubtful = measures.success_rate - free > CLOSE
        what = f"the goal is reached from only {percent(free)} of the starts"
    if not doubtful:
        return []
    found = (
        "Unless the plant stops at the ends of its range as the model does, in particular "
        f"at those of {limits.most}, {what}. Make the range (low=, high=) wider than "
        "anything that the plant can reach, give the states in which episodes begin by "
        "initial=, and design again."
    )
    return [_as_options(found) if hasattr(plant, "dynamics") else found]


def forgotten_angles(plant: Plant) -> list[int]:
    """Variables that look like angles of a full turn, and do not wrap around.

    They have a range of one or more full turns, to within 1%, or a range of at least one
    turn and the name or the unit of an angle.

    Args:
        plant: the system.
    """
    found = []
    for axis, name in enumerate(plant.variable_names):
        turns = [(plant.high[axis] - plant.low[axis]) / turn for turn in TURNS]
        whole = any(
            round(count) >= 1 and abs(count / round(count) - 1.0) <= 0.01
            for count in turns
        )
        named = ANGLE.search(name) is not None and turns[0] >= 0.99
        if axis not in plant.circular and (whole or named):
            found.append(axis)
    return found


def state_in_words(state: tuple[float, ...], plant: Plant) -> str:
    """The variables of a state with their names: "angle 3.14 rad, speed 0 rad/s"."""
    parts = []
    for name, value in zip(plant.variable_names, state, strict=False):
        word, *rest = name.split(", ")
        unit = f" {rest[0]}" if rest else ""
        joined = f"{word} = " if "[" in word else f"{word} "
        parts.append(f"{joined}{digits(value)}{unit}")
    return ", ".join(parts)


def _as_options(sentence: str) -> str:
    """Advice on a recording names options of the command, not arguments of `plant`."""
    for argument, option in _OPTIONS.items():
        sentence = sentence.replace(argument, option)
    return sentence
