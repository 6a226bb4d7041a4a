"""The choice model (2.1): its exact law, and colonies that cross the bridge."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from acl_gym.theory import (
    choice_probability,
    crossing_law,
    linear_crossing_law,
    majority_probability,
    simulate_crossings,
)
from acl_gym.theory.crossings import COLONIES_AT_A_TIME, cross

ANTS = (200, 500, 1_000, 2_000, 5_000)


def recursion(n_ants: int, alpha: float, offset: float) -> list[float]:
    """The law of N_A as it is written down, one probability after the other."""
    law = [1.0]
    for n in range(n_ants):
        following = [0.0] * (n + 2)
        for k, probability in enumerate(law):
            a, b = (offset + k) ** alpha, (offset + n - k) ** alpha
            following[k + 1] += probability * a / (a + b)
            following[k] += probability * b / (a + b)
        law = following
    return law


@given(
    st.integers(0, 60),
    st.floats(0.0, 5.0),
    st.floats(0.1, 100.0),
)
def test_the_law_is_the_recursion(n_ants: int, alpha: float, offset: float) -> None:
    expected = recursion(n_ants, alpha, offset)
    found = crossing_law(n_ants, alpha, offset)
    assert np.allclose(found, expected, rtol=1e-10, atol=1e-15)
    assert np.allclose(found, found[::-1], rtol=1e-10), "no branch is preferred"


@pytest.mark.parametrize(
    ("alpha", "n_ants", "printed"),
    [
        *zip([2.0] * 5, ANTS, [0.2244, 0.5183, 0.7186, 0.8486, 0.9369], strict=True),
        (1.5, 1_000, 0.1996),
        (3.0, 1_000, 0.9787),
    ],
)
def test_how_often_one_branch_wins(alpha: float, n_ants: int, printed: float) -> None:
    """C = 20; the printed numbers have four digits."""
    found = majority_probability(crossing_law(n_ants, alpha, 20.0))
    assert round(found, 4) == printed
    if n_ants <= 1_000:  # the reference is slow
        law = recursion(n_ants, alpha, 20.0)
        more = [k for k in range(n_ants + 1) if max(k, n_ants - k) > 0.8 * n_ants]
        assert abs(found - math.fsum(law[k] for k in more)) < 1e-9


@pytest.mark.parametrize("offset", [0.5, 1.0, 20.0])
@pytest.mark.parametrize("n_ants", [1, 2, 37, 2_000])
def test_without_an_exponent_the_law_is_beta_binomial(
    offset: float, n_ants: int
) -> None:
    expected = stats.betabinom(n_ants, offset, offset).pmf(np.arange(n_ants + 1))
    # SciPy's own is a difference of large logarithms.
    for found in (
        crossing_law(n_ants, 1.0, offset),
        linear_crossing_law(n_ants, offset),
    ):
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-300)


def test_its_limit_is_a_beta_law() -> None:
    """The two distribution functions differ by no more than 1 / N or so."""
    n_ants = 20_000
    shares = np.arange(n_ants + 1) / n_ants
    found = np.cumsum(linear_crossing_law(n_ants, 20.0))
    assert np.abs(found - stats.beta(20, 20).cdf(shares)).max() < 10 / n_ants


def test_laws_of_no_ant_and_of_one() -> None:
    for law in (crossing_law, linear_crossing_law):
        assert law(0).tolist() == [1.0]
        assert law(1).tolist() == [0.5, 0.5]
    assert np.allclose(crossing_law(4, alpha=0.0), np.array([1, 4, 6, 4, 1]) / 16)


@pytest.mark.parametrize(
    ("share", "expected"), [(0.5, 2 / 3), (0.57, 2 / 3), (0.75, 0.0), (0.999, 0.0)]
)
def test_more_than_a_share_is_not_as_much(share: float, expected: float) -> None:
    """In 1 - 2 - 1 of four ants, and 57 of 100: 0.57 x 100 is less as a float."""
    law = np.array([0.0, 1.0, 1.0, 1.0, 0.0]) / 3
    assert majority_probability(law, share) == pytest.approx(expected)
    sharp = np.zeros(101)
    sharp[57] = 1.0
    assert majority_probability(sharp, 0.57) == 0.0
    assert majority_probability(sharp, 0.56) == 1.0


def test_the_choice_is_that_of_the_thesis() -> None:
    assert choice_probability(0, 0) == 0.5
    assert choice_probability(20, 0) == pytest.approx(40**2 / (40**2 + 20**2))
    a, b = np.arange(4.0)[:, None], np.arange(5.0)
    found = choice_probability(a, b, 1.5, 3.0)
    assert found.shape == (4, 5)
    assert np.allclose(found + choice_probability(b, a, 1.5, 3.0), 1.0)
    assert choice_probability(0, 1e9, 1e6, 1.0) == 0.0
    assert choice_probability(1e9, 0, 1e6, 1.0) == 1.0


# Simulation


def one_colony(
    uniforms: np.ndarray, alpha: float, offset: float, times: Any, opens: float
) -> np.ndarray:
    """The choices of a colony, event by event; an ant arrives at each end each second."""
    clock = np.repeat(np.arange(len(uniforms) // 2 + 1), 2)[: len(uniforms)]
    chosen: list[int] = []
    for ant, now in enumerate(clock):
        counts = [0, 0]
        for earlier, branch in enumerate(chosen):
            counts[branch] += clock[earlier] + times[branch] <= now
        a, b = ((offset + count) ** alpha for count in counts)
        first = now >= opens and uniforms[ant] < a / (a + b)
        chosen.append(0 if first else 1)
    return np.array(chosen) == 0


@pytest.mark.parametrize(
    ("times", "opens"),
    [
        ((0.0, 0.0), 0.0),
        ((5.0, 7.0), 0.0),
        ((5.0, 5.0), 0.0),
        ((2.5, 9.3), 0.0),
        ((0.0, 30.0), 0.0),
        ((4.0, 8.0), 6.0),
        ((4.0, 8.0), 6.5),
        ((4.0, 8.0), 500.0),
    ],
)
def test_colonies_do_what_one_does_event_by_event(times: Any, opens: float) -> None:
    n_ants, n_colonies, seed = 61, 7, 3
    record = np.arange(1, n_ants + 1)
    found = simulate_crossings(
        n_ants,
        n_colonies,
        alpha=2.0,
        offset=3.0,
        crossing_times=times,
        ants_per_second=1.0,
        opens_after=opens,
        record=record,
        seed=seed,
    )
    uniforms = np.random.default_rng(seed).random((n_ants, n_colonies))
    for colony in range(n_colonies):
        expected = one_colony(uniforms[:, colony], 2.0, 3.0, times, opens)
        assert found[colony].tolist() == np.cumsum(expected).tolist()


def test_the_kernel_runs_the_same_without_the_compiler() -> None:
    rng = np.random.default_rng(0)
    ant = np.arange(30)
    arguments = (
        rng.random((30, 3)),
        (5.0 + np.arange(31)) ** 2,
        np.stack([np.maximum(ant - 2, 0), np.maximum(ant - 5, 0)], axis=1),
        4,
        np.array([1, 10, 30]),
    )
    results = []
    for run in (cross, cross.py_func):
        on_a, recorded = np.empty((30, 3), np.bool_), np.empty((3, 3), np.int64)
        run(*arguments, on_a, recorded)
        results.append([on_a.tobytes(), recorded.tobytes()])
    assert results[0] == results[1]


@pytest.mark.parametrize("alpha", [1.0, 2.0])
def test_simulated_colonies_have_the_exact_law(alpha: float) -> None:
    """A chi-squared test over 20 classes, at a level of 1e-4."""
    n_ants, n_colonies = 300, 20_000
    found = simulate_crossings(n_ants, n_colonies, alpha=alpha, seed=11)
    law = crossing_law(n_ants, alpha)
    # Classes of about the same probability.
    classes = np.minimum((np.cumsum(law) * 20).astype(int), 19)
    expected = n_colonies * np.bincount(classes, law, minlength=20)
    counted = np.bincount(classes[found], minlength=20)
    assert expected.min() > 100
    assert stats.chisquare(counted, expected, sum_check=False).pvalue > 1e-4


@pytest.mark.parametrize(("ratio", "short"), [(1.4, 0.69), (2.0, 0.95)])
def test_more_colonies_choose_the_short_branch_the_longer_the_other(
    ratio: float, short: float
) -> None:
    """More than 80% of the second thousand ants take it; 20 s for the short one.

    The numbers are rounded ones, so 0.02 beside them is right; the standard error of
    4,000 colonies is 0.007 and 0.004.
    """
    times = (20.0, 20.0 * ratio)
    found = simulate_crossings(
        2_000, 4_000, crossing_times=times, record=[1_000, 2_000], seed=5
    )
    share = (found[:, 1] - found[:, 0]) / 1_000
    assert abs((share > 0.8).mean() - short) < 0.02
    assert (share > 0.8).mean() > 4 * (share < 0.2).mean()


def test_counted_at_the_start_the_lengths_make_no_difference() -> None:
    same = {"n_ants": 400, "n_colonies": 50, "seed": 2}
    short = simulate_crossings(**same, crossing_times=(20, 60), counted="start")
    assert short.tolist() == simulate_crossings(**same).tolist()
    late = simulate_crossings(**same, crossing_times=(20, 60))
    assert late.mean() > short.mean() + 50


def test_a_short_branch_that_comes_late_is_not_taken() -> None:
    """It is opened after 300 ants have crossed the long one; not one colony of 2,000
    changes over, and fewer than three ants in a thousand try."""
    found = simulate_crossings(
        2_300,
        2_000,
        crossing_times=(20.0, 40.0),
        opens_after=300.0,
        record=[300, 2_300],
        seed=0,
    )
    assert (found[:, 0] == 0).all()
    assert found[:, 1].max() < 0.2 * 2_000
    assert 0 < found[:, 1].mean() < 6


def test_record_and_seeds() -> None:
    more = COLONIES_AT_A_TIME + 3  # a block that is full and one that is not
    every = simulate_crossings(20, more, record=np.arange(1, 21), seed=4)
    assert every.shape == (more, 20)
    assert np.isin(np.diff(every, axis=1), (0, 1)).all()
    last = simulate_crossings(20, more, seed=4)
    assert last.tolist() == every[:, -1].tolist()
    assert last.tolist() != simulate_crossings(20, more, seed=5).tolist()
    some = simulate_crossings(20, more, record=[3, 20], seed=np.int64(4))
    assert some.tolist() == every[:, [2, 19]].tolist()


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"n_ants": 0}, ValueError, "n_ants must be at least 1"),
        ({"n_ants": 2.0}, TypeError, "n_ants must be an integer"),
        ({"n_ants": 10**14}, ValueError, "use fewer"),
        ({"n_colonies": 0}, ValueError, "n_colonies must be at least 1"),
        ({"alpha": -0.1}, ValueError, r"alpha must lie in \[0, inf\)"),
        ({"alpha": 1e4}, ValueError, "alpha must leave numbers that a float can hold"),
        ({"alpha": math.nan}, ValueError, "alpha"),
        ({"offset": 0.0}, ValueError, r"offset must lie in \(0, inf\)"),
        ({"crossing_times": (1.0,)}, ValueError, "crossing_times must be two numbers"),
        ({"crossing_times": 3}, ValueError, "crossing_times must be two numbers"),
        ({"crossing_times": (1, -1)}, ValueError, r"crossing_times\[1\]"),
        ({"crossing_times": (1, math.inf)}, ValueError, r"crossing_times\[1\]"),
        ({"counted": "middle"}, ValueError, "counted must be one of 'end', 'start'"),
        ({"ants_per_second": 0}, ValueError, "ants_per_second"),
        ({"opens_after": -1.0}, ValueError, "opens_after"),
        ({"record": []}, ValueError, r"record must be integers of 1\.\.10"),
        ({"record": [0, 3]}, ValueError, "record must be integers"),
        ({"record": [3, 11]}, ValueError, "record must be integers"),
        ({"record": [3, 3]}, ValueError, "increasing"),
        ({"record": [1.0, 2.0]}, ValueError, "record must be integers"),
        ({"record": 5}, ValueError, "record must be integers"),
        ({"record": "all"}, ValueError, "record must be integers"),
        ({"seed": -1}, ValueError, "seed"),
        ({"seed": 1.5}, TypeError, "seed"),
    ],
)
def test_bad_arguments_are_refused(
    arguments: dict[str, Any], error: Any, message: str
) -> None:
    with pytest.raises(error, match=message):
        simulate_crossings(**{"n_ants": 10, "n_colonies": 2, **arguments})


@pytest.mark.parametrize("extreme", [1e-300, 1e300])
def test_extreme_times_are_as_good_as_none_or_endless(extreme: float) -> None:
    for times, rate in (((extreme, extreme), 1.0), ((1.0, 1.0), extreme)):
        found = simulate_crossings(
            10, 5, crossing_times=times, ants_per_second=rate, seed=1
        )
        assert ((found >= 0) & (found <= 10)).all()
    closed = simulate_crossings(10, 5, opens_after=1e300, ants_per_second=1e300)
    assert not closed.any()


@pytest.mark.parametrize(
    ("law", "share", "message"),
    [
        ([], 0.8, "law must be an array"),
        ([1.0], 0.8, "N >= 1"),
        ([0.5, 0.6], 0.8, "sum to 1"),
        ([[0.5, 0.5]], 0.8, "law must hold"),
        ([-0.5, 1.5], 0.8, "law must lie in"),
        ([0.5, 0.5], 0.4, "share must lie in"),
        ([0.5, 0.5], 1.0, "share must lie in"),
    ],
)
def test_bad_laws_are_refused(law: Any, share: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        majority_probability(law, share)


def test_laws_refuse_what_is_out_of_range() -> None:
    for law in (crossing_law, linear_crossing_law):
        with pytest.raises(ValueError, match="n_ants must be at least 0"):
            law(-1)
        with pytest.raises(ValueError, match="offset"):
            law(3, offset=0.0)
    with pytest.raises(ValueError, match="crossed must lie in"):
        choice_probability(-1, 0)


def test_a_law_that_fits_into_no_memory_is_refused() -> None:
    for law in (crossing_law, linear_crossing_law):
        with pytest.raises(ValueError, match="10,000,000,000,000 ants must fit into"):
            law(10**13)
