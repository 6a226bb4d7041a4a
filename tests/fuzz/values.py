"""Values that no one should pass, and forms of an array that mean the same or not."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np

VALUES: tuple[Callable[[], Any], ...] = (
    lambda: None,
    lambda: "",
    lambda: "Disabled",
    lambda: b"x",
    lambda: float("nan"),
    lambda: float("inf"),
    lambda: -float("inf"),
    lambda: 1e308,
    lambda: 5e-324,
    lambda: -1,
    lambda: 0,
    lambda: 1,
    lambda: 2,
    lambda: 0.5,
    lambda: 10**12,
    lambda: 10**30,
    lambda: -(10**30),
    lambda: 10**5000,
    lambda: 2.0,
    lambda: 1j,
    lambda: True,
    lambda: np.bool_(True),
    lambda: np.float16(0.5),
    lambda: np.int8(3),
    lambda: np.uint64(2**64 - 1),
    lambda: np.longdouble(2),
    lambda: Fraction(1, 3),
    lambda: Decimal("0.1"),
    lambda: np.datetime64("2020-01-01"),
    list,
    lambda: [[]],
    lambda: [1, [2, 3]],
    lambda: [float("nan")],
    lambda: [0, 1, 2],
    lambda: [[0.0, 1.0], [2.0, 3.0]],
    lambda: (None, None),
    dict,
    lambda: {0: (0, 1)},
    set,
    lambda: range(3),
    lambda: (each for each in (1, 2)),
    object,
    lambda: int,
    lambda: lambda *arguments: None,
    lambda: lambda *arguments: float("nan"),
    lambda: np.empty(0),
    lambda: np.zeros((0, 3)),
    lambda: np.array(3),
    lambda: np.ones(3),
    lambda: np.ones((3, 2)),
    lambda: np.full((4, 3), np.nan),
    lambda: np.ones((2, 2, 2)),
    lambda: np.array([1, None], dtype=object),
    lambda: np.array([1.0, 2.0], dtype=object),
    lambda: np.array(["a", "b"]),
    lambda: np.array(["2020-01-01"], dtype="datetime64[D]"),
    lambda: np.array([1 + 1j, 2]),
    lambda: np.ma.masked_array([1.0, 2.0], [True, False]),
    lambda: np.array([(1, 2.0)], dtype=[("a", int), ("b", float)]),
    lambda: np.broadcast_to(np.float64(1), (10**6, 10**6)),
)
"""What makes hostile values, each call a new one."""


def hostile(rng: np.random.Generator) -> Any:
    """One of the values, at random."""
    return VALUES[rng.integers(len(VALUES))]()


def _read_only(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


def _spread(array: Any) -> Any:
    return np.repeat(array, 2, axis=0)[::2]


SAME: dict[str, Callable[[Any], Any]] = {
    "as it is": lambda array: array,
    "copy": np.array,
    "read-only": _read_only,
    "with gaps": _spread,
    "other byte order": lambda array: array.astype(array.dtype.newbyteorder(">")),
    "list": lambda array: array.tolist(),
    "masked array without mask": np.ma.masked_array,
    "reversed twice": lambda array: array[::-1].copy()[::-1],
}
"""Forms of an array with the same content: taken as they are, or refused."""


def _with(array: Any, value: Any) -> Any:
    changed = array.astype(np.result_type(array.dtype, np.min_scalar_type(value)))
    changed.flat[0] = value
    return changed


WRONG: dict[str, Callable[[Any], Any]] = {
    "first row only": lambda array: array[:1],
    "a row more": lambda array: np.concatenate([array, array[:1]]),
    "a row less": lambda array: array[:-1],
    "no rows": lambda array: array[:0],
    "scalar": lambda array: array.flat[0],
    "complex": lambda array: array + 1j,
    "objects": lambda array: np.full(array.shape, object()),
    "text": lambda array: array.astype(str),
    "dates": lambda array: np.full(array.shape, np.datetime64("2020-01-01")),
    "masked": lambda array: np.ma.masked_array(array, np.ones(array.shape, bool)),
    "two axes more": lambda array: np.stack([np.stack([array, array])] * 2),
    "None": lambda array: None,
    "ragged": lambda array: [[0], [0, 1]],
    "dict": lambda array: {},
}
"""Forms that lack what they should hold, for arrays of two rows or more: refused."""

NOT_FINITE: dict[str, Callable[[Any], Any]] = {
    "nan": lambda array: _with(array, np.nan),
    "inf": lambda array: _with(array, np.inf),
    "-inf": lambda array: _with(array, -np.inf),
}


def choice(rng: np.random.Generator, options: Any) -> Any:
    """A random element of a sequence, or key of a dict."""
    keys = list(options)
    return keys[rng.integers(len(keys))]
