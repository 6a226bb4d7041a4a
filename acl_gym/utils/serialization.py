"""Costs, deposits, schedules and update rules as settings that a file can hold.

Reading a file runs no code. So a file holds the settings of this package's classes,
and only the names of a user's own functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

_FORMER_NAMES = {"OwnCost": "FunctionCost", "OwnDeposit": "FunctionDeposit"}
"""What classes were called in older files."""


class Savable:
    """Base of the dataclasses that `to_settings` and `from_settings` understand."""


class Unsaved:
    """Stands in for a user's own function in an agent read from a file.

    Args:
        parameter: what the function was for, such as "cost".
        name: of the function.
    """

    def __init__(self, parameter: str, name: str) -> None:
        self._parameter = parameter
        self.__qualname__ = name

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Report which function is missing.

        Raises:
            ValueError: always.
        """
        raise ValueError(
            f"{self._parameter} was the function {self.__qualname__!r}, which a file "
            f"cannot hold; set agent.{self._parameter} to it before learning continues."
        )


def to_settings(value: Any) -> Any:
    """JSON that `from_settings` turns into `value` again."""
    if isinstance(value, Savable):
        return {
            "type": type(value).__name__,
            **{
                field.name: to_settings(getattr(value, field.name))
                for field in fields(value)  # type: ignore[arg-type]
            },
        }
    if isinstance(value, (list, tuple)):
        return [to_settings(each) for each in value]
    if callable(value):
        name = getattr(value, "__qualname__", type(value).__name__)
        return {"type": "function", "name": name}
    return value


def from_settings(parameter: str, value: Any, kinds: Iterable[type[Savable]]) -> Any:
    """Undo `to_settings`.

    Args:
        parameter: whose value it is, for messages.
        value: what `to_settings` gave.
        kinds: the classes that may occur.

    Raises:
        ValueError: `value` describes something else.
    """
    if isinstance(value, list):
        return tuple(from_settings(parameter, each, kinds) for each in value)
    if not isinstance(value, dict):
        return value
    known: dict[Any, Callable[..., Any]] = {kind.__name__: kind for kind in kinds}
    arguments = {
        name: from_settings(parameter, each, kinds)
        for name, each in value.items()
        if name != "type"
    }
    kind = value.get("type")
    kind = _FORMER_NAMES.get(str(kind), kind)
    if kind == "function":
        return Unsaved(parameter, str(value.get("name")))
    if not isinstance(kind, str) or kind not in known:
        raise ValueError(
            f"{parameter} must be one of {sorted(known)}, got {value!r:.200}."
        )
    return known[kind](**arguments)
