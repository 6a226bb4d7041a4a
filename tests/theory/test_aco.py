"""§2.6: what is proven of an Ant System with a lower limit, and what its colonies do."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.theory import (
    aco_level_limit,
    least_probability,
    probability_found,
    simulate_limited_ants,
    trials_to_dominate,
    trials_to_find,
)
from acl_gym.theory.limited_ants import one_trial

SIX = np.random.default_rng(3).integers(1, 100, (6, 6)).astype(float)
"""Six cities with one shortest tour, 155; no tour is longer than 500."""

THREE = np.array([[0.0, 1.0, 2.0], [2.0, 0.0, 1.0], [1.0, 2.0, 0.0]])
"""Three cities with two tours, 0-1-2 of length 3 and 0-2-1 of length 6."""

BELOW_ALL = 1.0 / 600.0
"""An initial level for `SIX` as Assumption 2.1 wants it: less than any fitness."""


def tours(distances: np.ndarray) -> dict[tuple[int, ...], float]:
    """All tours from city 0, and their lengths."""
    n = len(distances)
    found = {}
    for rest in itertools.permutations(range(1, n)):
        tour = (0, *rest)
        arcs = zip(tour, (*rest, 0), strict=True)
        found[tour] = math.fsum(distances[i, j] for i, j in arcs)
    return found


def reference(
    distances: np.ndarray, uniforms: np.ndarray, settings: dict[str, Any]
) -> tuple[list[np.ndarray], list[float]]:
    """The levels and the best length of one colony after each trial.

    Args:
        distances: `(n, n)`.
        uniforms: `(n_trials, n_ants, n)`.
        settings: rho, tau_min, tau0, alpha, all_evaporate.
    """
    n = len(distances)
    levels = np.full((n, n), settings["tau0"])
    best, shortest = [], math.inf
    history, lengths = [levels.copy()], []
    for trial in uniforms:
        for ant in trial:
            tour: list[int] = []
            # The kernel swaps the chosen city with the first of those that are left.
            left = list(range(n))
            for step in range(n):
                weights = [
                    1.0 if step == 0 else levels[tour[-1], j] ** settings["alpha"]
                    for j in left
                ]
                sums = list(itertools.accumulate(weights))
                drawn = ant[step] * sums[-1]
                at = next(i for i, total in enumerate(sums) if total > drawn)
                left[0], left[at] = left[at], left[0]
                tour.append(left.pop(0))
            arcs = list(zip(tour, tour[1:] + tour[:1], strict=True))
            length = sum(distances[i, j] for i, j in arcs)
            if length < shortest - 1e-9:
                best, shortest = arcs, length
        if settings["all_evaporate"]:
            levels *= 1 - settings["rho"]
        for i, j in best:
            if not settings["all_evaporate"]:
                levels[i, j] *= 1 - settings["rho"]
            levels[i, j] += 1 / shortest
        levels = np.maximum(levels, settings["tau_min"])
        history.append(levels.copy())
        lengths.append(shortest)
    return history, lengths


@pytest.mark.parametrize("evaporation", ["all", "tour"])
@pytest.mark.parametrize(("alpha", "n_ants"), [(1.0, 1), (2.0, 3), (0.0, 2)])
def test_colonies_do_what_is_written_down(
    evaporation: str, alpha: float, n_ants: int
) -> None:
    n_colonies, n_trials, seed = 4, 30, 5
    given: dict[str, Any] = {"global_decay": 0.3, "tau_min": 5e-4, "alpha": alpha}
    found = simulate_limited_ants(
        SIX, n_colonies, n_trials, n_ants=n_ants, tau0=2e-3,
        evaporation=evaporation, seed=seed, **given,
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    uniforms = np.stack([rng.random((n_colonies, n_ants, 6)) for _ in range(n_trials)])
    all_tours = tours(SIX)
    shortest = min(all_tours.values())
    assert found.fitness == pytest.approx(1 / shortest)
    off = ~np.eye(6, dtype=bool)
    for colony in range(n_colonies):
        levels, lengths = reference(
            SIX,
            uniforms[:, colony],
            {
                "rho": 0.3,
                "tau_min": 5e-4,
                "tau0": 2e-3,
                "alpha": alpha,
                "all_evaporate": evaporation == "all",
            },
        )
        highest = [level[off].max() for level in levels]
        assert np.allclose(found.highest[:, colony], highest, rtol=1e-12)
        optimal = [length <= shortest + 1e-9 for length in lengths]
        first = optimal.index(True) + 1 if any(optimal) else 0
        assert found.first_optimum[colony] == first
        there = ~np.isnan(found.on_optimum[:, colony])
        assert there.tolist() == [False, *optimal]
        best = min(all_tours, key=all_tours.__getitem__)
        on = np.zeros((6, 6), dtype=bool)
        on[best, np.roll(best, -1)] = True
        for trial in np.flatnonzero(there):
            lowest, other = levels[trial][on].min(), levels[trial][off & ~on].max()
            assert found.on_optimum[trial, colony] == pytest.approx(lowest, rel=1e-12)
            assert found.elsewhere[trial, colony] == pytest.approx(other, rel=1e-12)


@pytest.mark.parametrize("all_evaporate", [True, False])
def test_the_kernel_runs_the_same_without_the_compiler(all_evaporate: bool) -> None:
    uniforms = np.random.default_rng(1).random((2, 3, 6))
    results = []
    for run in (one_trial, one_trial.py_func):
        levels = np.full((2, 6, 6), 1e-3)
        tour, length = np.zeros((2, 6), np.int64), np.full(2, np.inf)
        run(SIX, levels, uniforms, tour, length, 1.0, 0.2, 5e-4, all_evaporate)
        results.append((levels, tour, length))
    for one, other in zip(*results, strict=True):
        assert np.array_equal(one, other)


@settings(max_examples=25, deadline=None)
@given(
    rho=st.floats(0.01, 0.99),
    share=st.floats(0.0, 1.0),
    n_ants=st.integers(1, 3),
    evaporation=st.sampled_from(["all", "tour"]),
    seed=st.integers(0, 2**32),
)
def test_proposition_2_2_no_level_exceeds_its_bound(
    rho: float, share: float, n_ants: int, evaporation: str, seed: int
) -> None:
    """After no trial, from any initial level up to the bound itself."""
    bound = float(aco_level_limit(1 / 155, rho))
    tau_min = 0.5 * BELOW_ALL
    found = simulate_limited_ants(
        SIX,
        20,
        60,
        n_ants=n_ants,
        global_decay=rho,
        tau_min=tau_min,
        tau0=tau_min + share * (bound - tau_min),
        evaporation=evaporation,
        seed=seed,
    )
    assert found.fitness == pytest.approx(1 / 155)
    assert found.highest.max() <= bound * (1 + 1e-12)
    assert found.highest.min() >= tau_min


def test_from_above_the_bound_levels_come_down_to_it() -> None:
    """Assumption 2.1 is needed, if less of it: tau_0 <= tau_max."""
    bound = float(aco_level_limit(1 / 155, 0.1))
    common = {"global_decay": 0.1, "tau_min": BELOW_ALL, "seed": 0}
    found = simulate_limited_ants(SIX, 10, 400, tau0=3 * bound, **common)
    assert (found.highest[1] > 2.5 * bound).all()
    assert (found.highest[-1] <= bound * (1 + 1e-12)).all()


@pytest.mark.parametrize("evaporation", ["all", "tour"])
@pytest.mark.parametrize("rho", [0.05, 0.3])
def test_proposition_2_3_the_optimum_comes_to_its_limit(
    rho: float, evaporation: str
) -> None:
    """What is missing to tau_max shrinks by 1 - rho in each trial, as (2.7) has it."""
    bound = float(aco_level_limit(1 / 155, rho))
    found = simulate_limited_ants(
        SIX,
        200,
        900,
        n_ants=3,
        global_decay=rho,
        tau_min=BELOW_ALL,
        evaporation=evaporation,
        seed=1,
    )
    missing = bound - found.on_optimum
    assert (found.first_optimum > 0).mean() > 0.5
    for colony in np.flatnonzero(found.first_optimum):
        after = missing[found.first_optimum[colony] :, colony]
        shrunk = after[0] * (1 - rho) ** np.arange(after.size)
        assert np.allclose(after, shrunk, rtol=0, atol=1e-12 * bound * after.size)
        if after.size > 30 / rho:  # (1 - rho)^(30 / rho) < 1e-13
            assert abs(after[-1]) < 1e-12 * bound


def test_theorem_2_4_how_soon_the_optimum_is_found() -> None:
    """Three cities, one ant: the share that has found 0-1-2 is known exactly.

    A colony that has not found it has walked the other tour in every trial, so its levels
    are known. Shares of 20,000 colonies after each of 30 trials are within 5 standard
    errors of it, wrong once in 50,000 seeds, and above the bound of the theorem, which
    says something here: 0.25 after 30 trials.
    """
    rho, tau_min, n_trials, n_colonies = 0.9, 0.1, 30, 20_000
    found = simulate_limited_ants(
        THREE, n_colonies, n_trials, global_decay=rho, tau_min=tau_min, seed=2
    )
    good, bad, missed, exact = tau_min, tau_min, 1.0, []
    for _ in range(n_trials):
        missed *= bad / (good + bad)
        exact.append(1 - missed)
        good = max(tau_min, (1 - rho) * good)
        bad = max(tau_min, (1 - rho) * bad + 1 / 6)
    trials = np.arange(1, n_trials + 1)
    first = found.first_optimum
    share = np.array([((first > 0) & (first <= k)).mean() for k in trials])
    error = np.sqrt(np.multiply(exact, 1 - np.array(exact)) / n_colonies)
    assert (np.abs(share - exact) <= 5 * error).all()
    tau_max = float(aco_level_limit(found.fitness, rho))
    least = float(least_probability(tau_min, tau_max, n_choices=2, alpha=1.0))
    bound = probability_found(least, 3, trials)
    assert (share >= bound).all()
    assert bound[-1] == pytest.approx(0.25, abs=0.005)


def test_theorem_2_4_with_six_cities() -> None:
    """The share of colonies rises to 1, and its bound is far below."""
    rho, n_trials = 0.5, 3_000
    found = simulate_limited_ants(
        SIX, 300, n_trials, global_decay=rho, tau_min=BELOW_ALL, seed=3
    )
    tau_max = float(aco_level_limit(found.fitness, rho))
    least = float(least_probability(BELOW_ALL, tau_max, n_choices=5, alpha=1.0))
    first = np.sort(np.where(found.first_optimum > 0, found.first_optimum, np.inf))
    share = np.arange(1, first.size + 1) / first.size
    assert (share >= probability_found(least, 6, np.minimum(first, n_trials))).all()
    assert share[np.isfinite(first)].max() > 0.99
    assert trials_to_find(least, 6, 0.01) > 1_000 * n_trials


def updates_until_dominant(found: Any) -> tuple[np.ndarray, np.ndarray]:
    """For each colony that found the optimum, how many trials later its levels exceed all
    others for good, and how many trials it had left; infinite if they never do."""
    last = len(found.highest) - 1
    until, left = [], []
    for colony in np.flatnonzero(found.first_optimum):
        first = int(found.first_optimum[colony])
        below = found.on_optimum[first:, colony] <= found.elsewhere[first:, colony]
        behind = np.flatnonzero(below)
        later = behind[-1] + 1 if behind.size else 0
        until.append(math.inf if first + later > last else later)
        left.append(last - first)
    return np.array(until), np.array(left)


@pytest.mark.parametrize("tau0", ["lowest", "highest"])
@pytest.mark.parametrize("rho", [0.02, 0.1, 0.5, 0.8])
def test_theorem_2_5_holds_where_all_levels_evaporate(rho: float, tau0: str) -> None:
    """Also from levels at the bound; it is even sooner, after ln 2 / -ln(1 - rho)."""
    allowed = int(trials_to_dominate(rho))
    bound = float(aco_level_limit(1 / 155, rho))
    found = simulate_limited_ants(
        SIX,
        400,
        400,
        global_decay=rho,
        tau_min=0.2 * BELOW_ALL,
        tau0={"lowest": None, "highest": bound}[tau0],
        seed=4,
    )
    until, left = updates_until_dominant(found)
    enough = left >= allowed
    assert enough.sum() > 50
    assert (until[enough] <= allowed).all()
    sooner = math.floor(math.log(2) / -math.log1p(-rho) + 1e-9)
    assert (until[enough] <= sooner).all()
    # No trial less would do, at least where there is time for levels to rise before.
    if rho >= 0.1 and tau0 == "lowest":
        assert until[enough].max() == (sooner if rho < 0.5 else 0)


@pytest.mark.parametrize("rho", [0.1, 0.5])
def test_theorem_2_5_fails_where_other_levels_remain_the_same(rho: float) -> None:
    """As its proof says they do. Colonies that have followed a nearly optimal tour for
    long need more trials than k_0, because its levels are nearly those of the optimum.
    """
    allowed = int(trials_to_dominate(rho))
    common = {"global_decay": rho, "tau_min": BELOW_ALL, "evaporation": "tour"}
    found = simulate_limited_ants(SIX, 400, 400, **common, seed=5)
    until, left = updates_until_dominant(found)
    enough = left >= 60
    assert enough.sum() > 200
    assert (until[enough] > allowed).mean() > 0.5
    assert np.isfinite(until[enough]).all(), "later than k_0, but surely"
    # A level that starts at tau_max stays there, and nothing exceeds it.
    bound = float(aco_level_limit(found.fitness, rho))
    found = simulate_limited_ants(SIX, 400, 400, **common, tau0=bound, seed=5)
    until, left = updates_until_dominant(found)
    assert np.isinf(until).mean() > 0.95


# Formulas


@given(st.floats(1e-3, 1.0), st.integers(1, 6), st.integers(0, 1_000))
def test_the_probability_is_that_of_the_theorem(
    least: float, length: int, trials: int
) -> None:
    found = probability_found(least, length, trials)
    expected = 1 - (1 - least**length) ** trials
    assert math.isclose(found, expected, rel_tol=1e-6, abs_tol=1e-12)


@given(st.floats(1e-2, 0.99), st.integers(1, 4), st.floats(1e-6, 0.99))
def test_after_so_many_trials_the_probability_is_large_enough(
    least: float, length: int, failure: float
) -> None:
    trials = float(trials_to_find(least, length, failure))
    assert probability_found(least, length, trials) >= (1 - failure) * (1 - 1e-9)
    before = probability_found(least, length, trials - 1)
    assert before <= (1 - failure) * (1 + 1e-9)


def test_the_probability_at_its_ends() -> None:
    found = probability_found([1.0, 1.0, 0.5], 2, [0, 1, 0])
    assert found.tolist() == [0.0, 1.0, 0.0]
    # Where 1 - p^n rounds to 1, the first term of the series is left.
    assert probability_found(1e-5, 4, 1e10) == pytest.approx(1e-10)
    with pytest.raises(ValueError, match="trials must lie in"):
        probability_found(0.5, 2, -1)


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"distances": np.ones((2, 2))}, ValueError, "of 3 to 9 cities"),
        ({"distances": np.ones((10, 10))}, ValueError, "of 3 to 9 cities"),
        ({"distances": np.ones((3, 4))}, ValueError, r"got shape \(3, 4\)"),
        (
            {"distances": np.zeros((3, 3))},
            ValueError,
            r"must lie in \[1e-100, 1e\+100\]",
        ),
        ({"distances": -THREE}, ValueError, r"off the diagonal must lie in"),
        # The sum of four such roads, or one over it, is infinite.
        (
            {"distances": np.full((4, 4), 1e308)},
            ValueError,
            "give them in another unit",
        ),
        (
            {"distances": np.full((4, 4), 1e-320)},
            ValueError,
            "give them in another unit",
        ),
        ({"distances": np.full((3, 3), np.nan)}, ValueError, "distances"),
        ({"distances": "map"}, ValueError, "distances"),
        ({"n_colonies": 0}, ValueError, "n_colonies must be at least 1"),
        ({"n_trials": 0}, ValueError, "n_trials must be at least 1"),
        ({"n_trials": 10**13}, ValueError, "use fewer"),
        ({"n_ants": 0}, ValueError, "n_ants must be at least 1"),
        ({"global_decay": 0.0}, ValueError, "global_decay"),
        ({"global_decay": 1.0}, ValueError, "global_decay"),
        ({"tau_min": 0.0}, ValueError, "tau_min"),
        ({"tau0": 0.05}, ValueError, r"tau0 must lie in \[0.1"),
        ({"alpha": -1.0}, ValueError, "alpha"),
        ({"evaporation": "none"}, ValueError, "evaporation must be one of"),
        ({"seed": -3}, ValueError, "seed"),
    ],
)
def test_bad_arguments_are_refused(
    changed: dict[str, Any], error: Any, message: str
) -> None:
    arguments = {"distances": THREE, "n_colonies": 2, "n_trials": 2, "tau_min": 0.1}
    with pytest.raises(error, match=message):
        simulate_limited_ants(**{**arguments, **changed})


def test_same_seed_same_bits() -> None:
    runs = [
        simulate_limited_ants(SIX, 5, 20, tau_min=1e-3, seed=seed) for seed in (7, 7, 8)
    ]
    assert runs[0].highest.tobytes() == runs[1].highest.tobytes()
    assert runs[0].highest.tobytes() != runs[2].highest.tobytes()


def test_small_levels_do_not_lose_their_weight() -> None:
    """Only relations count: with levels of 1e-200 squared, as with those of 1e-2."""
    distances = np.array([[0, 1, 2, 1], [1, 0, 1, 2], [2, 1, 0, 1], [1, 2, 1, 0.0]])
    found = [
        simulate_limited_ants(
            distances, 2_000, 1, tau_min=level, alpha=2.0, seed=0
        ).first_optimum
        for level in (1e-200, 1e-2)
    ]
    assert 0 < found[1].sum() < 2_000
    np.testing.assert_array_equal(*found)


def test_a_ratio_beyond_all_floats_leaves_a_probability() -> None:
    """An only choice is certain; of two, the weaker one is never taken."""
    found = least_probability(1e-300, 1e300, [1, 2], 2.0)
    np.testing.assert_array_equal(found, [1.0, 0.0])
    with pytest.raises(ValueError, match=r"tau_max must not be .* got 1\.0 and 2\.0"):
        least_probability(2.0, 1.0, 2, 1.0)
