"""The pieces of a state variable, within which a policy is looked up once."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.partitions import Grid
from acl_gym.utils.typing import FloatArray

Pieces = tuple[FloatArray, float | None]
"""Edges of a variable, and its period or None."""

_LIMIT = 1e6
"""Observations beyond it are not drawn: the bound stands for none."""

_FINEST = 240
"""Pieces of an axis at most, and where nothing tells how many."""


def of_grid(grid: Grid, space: Any) -> list[Pieces]:
    """Crisp cells as they are, fuzzy ones finely divided."""
    pieces: list[Pieces] = []
    for column, centres, period in zip(
        grid.columns, grid.centres, grid.periods, strict=True
    ):
        low, high = _ends(centres, period, grid.fuzzy)
        if period is None and isinstance(space, spaces.Box):
            bounds = float(space.low[column]), float(space.high[column])
            if np.abs(bounds).max() < _LIMIT and bounds[0] < bounds[1]:
                low, high = bounds
        if grid.fuzzy and centres.size > 1:
            edges = np.linspace(low, high, min(4 * centres.size, _FINEST) + 1)
        else:
            last = [] if period is None else [centres[0] + period]
            inner = np.append(centres, last)
            borders = 0.5 * (inner[1:] + inner[:-1])
            inside = borders[(borders > low) & (borders < high)]
            edges = np.concatenate([[low], inside, [high]])
        pieces.append((edges, period))
    return pieces


def _ends(
    centres: FloatArray, period: float | None, fuzzy: bool
) -> tuple[float, float]:
    low, high = float(centres[0]), float(centres[-1])
    if period is not None:
        return low, low + period
    if centres.size == 1:
        return low - 0.5, high + 0.5
    if fuzzy:
        return low, high
    # The outermost bins reach as far beyond their centres as within.
    gaps = np.diff(centres)
    return low - 0.5 * float(gaps[0]), high + 0.5 * float(gaps[-1])


def of_integers(size: int, start: int) -> Pieces:
    """One piece for each whole number."""
    return start - 0.5 + np.arange(size + 1.0), None


def of_bounds(low: Any, high: Any, circular: bool) -> Pieces:
    """A variable of which only the bounds are known, finely divided.

    Raises:
        ValueError: it has no bounds.
    """
    if not (np.isfinite([low, high]).all() and max(abs(low), abs(high)) < _LIMIT):
        raise ValueError(
            f"observations must be bounded to be drawn, got bounds {low} and {high}; "
            "draw an agent with a partition."
        )
    period = float(high) - float(low) if circular else None
    return np.linspace(float(low), float(high), _FINEST + 1), period
