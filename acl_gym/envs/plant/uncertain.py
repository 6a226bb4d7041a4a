"""The parameters of a plant: some are known, of others only a range is."""

from __future__ import annotations

import keyword
from collections import namedtuple
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray


class PlantParameters:
    """Numbers that the dynamics of a plant is given by name, as `p.mass`.

    Args:
        parameters: the nominal value of each by its name; None: there are none.
        uncertain: for some the range (low, high), low < high, from which each episode
            draws a value. What is not in `parameters` as well is nominally in the middle.

    Attributes:
        names: of all.
        nominal: their nominal values, `(k,)`.
        uncertain: for each uncertain one its range.
        drawn: which of all are uncertain, as indices, `(m,)`.
        low: lower ends of their ranges, `(m,)`.
        high: upper ends.

    Raises:
        TypeError: `parameters` or `uncertain` are no dicts, or a value is no number.
        ValueError: a name cannot stand after a dot, a value is not finite, a range is
            empty, or a nominal value is not in its range.
    """

    def __init__(self, parameters: Any = None, uncertain: Any = None) -> None:
        known = {
            name: validation.number(f"parameters[{name!r}]", value)
            for name, value in _by_name("parameters", parameters, "0.1").items()
        }
        self.uncertain = {
            name: _range(name, ends)
            for name, ends in _by_name("uncertain", uncertain, "(0.08, 0.12)").items()
        }
        for name, (low, high) in self.uncertain.items():
            middle = known.setdefault(name, low + 0.5 * (high - low))
            if not low <= middle <= high:
                raise ValueError(
                    f"parameters[{name!r}] must lie in its uncertain range [{low:g}, "
                    f"{high:g}], got {middle:g}; widen the range, or leave the value out."
                )
        self.names = tuple(known)
        self.nominal: FloatArray = np.array(list(known.values()), dtype=np.float64)
        self.drawn: IntArray = np.array(
            [self.names.index(name) for name in self.uncertain], dtype=np.int64
        )
        ends = np.array(list(self.uncertain.values()), dtype=np.float64).reshape(-1, 2)
        self.low: FloatArray = np.ascontiguousarray(ends[:, 0])
        self.high: FloatArray = np.ascontiguousarray(ends[:, 1])

    @property
    def count(self) -> int:
        """How many are uncertain, m."""
        return self.drawn.size

    @property
    def nominal_drawn(self) -> FloatArray:
        """The nominal values of the uncertain ones, `(m,)`."""
        values: FloatArray = self.nominal[self.drawn]
        return values

    def value_of(self, name: str) -> float:
        """The nominal value of one.

        Raises:
            TypeError: there is none of that name.
        """
        if name not in self.names:
            raise TypeError(
                "the parameters of this plant are "
                f"{', '.join(self.names) or 'none'}, got {validation.shown(name)}; name "
                "it in parameters= of acl_gym.plant."
            )
        return float(self.nominal[self.names.index(name)])

    def draw(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Values of the uncertain ones for some plants, uniform, `(m, count)`."""
        span = (self.high - self.low)[:, None]
        return np.asarray(self.low[:, None] + span * rng.random((self.count, count)))

    def of(self, drawn: FloatArray) -> Any:
        """All parameters of some plants by their names.

        Args:
            drawn: values of the uncertain ones, `(m, n)`, or `(m,)` of one plant.

        Returns:
            A named tuple, in which known ones are numbers and uncertain ones read-only
            arrays `(n,)`, or numbers.
        """
        values: list[Any] = self.nominal.tolist()
        for row, i in enumerate(self.drawn):
            value = drawn[row]
            values[i] = validation.read_only(value) if drawn.ndim == 2 else float(value)
        return parameter_tuple(self.names)(*values)

    def for_kernel(self, own: FloatArray) -> tuple[Any, ...]:
        """The further arguments of `kernels.Advance`; `own` are a slot's own, `(m, n)`."""
        return (self.nominal, self.drawn, own) if self.names else ()

    def check_rows(self, rows: FloatArray) -> None:
        """Check given values of the uncertain ones, `(n, m)`.

        Raises:
            ValueError: one lies outside its range.
        """
        outside = (rows < self.low) | (rows > self.high)
        if outside.any():
            row, i = np.argwhere(outside)[0]
            raise ValueError(
                f"{list(self.uncertain)[i]} must lie in its uncertain range "
                f"[{self.low[i]:g}, {self.high[i]:g}], got {rows[row, i]:g} in row "
                f"{row}; widen the range."
            )


@cache
def parameter_tuple(names: tuple[str, ...]) -> Any:
    """The type of the named tuples with these names, the same each time.

    Kernels are compiled for a type, so that plants with equal names share theirs.
    """
    return namedtuple("Parameters", names)


def _by_name(argument: str, values: Any, example: str) -> dict[str, Any]:
    """Values by names that can stand after a dot."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise TypeError(
            f'{argument} must be a dict from names to values, such as {{"mass": '
            f"{example}}}, got {validation.shown(values)}."
        )
    for name in values:
        good = isinstance(name, str) and name.isidentifier()
        if not good or keyword.iskeyword(name) or name.startswith("_"):
            raise ValueError(
                f"names in {argument} must be such that p.name can be written, without "
                f"an underscore at the beginning, got {validation.shown(name)}; rename "
                "it."
            )
    return dict(values)


def _range(name: str, ends: Any) -> tuple[float, float]:
    array = validation.as_array(ends)
    if array is None or array.shape != (2,) or array.dtype.kind not in "iuf":
        raise ValueError(
            f"uncertain[{name!r}] must be a pair (low, high) of numbers, got "
            f"{validation.shown(ends)}; give what is known in parameters=."
        )
    low, high = map(float, array)
    if not (np.isfinite(high - low) and low < high):
        raise ValueError(
            f"uncertain[{name!r}] must be finite with low < high, got "
            f"{validation.shown(ends)}; give what is known in parameters=."
        )
    return low, high
