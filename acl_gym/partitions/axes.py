"""The centres and periods of the variables of a grid: what they must be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


def checked_centres(axis: int, values: ArrayLike) -> FloatArray:
    """Return the centres of one variable.

    Raises:
        ValueError: they do not increase strictly, are not finite, or are too close or
            too far apart.
    """
    centres = validation.real_array(f"centres[{axis}]", values, ndim=1)
    with np.errstate(over="ignore", divide="ignore"):
        gaps = np.diff(centres)
        usable = np.isfinite(gaps) & np.isfinite(1.0 / gaps)
    if (falls := np.flatnonzero(gaps <= 0)).size:
        i = int(falls[0])
        raise ValueError(
            f"centres[{axis}] must increase strictly, got {centres[i]:g} followed by "
            f"{centres[i + 1]:g} at position {i}; sort them and drop duplicates."
        )
    if not usable.all():
        raise ValueError(
            f"centres[{axis}] must be further apart than 1e-307 and closer than "
            f"1e307, got {validation.shown(values)}."
        )
    return centres


def checked_periods(
    periods: Sequence[float | None] | None, axes: list[FloatArray]
) -> list[float | None]:
    """Return the periods of variables; None for all means that none is circular.

    Raises:
        ValueError: there are not as many as variables, or one is not positive.
    """
    if periods is None:
        return [None] * len(axes)
    if not isinstance(periods, Sequence) or len(periods) != len(axes):
        raise ValueError(
            f"periods must hold one entry for each of the {len(axes)} variables, "
            f"got {validation.shown(periods)}."
        )
    lengths: list[float | None] = []
    for axis, period in enumerate(periods):
        if period is not None:
            period = validation.number(f"periods[{axis}]", period, above=0)
        lengths.append(period)
    return lengths


def check_spans(axes: Sequence[FloatArray], periods: Sequence[float | None]) -> None:
    """Check that no centres reach around a circle.

    Raises:
        ValueError: those of a circular variable span its period or more.
    """
    for axis, (line, period) in enumerate(zip(axes, periods, strict=True)):
        span = float(line[-1] - line[0])
        if period is not None and span >= period:
            raise ValueError(
                f"centres[{axis}] must span less than their period {period:g}, "
                f"got {span:g}; leave out the centre that repeats the first."
            )


def regular_rate(edges: FloatArray) -> float:
    """Return 1 / spacing where the spacing is constant to rounding, else 0."""
    if edges.size < 2:
        return 0.0
    gaps = np.diff(edges)
    regular = np.allclose(gaps, gaps.mean(), rtol=1e-9, atol=0.0)
    return float(1.0 / gaps.mean()) if regular else 0.0
