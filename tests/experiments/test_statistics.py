"""Estimates and their intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats

from acl_gym.experiments.statistics import (
    digits,
    estimate,
    interquartile_range,
    iqm,
    median,
    rank_correlation,
    ratio,
)

RUNS = np.array([3.0, 1.0, 4.0, 1.5, 9.0, 2.6, 5.3, 5.8])


def test_the_interquartile_mean_is_that_of_the_middle_half() -> None:
    assert iqm(RUNS) == pytest.approx(np.mean([2.6, 3.0, 4.0, 5.3]))


@pytest.mark.parametrize("statistic", [iqm, median])
def test_the_interval_is_the_percentile_bootstrap(statistic) -> None:
    runs = np.random.default_rng(0).lognormal(size=60)
    found = estimate(runs, statistic)
    rng = np.random.default_rng(1)
    drawn = statistic(runs[rng.integers(runs.size, size=(40_000, runs.size))])
    low, high = np.quantile(drawn, [0.025, 0.975])
    assert found.value == statistic(runs)
    assert found.low == pytest.approx(low, rel=0.05)
    assert found.high == pytest.approx(high, rel=0.05)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.1, 100.0), min_size=2, max_size=12))
@example([21.426984281791853] * 3)  # rounding once exchanged the two ends
def test_the_interval_holds_the_range_of_the_runs(values: list[float]) -> None:
    found = estimate(values)
    assert min(values) - 1e-9 <= found.low <= found.high <= max(values) + 1e-9
    assert estimate(values) == found, "the same runs, the same interval"


def test_one_run_has_no_interval() -> None:
    found = estimate([2.5])
    assert found.value == 2.5
    assert math.isnan(found.low)
    assert math.isnan(found.high)
    assert str(found) == "2.5"
    assert found.as_json() == {"value": 2.5, "low": None, "high": None}


def test_what_never_happened_is_infinite() -> None:
    some = estimate([1.0, 2.0, 3.0, math.inf], median)
    assert some.value == 2.5
    assert some.high == math.inf
    assert some.as_json("median")["high"] is None
    assert estimate([1.0, math.inf, math.inf], median).value == math.inf


def test_a_ratio_draws_the_runs_of_each_separately() -> None:
    found = ratio(2.0 * RUNS, RUNS)
    assert found.value == pytest.approx(2.0)
    alone = estimate(RUNS)
    assert found.low < 2.0 * alone.low / alone.value * 1.2
    assert found.low < 2.0 < found.high, "the runs are not paired"
    assert ratio([math.inf] * 3, [1.0, 2.0, 3.0]).value == math.inf
    assert ratio([1.0, 2.0, 3.0], [math.inf] * 3).value == 0.0


def test_small_ones() -> None:
    assert digits(2594.3) == "2590"
    assert digits(0.012345) == "0.0123"
    assert rank_correlation([1, 2, 3], [5, 5, 5]) == 0.0
    expected = stats.spearmanr([1, 2, 3, 4], [1, 3, 2, 4]).statistic
    assert rank_correlation([1, 2, 3, 4], [1, 3, 2, 4]) == pytest.approx(expected)
    assert interquartile_range(np.arange(5.0)) == 2.0
