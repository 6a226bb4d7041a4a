"""What the numbers of a plant mean, and whether older recordings agree with it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.learned import Transitions
from acl_gym.envs.learned.description import Description, described, described_by
from acl_gym.model_based.arguments import action_space_of
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

CLOSE = 0.01
"""Two sampling times, or two periods of a circular variable, that differ by no more than
this share of one are the same."""


def facts_of_plant(
    env: Any,
    values: FloatArray | None,
    circular: Any,
    data: Transitions | None,
) -> dict[str, Any]:
    """Describe a plant once, for all of its recordings.

    What the environment does not tell is taken from `data`.

    Args:
        env: a single or a vector environment.
        values: what each action of the policy sets, `(n_actions, n_inputs)`; None where
            actions are numbered and nobody has said what they set.
        circular: names or numbers of variables that wrap around, beside those of which
            the environment tells.
        data: what was recorded of the plant before.

    Returns:
        Arguments of `Transitions`, `angles` among them only if `data` has some.

    Raises:
        TypeError: observations or actions are of a kind that cannot be recorded.
        ValueError: `data` is of another plant, or `circular` names no variables.
    """
    numbered = isinstance(action_space_of(env), spaces.Discrete)
    facts = described_by(env, values if numbered else None)
    size, n_inputs = facts.pop("size"), facts.pop("n_inputs")
    if values is not None:
        facts["values"] = values
    told = facts.pop("circular", None)  # None: the environment does not say
    if data is not None:
        _check_columns(data, facts, size, n_inputs)
        facts = _completed(facts, data.description)
    wrapping = () if circular is None else circular
    named = described(size, n_inputs, circular=wrapping, **_names(facts))
    axes = {*(told or ()), *named.circular}
    if data is not None:
        other = set(data.description.circular) - axes
        if other and told is not None:
            raise ValueError(
                "data must describe the plant as the environment does, in which "
                f"{_shown(named, told)} wrap around, got data in which "
                f"{_shown(named, other)} do so too; leave that out of circular= of the "
                "data."
            )
        axes |= other
        facts |= _ends(facts, data.description, axes, named)
    facts["circular"] = tuple(sorted(axes))
    described(size, n_inputs, **{**facts, "angles": ()})  # fails now, before any step
    return facts


def joined(
    parts: Sequence[Mapping[str, NDArray[Any]]], facts: Mapping[str, Any]
) -> Transitions:
    """Join recordings of one plant, one after the other.

    What one of them lacks, such as rewards, is left out. Cosines and sines of angles are
    looked for in all steps together.

    Args:
        parts: arrays of `Transitions`, with `episodes`; one part or more.
        facts: of the plant, see `facts_of_plant`.
    """
    names = set.intersection(*(set(part) for part in parts))
    arrays = {name: np.concatenate([part[name] for part in parts]) for name in names}
    runs, before = [], 0
    for part in parts:
        own = part["episodes"]
        runs.append(own - own[0] + before)
        before = runs[-1][-1] + 1
    arrays["episodes"] = np.concatenate(runs)
    found: dict[str, Any] = {**arrays, **facts}
    return Transitions(**found)


def arrays_of(data: Transitions) -> dict[str, NDArray[Any]]:
    """What `joined` takes of a recording."""
    arrays = {
        "states": data.states,
        "inputs": data.inputs,
        "next_states": data.next_states,
        "rewards": data.rewards,
        "terminated": data.terminated,
        "episodes": data.episodes,
    }
    return {name: array for name, array in arrays.items() if array is not None}


def _check_columns(
    data: Transitions, facts: dict[str, Any], size: int, n_inputs: int
) -> None:
    """Refuse data with other columns than the plant has, or in another order."""
    known = data.description
    for what, own, its in (
        ("variables", size, len(known.state_names)),
        ("inputs", n_inputs, len(known.input_names)),
    ):
        if own != its:
            raise ValueError(
                f"data must have {own} {what}, as the environment has, got {its}."
            )
    for name in ("state_names", "input_names"):
        names, its_names = facts.get(name), getattr(known, name)
        own_names = its_names if names is None else tuple(names)
        if own_names != its_names and set(own_names) == set(its_names):
            raise ValueError(
                f"data must have {name} in the order of the environment, {own_names}, "
                f"got {its_names}."
            )
    numbered = bool(facts.get("numbered"))
    if numbered and not known.numbered:
        raise ValueError(
            "data must hold numbers of actions, since the environment does not tell what "
            "its actions set, got inputs; say by inputs= what each action sets, or "
            "describe data that holds numbers by numbered=True."
        )
    if known.numbered and not numbered:
        raise ValueError(
            "data must hold what actions set, got numbers of actions; record it again, "
            "with inputs= where the environment does not tell what its actions set."
        )
    own_time, its_time = facts.get("sampling_time"), known.sampling_time
    if own_time and its_time and not math.isclose(own_time, its_time, rel_tol=CLOSE):
        raise ValueError(
            f"data must have a sampling time of {own_time:g} s, as the environment has, "
            f"got {its_time:g} s."
        )


def _completed(facts: dict[str, Any], known: Description) -> dict[str, Any]:
    """Facts of the environment, and of data what it does not tell."""
    more: dict[str, Any] = {
        "state_names": known.state_names,
        "input_names": known.input_names,
        "sampling_time": known.sampling_time,
    }
    if known.angles:
        more["angles"] = known.angles
    return {**more, **{n: fact for n, fact in facts.items() if fact is not None}}


def _ends(
    facts: dict[str, Any], known: Description, axes: set[int], named: Description
) -> dict[str, Any]:
    """Low and high: the wider ones where both know them, else those that are known."""
    low, high = np.array(facts["low"], float), np.array(facts["high"], float)
    for axis, (bottom, top) in enumerate(zip(known.low, known.high, strict=True)):
        bounded = np.isfinite([low[axis], high[axis]])
        if axis not in axes:
            low[axis] = min(_known(low[axis], bottom), default=-np.inf)
            high[axis] = max(_known(high[axis], top), default=np.inf)
        elif axis in known.circular and not bounded.any():
            low[axis], high[axis] = bottom, top
        elif axis in known.circular and bounded.all():
            period, its = high[axis] - low[axis], top - bottom
            if not math.isclose(period, its, rel_tol=CLOSE):
                raise ValueError(
                    f"{named.state_names[axis]} must wrap around in data as in the "
                    f"environment, from {low[axis]:g} to {high[axis]:g}, got {bottom:g} "
                    f"to {top:g}; use the same unit and the same ends (low= and high= of "
                    "data, the Box of the environment)."
                )
    return {"low": low, "high": high}


def _known(*ends: float) -> list[float]:
    return [end for end in ends if math.isfinite(end)]


def _names(facts: dict[str, Any]) -> dict[str, Any]:
    return {name: facts.get(name) for name in ("state_names", "input_names")}


def _shown(named: Description, axes: Any) -> str:
    found = [named.state_names[axis] for axis in sorted(axes)]
    return validation.shown(found) if found else "no variables"
