"""Every formula of `acl_gym.theory` against the text, and against ants that walk."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from acl_gym import ACL, theory
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import choose_actions

rates = st.floats(0.001, 0.999)
ants = st.integers(1, 60)
deposits = st.floats(1e-3, 10.0)
parameters = st.tuples(ants, st.floats(1e-6, 1e-3), rates, rates)


def upper(m: int, tau0: float, gamma: float, rho: float, deposit: float) -> float:
    """(3.27) as it is printed."""
    alpha = (1 - rho) * (1 - gamma)
    beta = (1 - rho) * ((1 - gamma) ** m * (-tau0) + tau0)
    return (beta + rho * m * deposit) / (1 - alpha)


def lower(m: int, tau0: float, gamma: float, rho: float, deposit: float) -> float:
    """(3.28) as it is printed."""
    alpha = (1 - rho) * (1 - gamma) ** m
    beta = (1 - rho) * ((1 - gamma) * (-tau0) + tau0)
    return (beta + rho * deposit) / (1 - alpha)


@given(parameters, deposits, deposits)
def test_bounds_and_gaps_are_those_of_the_text(
    common: tuple[int, float, float, float], best: float, second: float
) -> None:
    high, low = upper(*common, best), lower(*common, best)
    close = {"rel_tol": 1e-9, "abs_tol": 1e-12}
    assert math.isclose(theory.expected_upper_limit(*common, best), high, **close)
    assert math.isclose(theory.level_bound(*common, best), high, **close)
    assert math.isclose(theory.expected_lower_limit(*common, best), low, **close)
    scale = {"rel_tol": 1e-7, "abs_tol": 1e-9 * high}
    assert math.isclose(theory.level_gap(*common, best), high - low, **scale)
    gap = low - upper(*common, second)
    scale["abs_tol"] = 1e-9 * (low + upper(*common, second))
    assert math.isclose(theory.policy_gap(*common, best, second), gap, **scale)


def test_all_broadcast() -> None:
    m, rho = np.array([1, 2, 5])[:, None], np.array([0.1, 0.5, 1.0, 0.2])
    found = theory.policy_gap(m, 1e-3, 0.1, rho, 1.0, 0.5)
    assert found.shape == (3, 4)
    for i in range(3):
        for j in range(4):
            one = theory.policy_gap(int(m[i, 0]), 1e-3, 0.1, rho[j], 1.0, 0.5)
            assert found[i, j] == one


@given(
    parameters,
    st.floats(1e-6, 2.0),
    st.integers(0, 60),
    st.floats(0.0, 3.0),
)
def test_the_total_update_is_the_local_ones_and_the_global_one(
    common: tuple[int, float, float, float], level: float, visits: int, deposit: float
) -> None:
    """(3.11) visit by visit, then (3.14); without a visit (3.17)."""
    _, tau0, gamma, rho = common
    local = level
    for _ in range(visits):
        local = (1 - gamma) * local + gamma * tau0
    expected = (1 - rho) * local + rho * deposit if visits else level
    found = theory.total_update(level, visits, deposit, tau0, gamma, rho)
    assert math.isclose(found, expected, rel_tol=1e-9)


@given(parameters, deposits, st.integers(0, 30))
def test_the_band_is_its_recursion(
    common: tuple[int, float, float, float], deposit: float, count: int
) -> None:
    m, tau0, gamma, rho = common
    low, high = theory.expected_band(count, *common, deposit)
    assert low.shape == high.shape == (count + 1,)
    a, b = tau0, tau0
    for kappa in range(count + 1):
        assert math.isclose(low[kappa], a, rel_tol=1e-8)
        assert math.isclose(high[kappa], b, rel_tol=1e-8)
        a = (1 - rho) * ((1 - gamma) ** m * a + gamma * tau0) + rho * deposit
        b = (1 - rho) * (
            (1 - gamma) * b + (1 - (1 - gamma) ** m) * tau0
        ) + rho * m * deposit


# Special cases of §3.4.7 and §3.4.8 against the general formulas.

SMALL, NEAR_ONE = 1e-9, 1 - 1e-9


@given(parameters, deposits, deposits)
def test_one_ant(
    common: tuple[int, float, float, float], best: float, second: float
) -> None:
    _, tau0, gamma, rho = common
    assert abs(theory.level_gap(1, tau0, gamma, rho, best)) < 1e-9 * best / rho
    limit = theory.one_ant_limit(tau0, gamma, rho, best)
    assert math.isclose(limit, upper(1, tau0, gamma, rho, best), rel_tol=1e-9)
    gap = theory.policy_gap_of_one_ant(gamma, rho, best, second)
    general = theory.policy_gap(1, tau0, gamma, rho, best, second)
    assert math.isclose(gap, general, rel_tol=1e-6, abs_tol=1e-9 * (best + second))


@pytest.mark.parametrize("m", [1, 2, 7, 50])
@pytest.mark.parametrize(("gamma", "rho"), [(0.0, 0.3), (0.0, 1.0), (0.4, 1.0)])
def test_without_local_or_with_full_global_update(
    m: int, gamma: float, rho: float
) -> None:
    general = theory.level_gap(m, 1e-3, gamma, rho, 0.8)
    assert general == pytest.approx(theory.level_gap_without_local_update(m, 0.8))
    general = theory.policy_gap(m, 1e-3, gamma, rho, 0.8, 0.3)
    special = theory.policy_gap_without_local_update(m, 0.8, 0.3)
    assert general == pytest.approx(special)


@pytest.mark.parametrize("m", [1, 2, 7, 50])
def test_full_local_update(m: int) -> None:
    general = theory.level_gap(m, 1e-3, NEAR_ONE, 0.3, 0.8)
    special = theory.level_gap_with_full_local_update(m, 0.3, 0.8)
    assert general == pytest.approx(special, abs=1e-8)
    general = theory.policy_gap(m, 1e-3, NEAR_ONE, 0.3, 0.8, 0.3)
    special = theory.policy_gap_with_full_local_update(m, 0.3, 0.8, 0.3)
    assert general == pytest.approx(special, abs=1e-8)


@pytest.mark.parametrize("m", [1, 2, 7, 50])
def test_without_global_update(m: int) -> None:
    general = theory.level_gap(m, 1e-3, 0.2, SMALL, 0.8)
    special = theory.level_gap_without_global_update(m, 1e-3, 0.2)
    assert general == pytest.approx(special, abs=1e-6)
    assert special >= -1e-18
    general = theory.policy_gap(m, 1e-3, 0.2, SMALL, 0.8, 0.3)
    assert general == pytest.approx(
        theory.policy_gap_without_global_update(m, 1e-3, 0.2), abs=1e-6
    )


def test_infinitely_many_ants_without_global_update() -> None:
    gap = theory.level_gap_without_global_update(math.inf, 1e-3, 0.2)
    assert gap == pytest.approx(1e-3 / 0.2 * (1 - 0.2**2))
    assert theory.level_gap_without_global_update(500, 1e-3, 0.2) == pytest.approx(gap)


@given(deposits, deposits, ants)
def test_more_ants_than_the_most_make_the_gap_negative(
    best: float, second: float, m: int
) -> None:
    gap = theory.policy_gap_without_local_update(m, best, second)
    most = theory.most_ants(best, second)
    assume(not math.isclose(m, most, rel_tol=1e-9))
    assert (gap < 0) == (m > most)


# §2.6


def test_the_bound_on_levels_is_where_they_go() -> None:
    """Propositions 2.2 and 2.3: tau <- (1 - rho) tau + F, again and again."""
    level, rho, fitness = 0.1, 0.2, 3.0
    bound = theory.aco_level_limit(fitness, rho)
    for _ in range(300):
        level = (1 - rho) * level + fitness
        assert level <= bound * (1 + 1e-12)
    assert level == pytest.approx(bound)


def test_no_choice_is_less_probable() -> None:
    found = theory.least_probability(0.5, 2.0, [1, 2, 4], 2.0)
    expected = [0.5**2 / ((n - 1) * 2.0**2 + 0.5**2) for n in (1, 2, 4)]
    assert found == pytest.approx(expected)


@given(st.floats(0.05, 1.0), st.integers(1, 4), st.floats(0.001, 1.0))
def test_after_so_many_trials_the_optimum_was_found(
    probability: float, length: int, failure: float
) -> None:
    chance = probability**length
    found = float(theory.trials_to_find(probability, length, failure))
    assert found == int(found)
    assert (1 - chance) ** found <= failure * (1 + 1e-9)
    if found >= 1:
        assert (1 - chance) ** (found - 1) >= failure * (1 - 1e-9)


def test_a_chance_that_underflows_takes_for_ever() -> None:
    assert theory.trials_to_find(1e-9, 1000, 0.5) == math.inf


@pytest.mark.parametrize("rho", [0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 0.77, 1.0])
def test_the_optimum_dominates_where_all_edges_evaporate(rho: float) -> None:
    """From the worst case: the others at tau_max, the optimum at (almost) nothing."""
    fitness, k0 = 1.0, int(theory.trials_to_dominate(rho))
    assert k0 == math.ceil(round((1 - rho) / rho, 9))
    best, other = 0.0, fitness / rho
    for _ in range(k0 + 1):
        best, other = (1 - rho) * best + fitness, (1 - rho) * other
    assert best > other
    # As the proof has it, the others keep their level, and are never exceeded.
    for _ in range(10_000):
        best = (1 - rho) * best + fitness
    assert best <= fitness / rho * (1 + 1e-12)


def test_probabilities_of_section_3_4_4() -> None:
    assert theory.action_probability_bound(0.1, 4) == pytest.approx(0.025)
    assert theory.state_probability_bound(10) == pytest.approx(0.1)
    assert theory.pair_probability_bound(0.1, 4, 10) == pytest.approx(0.0025)


def test_lemmas() -> None:
    assert theory.recursion_limit(0.5, 1.0) == 2.0
    assert theory.recursion_rises(0.5, 1.0, 2.0)
    assert not theory.recursion_rises(0.5, 1.0, 2.1)


def test_the_expected_deposit_averages_deposits() -> None:
    found = theory.expected_deposit(0.3, [1.0, 0.5, 0.25])
    assert found == pytest.approx(0.7 * 1.0 + 0.3 * 1.75 / 3)
    assert theory.tau0_bound(200.0, 0.1) == pytest.approx(5e-4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: theory.level_gap(0, 1e-3, 0.1, 0.1, 1.0), "n_ants must lie in"),
        (lambda: theory.level_gap(2, 0.0, 0.1, 0.1, 1.0), "tau0 must lie in"),
        (lambda: theory.level_gap(2, 1e-3, 1.0, 0.1, 1.0), r"local_decay .* \[0, 1\)"),
        (lambda: theory.level_gap(2, 1e-3, 0.1, 0.0, 1.0), r"global_decay .* \(0, 1\]"),
        (lambda: theory.level_gap(2, 1e-3, 0.1, 1.1, 1.0), "global_decay must lie in"),
        (lambda: theory.level_gap(2, 1e-3, 0.1, 0.1, -1), "expected_deposit must lie"),
        (lambda: theory.level_gap(2, 1e-3, 0.1, 0.1, np.nan), "expected_deposit must"),
        (lambda: theory.expected_deposit(0.1, 1.0), "one entry for each action"),
        (lambda: theory.least_probability(2.0, 1.0, 2, 1), "must not be smaller"),
        (lambda: theory.recursion_limit(1.0, 1.0), r"a must lie in \(-1, 1\)"),
        (lambda: theory.trials_to_find(0.0, 1, 0.1), "probability must lie in"),
    ],
)
def test_what_is_out_of_range(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


# Ants on the system of Figure 3.2.

COSTS = (1.0, 2.0, 4.0)
TAU0 = 1e-2


def levels_of_q(m: int, gamma: float, rho: float, epsilon: float, seed: int) -> Any:
    """The level of the one pair of q after each of 120 trials."""
    env = gym.make_vec("acl_gym/TwoState-v0", num_envs=m, costs=COSTS)
    found = []
    ACL(
        env,
        seed=seed,
        tau0=TAU0,
        max_steps=2,
        selection="epsilon_greedy",
        epsilon=epsilon,
        local_decay=gamma,
        global_decay=rho,
    ).learn(trials=120, callback=lambda c, _: found.append(c.pheromone.levels[0, 0]))
    return found


@pytest.mark.parametrize("m", [1, 4])
def test_simulated_means_lie_within_the_bounds(m: int) -> None:
    gamma, rho, epsilon = 0.1, 0.2, 0.2
    runs = np.array([levels_of_q(m, gamma, rho, epsilon, seed) for seed in range(40)])
    common = (m, TAU0, gamma, rho)
    assert runs.min() >= TAU0
    assert runs.max() <= theory.level_bound(*common, 1.0 / COSTS[0]) + 1e-12
    deposit = theory.expected_deposit(epsilon, 1.0 / np.array(COSTS))
    low, high = theory.expected_band(120, *common, deposit)
    late = runs[:, 60:]
    noise = 3 * late.mean(axis=1).std(ddof=1) / math.sqrt(len(runs))
    assert low[-1] - noise <= late.mean() <= high[-1] + noise
    if m == 1:
        limit = theory.one_ant_limit(TAU0, gamma, rho, deposit)
        assert late.mean() == pytest.approx(float(limit), abs=noise)


@pytest.mark.parametrize(("gamma", "rho"), [(0.1, 0.1), (0.4, 0.2), (0.02, 0.7)])
def test_between_the_special_cases_fewer_ants_are_allowed(
    gamma: float, rho: float
) -> None:
    """For small tau0: M (1 - alpha_lower) / (1 - alpha_upper) below the ratio."""
    m, tau0 = 2, 1e-12
    low = theory.lower_coefficients(m, tau0, gamma, rho).alpha
    high = theory.upper_coefficients(m, tau0, gamma, rho).alpha
    needed = float(m * (1 - low) / (1 - high))
    assert needed > m
    for ratio, sign in ((needed * 1.001, 1.0), (needed * 0.999, -1.0)):
        assert m < theory.most_ants(ratio, 1.0), "(3.32) allows so many"
        gap = theory.policy_gap(m, tau0, gamma, rho, ratio, 1.0)
        assert np.sign(gap) == sign


def test_ants_choose_no_less_often_than_that() -> None:
    """Proposition 3.1 and p_min of Theorem 2.4, against ants that choose."""
    rng, count, epsilon = np.random.default_rng(6), 40_000, 0.2
    pheromone = Pheromone(1, 4, 0.1, 2.0)
    pheromone.set_levels(np.array([[0.1, 0.7, 0.7, 0.7]]))  # the worst case
    index, degree = np.zeros((count, 1), dtype=np.int32), np.ones((count, 1))
    for rule, bound in (
        ("epsilon_greedy", theory.action_probability_bound(epsilon, 4)),
        ("boltzmann", theory.least_probability(0.1, 0.7, 4, 2.0)),
    ):
        actions = choose_actions(rule, pheromone, index, degree, epsilon, rng)
        found, expected = (actions == 0).mean(), float(bound)
        noise = 4 * math.sqrt(expected / count)
        assert found == pytest.approx(expected, abs=noise), "a bound that is met"


def test_states_and_pairs_are_visited_no_less_often_than_that() -> None:
    """Proposition 3.2 and Corollary 3.3, by one ant on the row of nine free cells."""
    env = gym.make_vec("acl_gym/GridSearch1D-v0", num_envs=1)
    settings = {"selection": "epsilon_greedy", "epsilon": 0.4, "max_steps": 30}
    colony = ACL(env, seed=1, tau0=1e-3, local_decay=0.0, **settings)
    seen, states_seen = np.zeros((10, 2)), np.zeros(10)

    def count(agent: Any, row: Any) -> None:
        for pair in set(visited):
            seen[pair] += 1
        for state in {state for state, _ in visited}:
            states_seen[state] += 1
        visited.clear()

    visited: list[tuple[int, int]] = []
    choose = colony._choose

    def watch(index: Any, *rest: Any) -> Any:
        actions = choose(index, *rest)
        visited.append((int(index[0, 0]), int(actions[0])))
        return actions

    colony._choose = watch  # type: ignore[method-assign]
    trials = 3000
    colony.learn(trials=trials, callback=count)
    pairs, states = seen[:9] / trials, states_seen[:9] / trials
    for found, bound in (
        (states.min(), theory.state_probability_bound(9)),
        (pairs.min(), theory.pair_probability_bound(0.4, 2, 9)),
    ):
        assert found >= bound - 4 * math.sqrt(float(bound) / trials)
