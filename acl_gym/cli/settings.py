"""Values of options as text: numbers, lists, schedules, deposits and costs.

One small language for all of them. A value is JSON or a Python literal, or else a text.
Where a parameter takes an object of this package, the object may be written as the name
of its class and its arguments, separated by colons:

    rank:5   linear:0.3:0.01:50   settling_time:0:3.14:tolerance=0.1

Costs can be added and weighted: `settling_time:0:3.14+2*overshoot:0:3.14+0.1`.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from acl_gym import costs, deposits, schedules
from acl_gym.cli.agents import AGENTS, CHOICES, Declared, parameters
from acl_gym.cli.common import check_name
from acl_gym.cli.errors import BadArgumentError, in_words
from acl_gym.utils.validation import did_you_mean

Kinds = Mapping[str, type[Any]]


def _by_name(*kinds: type[Any]) -> dict[str, type[Any]]:
    """Classes by their names in small letters: settling_time of SettlingTime."""
    return {re.sub(r"(?<!^)(?=[A-Z])", "_", k.__name__).lower(): k for k in kinds}


SCHEDULES = _by_name(schedules.Linear, schedules.Exponential, schedules.Harmonic)
DEPOSITS = _by_name(deposits.InverseCost, deposits.Return, deposits.Rank)
COSTS = _by_name(
    costs.StageCosts,
    costs.Steps,
    costs.Quadratic,
    costs.RiseTime,
    costs.SettlingTime,
    costs.Overshoot,
)
OBJECTS = {"cost": COSTS, "deposit": DEPOSITS}
"""The parameters that take an object, by name; those of schedules declare it."""

_WORDS = {"true": True, "false": False, "none": None, "null": None}
_SWITCHES = ("yes", "no", "on", "off", "y", "n", "t", "f")
_LINE = 76
_DEEPEST = 20
"""Brackets within brackets; no setting needs as many."""


def parse_value(option: str, text: str) -> Any:
    """Read a value: JSON or a Python literal, otherwise the text itself.

    True, False and None may be written in any letters. `yes`, `no`, `on` and `off` are
    refused: as texts they would count as true; in quotes they are texts.

    Args:
        option: what is set, for messages.
        text: the value.

    Raises:
        BadArgumentError: the value begins like a list but is not one, holds a number
            that is not finite, or is a switch written in other words.
    """
    word = text.strip().lower()
    if word in _WORDS:
        return _WORDS[word]
    if word in _SWITCHES:
        raise BadArgumentError(
            f"{option} must be true or false, got {text!r}; for the text itself write "
            f"'\"{text}\"'."
        )
    if max(text.count(bracket) for bracket in "[({") > _DEEPEST * 50:
        raise BadArgumentError(f"{option} must be shorter, got {text[:40]!r}...")
    for read in (_json, ast.literal_eval):
        try:
            return _plain(option, read(text.strip()))
        except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
            continue
    if text.lstrip()[:1] in ("[", "{"):
        raise BadArgumentError(
            f"{option} must be a list such as [-1, 0, 1], got {text!r}."
        )
    return text


def _json(text: str) -> Any:
    # Python's reader takes NaN and Infinity, which no file could hold.
    return json.loads(text, parse_constant=_not_finite)


def _not_finite(name: str) -> Any:
    raise BadArgumentError(f"a value must be finite, got {name}.")


def _plain(option: str, value: Any, depth: int = 0) -> Any:
    """JSON types only, tuples as lists."""
    if depth > _DEEPEST:
        raise BadArgumentError(
            f"{option} must have at most {_DEEPEST} brackets within brackets."
        )
    if isinstance(value, (list, tuple)):
        return [_plain(option, each, depth + 1) for each in value]
    if isinstance(value, dict):
        return {str(k): _plain(option, each, depth + 1) for k, each in value.items()}
    if isinstance(value, float) and not abs(value) < float("inf"):
        _not_finite(str(value))
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise BadArgumentError(
        f"{option} must be a number, a text, true, false or a list, got {value!r}."
    )


def parse_pairs(
    option: str, texts: Iterable[str], allowed: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Split `name=value` pairs.

    Args:
        option: the option, for messages.
        texts: the pairs.
        allowed: the valid names, each with its range or ""; None allows all.

    Raises:
        BadArgumentError: a text has no `=`, or a name is unknown or repeated.
    """
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name.isidentifier():
            raise BadArgumentError(f"{option} must be name=value, got {text!r}.")
        if allowed is not None and name not in allowed:
            names = (f"{n} ({allowed[n]})".removesuffix(" ()") for n in sorted(allowed))
            raise BadArgumentError(
                f"{option} has no {name!r}; choose from {', '.join(names)}."
                f"{did_you_mean(name, allowed)}"
            )
        if name in pairs:
            raise BadArgumentError(f"{option} sets {name!r} twice.")
        pairs[name] = value
    return pairs


def parse_settings(option: str, texts: Iterable[str]) -> dict[str, Any]:
    """Parse `name=value` pairs whose names are not known here into plain values.

    Raises:
        BadArgumentError: see `parse_pairs` and `parse_value`.
    """
    pairs = parse_pairs(option, texts)
    return {name: parse_value(f"{option} {name}", text) for name, text in pairs.items()}


def parse_parameters(
    option: str, texts: Iterable[str], declared: Mapping[str, Declared]
) -> dict[str, Any]:
    """Parse the parameters of an agent.

    Args:
        option: the option, for messages.
        texts: the pairs, each `name=value`.
        declared: the parameters that there are.

    Raises:
        BadArgumentError: a name or an object is unknown, or its arguments are wrong.
    """
    ranges = {name: each.range for name, each in declared.items()}
    return {
        name: _parameter(f"{option} {name}", name, text, declared[name])
        for name, text in parse_pairs(option, texts, ranges).items()
    }


