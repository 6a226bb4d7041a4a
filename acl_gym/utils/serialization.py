"""What a file can hold of settings, notes and rows: JSON, and names of a user's own.

Reading a file imports nothing and runs no code of anyone's. So a file holds the settings
of this package's classes, and only the names of a user's own functions and classes: for
these, `from_settings` gives a `Missing`, which says what is to be given again.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from acl_gym.utils import validation

_FORMER_NAMES = {"OwnCost": "FunctionCost", "OwnDeposit": "FunctionDeposit"}
"""What classes were called in older files."""

_PACKAGE = __name__.partition(".")[0]

_TUPLE, _ARRAY = "__tuple__", "__array__"
"""The keys of objects that stand for tuples and arrays, which JSON does not have."""

_DTYPES = {
    np.dtype(name).name
    for name in ("?", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8")
}

_PLAIN = (float, int, str, bool, type(None))

_MOST_BITS = 10_000  # Python reads and writes integers of up to 4,300 digits
_MOST_NUMBERS = 1_000_000
"""Of an array among the settings, which a file holds as text."""

_DEEPEST = 100
"""How many lists and dicts may lie in each other."""


class Savable:
    """Base of the dataclasses that `to_settings` and `from_settings` understand."""


def make_plain(settings: Savable) -> None:
    """Turn NumPy's numbers and arrays in the fields of a dataclass into Python's.

    So they can be compared, hashed and saved, and what is loaded computes with the same
    types. Lists and arrays become tuples.
    """
    for field in fields(settings):  # type: ignore[arg-type]
        value = _plain(getattr(settings, field.name))
        object.__setattr__(settings, field.name, value)  # they are frozen


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        if value.size > _MOST_NUMBERS:
            raise TypeError(
                f"a setting must hold at most {_MOST_NUMBERS:,} numbers, got an array of "
                f"shape {value.shape}; give a function instead."
            )
        value = value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        return tuple(_plain(each) for each in value)
    return value


class Missing:
    """Stands in for an object of a user's own in an agent read from a file.

    Args:
        parameter: what the object was for, such as "cost".
        name: of the function or class, as `own_name` gives it.
    """

    def __init__(self, parameter: str, name: str) -> None:
        self.parameter, self.name = parameter, name

    def __repr__(self) -> str:
        """What it stands in for."""
        return f"<{self.name}, which is not in the file>"

    def error(self) -> ValueError:
        """What to raise where the object is needed."""
        return ValueError(
            f"{self.parameter} was {self.name!r}, which a file cannot hold; set "
            f"agent.{self.parameter} to it, or pass load(path, env, "
            f"{self.parameter}=...), before learning continues."
        )


class Unsaved(Missing):
    """Stands in for something that is called: a function, a cost, a schedule."""

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Report what is missing.

        Raises:
            ValueError: always.
        """
        raise self.error()


def missing_in(value: Any) -> Missing | None:
    """The first `Missing` in a value, such as in the terms of a sum of costs."""
    if isinstance(value, Missing):
        return value
    parts: Iterable[Any] = ()
    if isinstance(value, (list, tuple)):
        parts = value
    elif _is_ours(value):
        parts = (getattr(value, field.name) for field in fields(value))
    return next((found for each in parts if (found := missing_in(each))), None)


def own_name(value: Any) -> str:
    """The module and the qualified name of a function, or of the class of an object."""
    named = value if hasattr(value, "__qualname__") else type(value)
    module = getattr(named, "__module__", None)
    return f"{module}:{named.__qualname__}" if module else str(named.__qualname__)


def to_settings(value: Any) -> Any:
    """JSON that `from_settings` turns into `value` again, or into a `Missing`."""
    if isinstance(value, Missing):
        return {"type": "function", "name": value.name}
    if _is_ours(value):
        return {
            "type": type(value).__name__,
            **{
                field.name: to_settings(getattr(value, field.name))
                for field in fields(value)
            },
        }
    if isinstance(value, (list, tuple)):
        return [to_settings(each) for each in value]
    if isinstance(value, (dict, np.ndarray, np.generic, *_PLAIN)):
        return to_json(value, "a parameter")
    return {"type": "function", "name": own_name(value)}


def _is_ours(value: Any) -> bool:
    """Whether it is of a class of this package, not of a subclass of a user's."""
    package = type(value).__module__.partition(".")[0]
    return isinstance(value, Savable) and package == _PACKAGE


