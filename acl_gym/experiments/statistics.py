"""The statistics of all experiments: estimates over runs with bootstrap intervals.

A run that never reaches the target counts as infinite, and so may an estimate or the end
of its interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray

RESAMPLES = 9_999
CONFIDENCE = 0.95

Statistic = Callable[..., Any]

_NEVER = 1e100
"""Stands for infinity in the bootstrap, where a difference of infinities would be NaN."""

_HUGE = math.sqrt(_NEVER)


class Estimate(NamedTuple):
    """An estimate with its 95% percentile-bootstrap interval; NaN where there is none."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """For instance 1.23 [1.1, 1.4]."""
        if math.isnan(self.low):
            return digits(self.value)
        return f"{digits(self.value)} [{digits(self.low)}, {digits(self.high)}]"

    def as_json(self, name: str = "value") -> dict[str, float | None]:
        """JSON types: None stands for infinity, and for an interval that is not there."""
        values = {name: self.value, "low": self.low, "high": self.high}
        return {
            name: value if math.isfinite(value) else None
            for name, value in values.items()
        }


def iqm(values: ArrayLike, axis: int = -1) -> Any:
    """The interquartile mean: the mean of the middle half of the values."""
    return stats.trim_mean(values, 0.25, axis=axis)


def median(values: ArrayLike, axis: int = -1) -> Any:
    """The median."""
    return np.median(np.asarray(values), axis=axis)


def estimate(values: ArrayLike, statistic: Statistic = iqm) -> Estimate:
    """Estimate a statistic of runs.

    Args:
        values: one a run, `(runs,)`, at least one; infinity is allowed.
        statistic: of an array along an axis, such as `iqm` or `median`.

    Returns:
        The estimate; without an interval where there is one run.
    """
    return _bootstrapped((values,), statistic)


def ratio(first: ArrayLike, second: ArrayLike, statistic: Statistic = iqm) -> Estimate:
    """How many times the statistic of some runs is that of others.

    The bootstrap is stratified: the runs of each study are drawn separately.

    Args:
        first: one value a run, `(runs,)`.
        second: the same for another study, > 0.
        statistic: see `estimate`.
    """

    def of_both(x: FloatArray, y: FloatArray, axis: int = -1) -> Any:
        return statistic(x, axis=axis) / statistic(y, axis=axis)

    return _bootstrapped((first, second), of_both)


def _bootstrapped(samples: tuple[ArrayLike, ...], statistic: Statistic) -> Estimate:
    data = tuple(np.minimum(np.asarray(s, dtype=np.float64), _NEVER) for s in samples)
    value = float(statistic(*data))
    low = high = math.nan
    if all(each.size > 1 for each in data):
        low, high = stats.bootstrap(
            data,
            statistic,
            n_resamples=RESAMPLES,
            confidence_level=CONFIDENCE,
            method="percentile",
            vectorized=True,
            # Anew for each estimate, so that none depends on which others are made.
            rng=np.random.default_rng(0),
        ).confidence_interval
        # Where all runs are equal, rounding may exchange the two.
        low, high = min(low, high), max(low, high)
    return Estimate(*map(_unclipped, (value, float(low), float(high))))


def _unclipped(value: float) -> float:
    """Undo what stands for infinity; an average with an infinite part is infinite."""
    if abs(value) > _HUGE:
        return math.copysign(math.inf, value)
    return 0.0 if 0.0 < abs(value) < 1.0 / _HUGE else value


def rank_correlation(x: ArrayLike, y: ArrayLike) -> float:
    """Spearman's, from -1 to 1; 0 if either is constant."""
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0
    return float(stats.spearmanr(x, y).statistic)


def interquartile_range(values: FloatArray) -> float:
    """The width of the middle half."""
    low, high = np.quantile(values, [0.25, 0.75])
    return float(high - low)