def _parameter(option: str, name: str, text: str, declared: Declared) -> Any:
    if name in OBJECTS:
        if text.strip().lower() in ("none", "null") and declared.default is None:
            return None
        return (
            parse_sum(option, text) if name == "cost" else _term(option, text, DEPOSITS)
        )
    value = parse_value(option, text)
    if declared.scheduled and isinstance(value, str):
        return _term(option, text, SCHEDULES)
    if name in CHOICES:
        return check_name(option, text.strip(), CHOICES[name])
    if isinstance(declared.default, bool) and not isinstance(value, bool):
        raise BadArgumentError(f"{option} must be true or false, got {text!r}.")
    return value


def agent_with(option: str, texts: Iterable[str]) -> str:
    """The agent that is meant where none is named: the first that takes what is set.

    So `deposit=rank:5` alone is enough to have the agent whose ants deposit.

    Args:
        option: the option, for messages.
        texts: parameters, each `name=value`.

    Returns:
        A key of `AGENTS`.

    Raises:
        BadArgumentError: a name is unknown, or no agent takes all of them.
    """
    of_each = {kind: parameters(kind) for kind in AGENTS}
    ranges = {n: each.range for known in of_each.values() for n, each in known.items()}
    pairs = parse_pairs(option, texts, ranges)
    for kind, known in of_each.items():
        if all(n in known and _takes(known[n], text) for n, text in pairs.items()):
            return kind
    raise BadArgumentError(
        f"{option}: no agent takes all of {', '.join(pairs)} as given; `acl-gym train "
        "--help` lists the parameters of each."
    )


def _takes(declared: Declared, text: str) -> bool:
    """Whether a parameter takes values of this form: few may change by a schedule."""
    return declared.scheduled or _kind_name(text.partition(":")[0]) not in SCHEDULES


def parse_sum(option: str, text: str) -> costs.Cost:
    """A cost, or a sum of costs with factors and constants.

    Raises:
        BadArgumentError: see `parse_parameters`.
    """
    found: Any = None
    for part in _split(option, text, "+"):
        factor, star, rest = part.partition("*")
        number = _number(factor)
        if star and number is None:
            raise BadArgumentError(
                f"{option} must have a number before '*', got {text!r}."
            )
        term: Any = number
        if star or number is None:
            term = _term(option, rest if star else part, COSTS)
        try:
            if star:
                term = number * term
            found = term if found is None else found + term
        except (TypeError, ValueError) as error:
            raise BadArgumentError(f"{option}: {error}") from error
    if not isinstance(found, costs.Cost):
        raise BadArgumentError(
            f"{option} must name a cost, got {text!r}; choose from {', '.join(COSTS)}."
        )
    return found


def _term(option: str, text: str, kinds: Kinds) -> Any:
    """`name:argument:field=argument` as an object."""
    name, *arguments = _split(option, text, ":")
    name = name.strip()
    kind = kinds.get(_kind_name(name))
    if kind is None:
        choices = ", ".join(signature(each, kinds[each]) for each in kinds)
        raise BadArgumentError(
            f"{option} has no {name!r}; choose from {choices}."
            f"{did_you_mean(name, kinds)}"
        )
    known = [field.name for field in fields(kind)]
    given: dict[str, Any] = {}
    for place, argument in enumerate(arguments):
        field, equals, value = argument.partition("=")
        if not equals:
            field, value = (known[place] if place < len(known) else ""), argument
        if field.strip() not in known or field.strip() in given:
            raise BadArgumentError(
                f"{option} must be {signature(name, kind)}, got {text!r}."
            )
        given[field.strip()] = _tuples(parse_value(f"{option}, {field}", value))
    try:
        return kind(**given)
    except (TypeError, ValueError) as error:
        missing = "argument" in str(error) and isinstance(error, TypeError)
        reason = "" if missing else f" {in_words(error)}"
        raise BadArgumentError(
            f"{option} must be {signature(name, kind)}, got {text!r}.{reason}"
        ) from error


def _kind_name(text: str) -> str:
    """The name of a kind of object, which may be written with capitals and hyphens."""
    return text.strip().lower().replace("-", "_")


def _tuples(value: Any) -> Any:
    """Lists as tuples, which the classes declare."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _split(option: str, text: str, separator: str) -> list[str]:
    """Split at a separator outside brackets; the `+` in 1e+5 does not count as one."""
    parts, depth, begin = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter in "[(") - (letter in "])")
        exponent = letter == "+" and re.search(r"\d[eE]$", text[:place])
        if letter == separator and depth == 0 and not exponent:
            parts.append(text[begin:place])
            begin = place + 1
    if depth:
        raise BadArgumentError(f"{option} must close its brackets, got {text!r}.")
    return [*parts, text[begin:]]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def signature(name: str, kind: type[Any]) -> str:
    """How an object is written: linear:START:END:TRIALS, rank[:EXPONENT=1.0].

    Without the defaults where a line of a terminal has no room for them.
    """
    text = name + "".join(map(_argument, fields(kind)))
    return text if len(text) <= _LINE else re.sub(r"=[^\]]*", "", text)


def _argument(field: Field[Any]) -> str:
    word = field.name.upper()
    if field.default is MISSING and field.default_factory is MISSING:
        return f":{word}"
    if field.default is None:
        return f"[:{word}]"
    return f"[:{word}={field.default}]"
