"""A median over seeds with its 95% percentile-bootstrap interval.

A value that a run never reached is infinite. In the results infinity is None, which
JSON knows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

Estimate = dict[str, Any]
"""`median`, `low`, `high`, each None where infinite, and `low` and `high` None also
where there is one value and so no interval."""

RESAMPLES = 9999
FEW_VALUES = 5
"""Up to so many values the interval of their median is their range."""

_NEVER = 1e100  # stands for infinity, of which a difference would be NaN


def estimate(values: Sequence[float], *, seed: int = 0) -> Estimate:
    """Estimate the median.

    Args:
        values: at least one; infinity is allowed.
        seed: of the bootstrap.
    """
    data = np.minimum(np.asarray(values, dtype=np.float64), _NEVER)
    low = high = math.inf
    if data.size > 1:
        low, high = stats.bootstrap(
            (data,),
            np.median,
            n_resamples=RESAMPLES,
            confidence_level=0.95,
            method="percentile",
            rng=np.random.default_rng(seed),
        ).confidence_interval
    ends = {"median": float(np.median(data)), "low": float(low), "high": float(high)}
    # An average with _NEVER in it is infinite too, however small its part.
    return {
        name: value if value < math.sqrt(_NEVER) else None
        for name, value in ends.items()
    }


def or_infinity(value: float | None) -> float:
    """The number that a None in an estimate stands for."""
    return math.inf if value is None else float(value)


def overlap(first: Estimate, second: Estimate) -> bool:
    """Whether two intervals have a point in common; without intervals, False."""
    # Both ends None: one value, or infinite from end to end and nothing to compare.
    if first["low"] is None or second["low"] is None:
        return False
    highs = (or_infinity(first["high"]), or_infinity(second["high"]))
    return bool(max(first["low"], second["low"]) <= min(highs))
