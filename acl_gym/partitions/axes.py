"""The centres and periods of the variables of a grid: what they must be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from acl_gym.partitions.base import MOST_CELLS
from acl_gym.utils import validation
from acl_gym.utils.boxes import declared_bounds
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


def spread_centres(
    space: Any, cells: int | Sequence[int], circular: Iterable[int]
) -> tuple[list[FloatArray], list[float | None]]:
    """Spread centres evenly over a Box, see `Grid.from_box`.

    Returns:
        Of each variable the centres, and the period.

    Raises:
        ValueError: the Box is unbounded or not one-dimensional, or `cells` or
            `circular` do not fit it.
    """
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise ValueError(
            f"space must be a one-dimensional Box, got {validation.shown(space)}."
        )
    low, high = declared_bounds(space)
    if not (np.isfinite(low) & np.isfinite(high)).all():
        raise ValueError(
            "space must be bounded in every variable, got "
            f"{validation.shown(space)}; "
            "give the centres of an unbounded variable yourself."
        )
    if isinstance(cells, Integral):
        counts = [cells] * low.size
    else:
        counts = validation.elements(cells) or []
    if len(counts) != low.size:
        raise ValueError(
            f"cells must be an int or {low.size} ints, one a variable, "
            f"got {validation.shown(cells)}."
        )
    round_axes = validation.elements(circular)
    if round_axes is None:
        round_axes = [None]  # which is refused
    for axis in round_axes:
        whole = isinstance(axis, Integral) and not isinstance(axis, bool)
        if not whole or not 0 <= axis < low.size:
            raise ValueError(
                f"circular must hold variables 0..{low.size - 1}, got "
                f"{validation.shown(circular)}."
            )
    centres, periods = [], []
    for axis, count in enumerate(counts):
        validation.integer(f"cells[{axis}]", count, at_least=1, at_most=MOST_CELLS)
        is_round = axis in round_axes
        centres.append(np.linspace(low[axis], high[axis], count, endpoint=not is_round))
        periods.append(float(high[axis] - low[axis]) if is_round else None)
    return centres, periods
