"""What states, actions and inputs are called in a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from acl_gym.envs.control.signals import Signals
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.grid_search.system import GridSearch
from acl_gym.utils import validation

_DIRECTIONS = {(-1, 0): "north", (1, 0): "south", (0, 1): "east", (0, -1): "west"}

Labels = Sequence[str] | Mapping[int, str] | None
"""Names of state variables: of all in order, or of some by their number."""


def with_unit(name: str) -> str:
    """The unit in brackets, as in "torque u (N m)"; notes that follow are left out."""
    word, *rest = name.split(", ")
    return f"{word} ({rest[0]})" if rest else word


def action_names(
    given: Sequence[str] | None, system: ControlSystem | None, first: int, count: int
) -> tuple[str, ...]:
    """The names of all actions: those given, the directions of a grid, or numbers.

    Args:
        given: by the user; None if there are no such names.
        system: that of an environment of this package, or None.
        first: the number of the first action.
        count: how many there are.

    Raises:
        ValueError: there is not a name for each.
    """
    if given is not None:
        names = tuple(given) if not isinstance(given, str) else ()
        if len(names) != count or not all(isinstance(name, str) for name in names):
            raise ValueError(
                f"actions must be {count} names, one for each action, got "
                f"{validation.shown(given)}."
            )
        return names
    if isinstance(system, GridSearch) and len(system.directions) == count:
        return tuple(_DIRECTIONS[move] for move in system.directions)
    return tuple(f"action {first + u}" for u in range(count))


def _own_names(
    signals: Signals | None, count: int, angles: Sequence[tuple[int, int]]
) -> list[str]:
    """The names of variables that the user has not named: those of their observations."""
    known = () if signals is None else signals.observations
    if len(known) != count + len(angles):
        known = ()
    cosines, sines = zip(*angles, strict=True) if angles else ((), ())
    names = []
    for column in range(count + len(angles)):
        if column in sines:
            continue
        name = with_unit(known[column]) if known else f"state {column + 1}"
        if column in cosines:
            whose = f"of {known[column].split(', ')[0]}" if known else f"{column + 1}"
            name = f"angle {whose} (rad)"
        names.append(name)
    return names


def variable_names(
    labels: Labels,
    signals: Signals | None,
    count: int,
    angles: Sequence[tuple[int, int]],
) -> list[str]:
    """The names of all variables: those given, and for the others their own.

    Args:
        labels: by the user.
        signals: of the environment or the policy, if known.
        count: how many variables there are.
        angles: columns of observations that are cosine and sine of one variable.

    Raises:
        ValueError: `labels` do not fit.
    """
    names = _own_names(signals, count, angles)
    if labels is None:
        return names
    given: dict[Any, Any] = {}
    if isinstance(labels, Mapping):
        given = dict(labels)
    elif isinstance(labels, Sequence) and not isinstance(labels, str):
        given = dict(enumerate(labels))
    fits = given and all(
        isinstance(name, str) and key in range(count) for key, name in given.items()
    )
    if not fits or (len(given) != count and not isinstance(labels, Mapping)):
        raise ValueError(
            f"labels must be {count} names, one for each state variable, or a dict "
            f"from numbers 0..{count - 1} to names, got {validation.shown(labels)}."
        )
    return [given.get(i, name) for i, name in enumerate(names)]