def from_settings(
    parameter: str,
    value: Any,
    kinds: Iterable[type[Savable]],
    stand_in: Callable[[str, str], Any] = Unsaved,
) -> Any:
    """Undo `to_settings`.

    Args:
        parameter: whose value it is, for messages.
        value: what `to_settings` gave.
        kinds: the classes that may occur.
        stand_in: makes a `Missing` from parameter and name.

    Raises:
        ValueError: `value` describes something else.
    """
    if isinstance(value, list):
        return tuple(from_settings(parameter, v, kinds, stand_in) for v in value)
    if not isinstance(value, dict):
        return value
    known: dict[Any, Callable[..., Any]] = {kind.__name__: kind for kind in kinds}
    kind = value.get("type")
    kind = _FORMER_NAMES.get(str(kind), kind)
    if kind == "function":
        return stand_in(parameter, str(value.get("name")))
    if not isinstance(kind, str) or kind not in known:
        raise ValueError(
            f"{parameter} must be one of {sorted(known)}, got "
            f"{validation.shown(value)}."
        )
    arguments = {
        name: from_settings(parameter, each, kinds, stand_in)
        for name, each in value.items()
        if name != "type"
    }
    return known[kind](**arguments)


def to_json(value: Any, where: str, depth: int = 0) -> Any:
    """JSON that `from_json` turns into the same value again.

    Args:
        value: numbers, text, truth values, None, and lists, tuples, arrays and dicts
            with keys of text of those. NumPy's numbers become Python's.
        where: what it is called in messages.
        depth: how many lists and dicts it lies in.

    Raises:
        TypeError: it is something else, or lies too deep.
    """
    if isinstance(value, np.generic) and value.dtype.name in _DTYPES:
        value = value.item()
    if isinstance(value, _PLAIN):
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            raise TypeError(
                f"{where} must be an integer below 2^{_MOST_BITS} to be saved, got one "
                f"of {value.bit_length()} bits; save it as text."
            )
        return value
    if depth > _DEEPEST:
        raise TypeError(
            f"{where:.80}... must not lie more than {_DEEPEST} lists and dicts deep to "
            "be saved; take it apart."
        )
    if isinstance(value, (list, tuple)):
        items = [to_json(v, f"{where}[{i}]", depth + 1) for i, v in enumerate(value)]
        return items if isinstance(value, list) else {_TUPLE: items}
    if isinstance(value, dict):
        for key in value:
            if not isinstance(key, str) or key in (_TUPLE, _ARRAY):
                raise TypeError(
                    f"the keys of {where} must be text other than {_TUPLE!r} and "
                    f"{_ARRAY!r} to be saved, got "
                    f"{validation.shown(key)}; use another key."
                )
        return {k: to_json(v, f"{where}[{k!r}]", depth + 1) for k, v in value.items()}
    if isinstance(value, np.ndarray) and value.dtype.name in _DTYPES:
        little = value.astype(value.dtype.newbyteorder("<"))
        return {
            _ARRAY: base64.b64encode(little.tobytes()).decode(),
            "dtype": value.dtype.name,
            "shape": list(value.shape),
        }
    raise TypeError(
        f"{where} must be numbers, text, None, or lists, arrays and dicts of those to be "
        "saved, got "
        f"{validation.shown(value)} of type {type(value).__name__}; convert it, for "
        "instance with float() or str()."
    )


def from_json(value: Any) -> Any:
    """Undo `to_json`.

    Raises:
        TypeError: it is not what `to_json` gives.
        ValueError: the same.
    """
    if isinstance(value, list):
        return [from_json(each) for each in value]
    if not isinstance(value, dict):
        return value
    if _TUPLE in value:
        return tuple(from_json(each) for each in value[_TUPLE])
    if _ARRAY in value:
        if value["dtype"] not in _DTYPES:
            raise ValueError(f"an array must hold numbers, got {value['dtype']!r:.50}")
        dtype = np.dtype(value["dtype"])
        content = base64.b64decode(value[_ARRAY], validate=True)
        array = np.frombuffer(bytearray(content), dtype.newbyteorder("<"))
        return array.astype(dtype, copy=False).reshape(value["shape"])
    return {name: from_json(each) for name, each in value.items()}


def check_row(row: dict[str, Any], where: str = "row") -> None:
    """Check that a row of measures can be saved; what cannot is taken out of it.

    Raises:
        TypeError: a value cannot be saved; the message names its key.
    """
    for key, value in list(row.items()):
        if type(value) is float and type(key) is str:
            continue
        try:
            to_json({key: value}, where)
        except TypeError:
            del row[key]
            raise
