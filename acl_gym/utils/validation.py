"""Checks of arguments: each failure is one error with expected, actual and remedy."""

from __future__ import annotations

import math
from collections.abc import Collection
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray


def number(
    name: str,
    value: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
) -> float:
    """Return `value` as a finite float inside the given range.

    Args:
        name: what the number is called in the error message.
        value: the candidate.
        above: exclusive lower bound.
        at_least: inclusive lower bound.
        at_most: inclusive upper bound.
        below: exclusive upper bound.

    Raises:
        TypeError: `value` is not a real number.
        ValueError: `value` is NaN, infinite or outside the range.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(
            f"{name} must be a real number, got {value!r} of type "
            f"{type(value).__name__}; pass an int or a float."
        )
    try:
        result = float(value)
    except OverflowError:  # an int beyond all floats
        result = math.inf
    inside = (
        math.isfinite(result)
        and (above is None or result > above)
        and (at_least is None or result >= at_least)
        and (at_most is None or result <= at_most)
        and (below is None or result < below)
    )
    if not inside:
        left = f"({above:g}" if above is not None else "(-inf"
        if at_least is not None:
            left = f"[{at_least:g}"
        right = f"{below:g})" if below is not None else "inf)"
        if at_most is not None:
            right = f"{at_most:g}]"
        raise ValueError(f"{name} must lie in {left}, {right}, got {value!r}.")
    return result


class Number:
    """An attribute that is a number in a range, checked whenever it is set.

    Args:
        bounds: the range, keywords of `number`.
    """

    def __init__(self, **bounds: float) -> None:
        self._bounds = bounds

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> float:
        if instance is None:
            raise AttributeError(f"{self._name} is set on instances only.")
        return float(instance.__dict__[self._name])

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self._name] = number(self._name, value, **self._bounds)


def integer(name: str, value: Any, *, at_least: int) -> int:
    """Return `value` as an int of at least `at_least`.

    Raises:
        TypeError: `value` is not an integer.
        ValueError: `value` is too small.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(
            f"{name} must be an integer, got {value!r} of type {type(value).__name__}."
        )
    if value < at_least:
        raise ValueError(f"{name} must be at least {at_least}, got {value}.")
    return int(value)


def real_array(
    name: str, values: Any, *, ndim: int | None = None, finite: bool = True
) -> NDArray[np.float64]:
    """Return `values` as a new float64 array that is not empty.

    Strings, complex numbers and ragged lists are refused, not converted.

    Args:
        name: what the array is called in the error message.
        values: the candidate.
        ndim: how many axes it must have; None allows any number.
        finite: refuse NaN and infinity.

    Raises:
        ValueError: `values` are not such an array.
    """
    try:
        array = np.asarray(values)
    except ValueError:  # ragged
        array = np.empty(0)
    valid = (
        array.dtype.kind in "iuf"
        and array.size > 0
        and ndim in (None, array.ndim)
        and (not finite or bool(np.isfinite(array).all()))
    )
    if not valid:
        kind = "an array" if ndim is None else f"an array of {ndim} axes"
        numbers = "finite real numbers" if finite else "real numbers"
        raise ValueError(f"{name} must be {kind} of {numbers}, got {values!r}.")
    return array.astype(np.float64)


def one_of(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return `value` if it is one of the `allowed` strings.

    Raises:
        ValueError: it is not.
    """
    if value not in allowed:
        choices = ", ".join(repr(choice) for choice in allowed)
        raise ValueError(f"{name} must be one of {choices}, got {value!r}.")
    return str(value)
