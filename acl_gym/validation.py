"""Checks of arguments: each failure is one error with expected, actual and remedy."""

from __future__ import annotations

import math
from collections.abc import Collection
from numbers import Integral, Real
from typing import Any


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
    result = float(value)
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


def one_of(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return `value` if it is one of the `allowed` strings.

    Raises:
        ValueError: it is not.
    """
    if value not in allowed:
        choices = ", ".join(repr(choice) for choice in allowed)
        raise ValueError(f"{name} must be one of {choices}, got {value!r}.")
    return str(value)
