"""The update rules of chapter 2: their equations, what they remember, what they refuse."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import ACL, Crisp, WaitingVectorEnv
from acl_gym.colony.ant_kernels import LEAST_LEVEL, branching_factor
from acl_gym.colony.ant_rule import AntRule
from acl_gym.colony.ant_rules import (
    AntColonySystemUpdate,
    AntSystemUpdate,
    MaxMinUpdate,
)
from acl_gym.colony.candidates import NONE
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.tours import Tours
from acl_gym.colony.update_rule import TrialResult
from acl_gym.colony.update_rules import as_update, update_from_settings
from acl_gym.partitions import Discrete
from acl_gym.utils.serialization import to_settings
from tests.agents.reference_colony import chains
from tests.colony import reference_ants as reference

Array = np.ndarray
RULES = [AntSystemUpdate(), AntColonySystemUpdate(), MaxMinUpdate()]


class Trial(NamedTuple):
    """The tours of a trial, distances and levels."""

    tours: Array
    distances: Array
    tau: Array
    rho: float
    symmetric: bool

    @property
    def costs(self) -> Array:
        return np.array(
            [reference.length(t, self.distances) for t in self.tours.tolist()]
        )

    @property
    def best(self) -> int:
        return int(self.costs.argmin())

    def result(self, complete: Sequence[bool] | None = None) -> TrialResult:
        """As of a colony that builds tours."""
        solutions = Tours(*self.tours.shape)
        solutions.tours[:] = self.tours
        return self._result(solutions, complete)

    def walked(self, complete: Sequence[bool] | None = None) -> TrialResult:
        """As of a colony whose ants walk."""
        m, n = self.tours.shape
        solutions = Solutions(m, n, n, Discrete(n))
        for t in range(n):
            index = self.tours[:, [t]]
            actions = self.tours[:, (t + 1) % n].astype(np.int64)
            solutions.append(np.arange(m), index, index, actions)
        return self._result(solutions, complete)

    def _result(self, solutions: Any, complete: Sequence[bool] | None) -> TrialResult:
        ends = (
            np.ones(len(self.tours), np.bool_)
            if complete is None
            else np.array(complete)
        )
        deposits = np.where(ends, 1.0 / self.costs, 0.0)
        return TrialResult(solutions, self.costs, deposits, ends)

    def pheromone(self) -> Pheromone:
        pheromone = Pheromone(*self.tau.shape, 0.5, 1.0)
        pheromone.set_levels(self.tau)
        pheromone.stale[:] = False
        return pheromone


def trial_of(
    seed: int, n: int = 6, m: int = 4, symmetric: bool = True, rho: float = 0.3
) -> Trial:
    rng = np.random.default_rng(seed)
    distances, tau = rng.random((n, n)) + 0.1, rng.random((n, n)) + 0.01
    if symmetric:
        distances, tau = distances + distances.T, tau + tau.T
    tours = np.stack([rng.permutation(n) for _ in range(m)]).astype(np.int32)
    return Trial(tours, distances, tau, rho, symmetric)


trials = st.builds(
    trial_of,
    seed=st.integers(0, 2**32),
    n=st.integers(2, 8),
    m=st.integers(1, 6),
    symmetric=st.booleans(),
    rho=st.floats(0.01, 1.0),
)


def updated(rule: AntRule, trial: Trial, walked: bool = False) -> Array:
    pheromone = trial.pheromone()
    result = trial.walked() if walked else trial.result()
    rule.global_update(pheromone, result, 0.1, trial.rho)
    return pheromone.levels


@given(trials, st.booleans(), st.sampled_from(["trial", "trial-best", "best-so-far"]))
@settings(max_examples=60, deadline=None)
def test_ant_system_is_its_equations(
    trial: Trial, walked: bool, update_set: str
) -> None:
    rule = AntSystemUpdate(update_set, symmetric=trial.symmetric)
    solutions = trial.tours.tolist()
    fitness = (1.0 / trial.costs).tolist()
    if update_set != "trial":
        solutions, fitness = [solutions[trial.best]], [fitness[trial.best]]
    expected = reference.ant_system(
        trial.tau, solutions, fitness, trial.rho, trial.symmetric
    )
    expected = np.maximum(expected, LEAST_LEVEL)
    np.testing.assert_allclose(updated(rule, trial, walked), expected, rtol=1e-12)


def test_best_so_far_deposits_though_a_later_trial_is_worse() -> None:
    """Two trials; only the first one's best tour, which stays the best, deposits twice."""
    first, second = trial_of(0), trial_of(1)
    second = second._replace(distances=second.distances + 10.0)
    rule, pheromone = AntSystemUpdate("best-so-far", symmetric=True), first.pheromone()
    expected = first.tau
    for trial in (first, second):
        rule.global_update(pheromone, trial.result(), 0.0, first.rho)
        tour, fitness = first.tours[first.best].tolist(), 1.0 / first.costs.min()
        expected = reference.ant_system(expected, [tour], [fitness], first.rho, True)
    np.testing.assert_allclose(pheromone.levels, expected, rtol=1e-12)
    assert rule.best.cost == first.costs.min()


@given(trials, st.sampled_from([0.5, 3.0]))
@settings(max_examples=30, deadline=None)
def test_elitists_add_to_the_best_so_far(trial: Trial, elitists: float) -> None:
    rule = AntSystemUpdate(elitists=elitists, symmetric=trial.symmetric)
    solutions, fitness = trial.tours.tolist(), (1.0 / trial.costs).tolist()
    solutions.append(solutions[trial.best])
    fitness.append(elitists / trial.costs.min())
    expected = reference.ant_system(
        trial.tau, solutions, fitness, trial.rho, trial.symmetric
    )
    expected = np.maximum(expected, LEAST_LEVEL)
    np.testing.assert_allclose(updated(rule, trial), expected, rtol=1e-12)


@given(trials, st.integers(1, 7))
@settings(max_examples=30, deadline=None)
def test_ranks_weigh_the_best_ants(trial: Trial, ranks: int) -> None:
    """The r-th best deposits w - r times its fitness, the best so far w times."""
    rule = AntSystemUpdate(ranks=ranks, symmetric=trial.symmetric)
    solutions, fitness = [trial.tours[trial.best].tolist()], [ranks / trial.costs.min()]
    order = sorted(range(len(trial.tours)), key=lambda ant: (trial.costs[ant], ant))
    for r, ant in enumerate(order[: ranks - 1], start=1):
        solutions.append(trial.tours[ant].tolist())
        fitness.append((ranks - r) / trial.costs[ant])
    expected = reference.ant_system(
        trial.tau, solutions, fitness, trial.rho, trial.symmetric
    )
    expected = np.maximum(expected, LEAST_LEVEL)
    np.testing.assert_allclose(updated(rule, trial), expected, rtol=1e-12)


@given(trials.filter(lambda trial: trial.tau.shape[0] > 2), st.booleans())
@settings(max_examples=60, deadline=None)
def test_ant_colony_system_is_its_equations(trial: Trial, walked: bool) -> None:
    rule = AntColonySystemUpdate(symmetric=trial.symmetric)
    tour, fitness = trial.tours[trial.best].tolist(), 1.0 / trial.costs.min()
    expected = reference.ant_colony_system(
        trial.tau, tour, fitness, trial.rho, trial.symmetric
    )
    pheromone = trial.pheromone()
    result = trial.walked() if walked else trial.result()
    rule.global_update(pheromone, result, 0.1, trial.rho)
    np.testing.assert_allclose(pheromone.levels, expected, rtol=1e-12)
    changed = (pheromone.levels != trial.tau).any(axis=1)
    assert pheromone.stale[changed].all()


def test_ant_colony_system_with_the_best_of_each_trial() -> None:
    first, second = trial_of(0), trial_of(1)
    rule, pheromone = AntColonySystemUpdate(update_set="trial-best"), first.pheromone()
    expected = first.tau
    for trial in (first, second):
        rule.global_update(pheromone, trial.result(), 0.1, 0.2)
        tour, fitness = trial.tours[trial.best].tolist(), 1.0 / trial.costs.min()
        expected = reference.ant_colony_system(expected, tour, fitness, 0.2, False)
    np.testing.assert_allclose(pheromone.levels, expected, rtol=1e-12)


@given(trials.filter(lambda trial: trial.tau.shape[0] > 4), st.floats(0.001, 0.9))
@settings(max_examples=60, deadline=None)
def test_max_min_is_one_deposit_within_limits(trial: Trial, p_best: float) -> None:
    n = len(trial.tau)
    rule = MaxMinUpdate(p_best=p_best, symmetric=trial.symmetric)
    tour, fitness = trial.tours[trial.best].tolist(), 1.0 / trial.costs.min()
    least, most = reference.limits(fitness, trial.rho, n, n, p_best)
    least = min(least, most)
    expected = reference.ant_system(
        trial.tau, [tour], [fitness], trial.rho, trial.symmetric
    )
    # Evaporation stops at tau_min already, before the deposit.
    floor = (
        reference.ant_system(
            np.full_like(trial.tau, least / (1 - trial.rho)),
            [tour],
            [fitness],
            trial.rho,
            trial.symmetric,
        )
        if trial.rho < 1
        else least + reference.deposits(tour, fitness, n, trial.symmetric)
    )
    expected = np.clip(np.maximum(expected, floor), least, most)
    np.testing.assert_allclose(updated(rule, trial), expected, rtol=1e-10)
    assert rule.limits(n, n, trial.rho) == pytest.approx((least, most), rel=1e-12)


def test_limits_by_hand() -> None:
    """n = 10 cities, all choices: avg - 1 = 4; with local search 1 / (2 n) of tau_max."""
    trial = trial_of(2, n=10, rho=0.02)
    rule = MaxMinUpdate()
    updated(rule, trial)
    p = 0.05**0.1
    most = 1.0 / trial.costs.min() / 0.02
    assert rule.limits(10, 10, 0.02) == pytest.approx((most * (1 - p) / (4 * p), most))
    rule.p_best = None
    assert rule.limits(10, 10, 0.02) == pytest.approx((most / 20, most))
    rule.p_best = 0.05  # of a solution that is no tour it is not known what was left
    assert rule.limits(10, 4, 0.02) == pytest.approx((most / 20, most))


@pytest.mark.parametrize("n", [2, 3])
def test_limits_of_the_smallest_tours_are_in_order(n: int) -> None:
    """With three choices or fewer the formula for tau_min has no meaning."""
    rule = MaxMinUpdate()
    levels = updated(rule, trial_of(0, n=n))
    least, most = rule.limits(n, n, 0.3)
    assert 0.0 < least <= most
    assert (levels >= least).all()
    assert (levels <= most).all()


def converged(n: int = 6) -> tuple[Trial, Pheromone]:
    """A trial in which all ants go round in the order of the cities, and nothing else."""
    trial = trial_of(0, n=n)._replace(
        tours=np.tile(np.arange(n, dtype=np.int32), (4, 1))
    )
    pheromone = trial.pheromone()
    pheromone.levels[:] = 1e-6
    for i, j in reference.arcs(range(n)):
        pheromone.levels[i, j] = pheromone.levels[j, i] = 1.0
    return trial, pheromone


@pytest.mark.parametrize("smoothing", [0.0, 0.4, 1.0])
def test_levels_are_moved_towards_tau_max_where_ants_have_converged(
    smoothing: float,
) -> None:
    trial, pheromone = converged()
    rule = MaxMinUpdate(smoothing=smoothing, patience=0, symmetric=True)
    still, plain = MaxMinUpdate(smoothing=0.0, symmetric=True), trial.pheromone()
    plain.set_levels(pheromone.levels)
    for _ in range(2):  # in the second trial there is no better solution
        rule.global_update(pheromone, trial.result(), 0.0, 0.3)
        still.global_update(plain, trial.result(), 0.0, 0.3)
    _, most = rule.limits(6, 6, 0.3)
    expected = plain.levels + smoothing * (most - plain.levels)
    np.testing.assert_allclose(pheromone.levels, expected, rtol=1e-12)
    assert rule.restarts == (smoothing > 0.0)
    assert rule.since_restart.found == (smoothing < 1.0)


def test_restarts_wait_for_patience() -> None:
    trial, pheromone = converged()
    rule = MaxMinUpdate(patience=3, symmetric=True)
    found = []
    for _ in range(9):
        rule.global_update(pheromone, trial.result(), 0.0, 0.9)
        found.append(rule.restarts)
    # In trial 5, the fourth without a better solution, and not before trial 10 again.
    assert found == [0, 0, 0, 0, 1, 1, 1, 1, 1]


def test_mixed_schedule_takes_the_best_since_the_restart_ever_more_often() -> None:
    """u of Stützle and Hoos: 25, 5, 3, 2, 1; once it is old, the best of all."""
    n = 6
    good, bad = trial_of(0, m=1), trial_of(1, m=1)
    bad = bad._replace(distances=bad.distances + 10.0)
    rule = MaxMinUpdate("mixed", smoothing=0.0)
    rule.global_update(good.pheromone(), good.result(), 0.0, 0.1)
    took_best = []
    for _ in range(2, 302):
        pheromone = bad.pheromone()
        pheromone.levels[:] = 1e-9
        rule.global_update(pheromone, bad.result(), 0.0, 0.1)
        added = reference.deposits(good.tours[0].tolist(), 1.0, n, False) > 0
        took_best.append(bool((pheromone.levels[added] > pheromone.levels.min()).all()))
    trials_with_best = 2 + np.flatnonzero(took_best)
    expected = [
        25,
        *range(30, 76, 5),
        *range(78, 126, 3),
        *range(126, 251, 2),
        *range(251, 302),
    ]
    assert trials_with_best.tolist() == expected


@pytest.mark.parametrize("rule", RULES)
def test_only_complete_solutions_count(rule: AntRule) -> None:
    """The best ant was stopped before the end; the second best is the best."""
    trial = trial_of(5)
    complete = np.ones(len(trial.tours), np.bool_)
    complete[trial.best] = False
    rest = trial._replace(tours=np.delete(trial.tours, trial.best, axis=0))
    expected = updated(as_rule(rule), rest)
    own, pheromone = as_rule(rule), trial.pheromone()
    own.global_update(pheromone, trial.result(complete), 0.1, trial.rho)
    np.testing.assert_allclose(pheromone.levels, expected, rtol=1e-12)
    assert own.best.cost == rest.costs.min()


@pytest.mark.parametrize("rule", RULES)
def test_without_a_complete_solution_nothing_is_deposited(rule: AntRule) -> None:
    trial, own = trial_of(5), as_rule(rule)
    pheromone = trial.pheromone()
    own.global_update(pheromone, trial.walked([False] * len(trial.tours)), 0.1, 0.3)
    kept = 1.0 if isinstance(own, AntColonySystemUpdate) else 0.7
    np.testing.assert_allclose(pheromone.levels, kept * trial.tau, rtol=1e-12)
    assert not own.best.found


@pytest.mark.parametrize("rule", RULES)
def test_a_component_counts_once_in_a_solution(rule: AntRule) -> None:
    """One ant goes 0 -> 1 -> 0 -> 1 -> 2: (2.4) asks whether a component is in s."""
    cells, actions = [0, 1, 0, 1], [1, 0, 1, 2]
    solutions = Solutions(1, 9, 3, Discrete(3))
    for cell, action in zip(cells, actions, strict=True):
        index = np.array([[cell]], np.int32)
        solutions.append(np.zeros(1, np.int64), index, index, np.array([action]))
    result = TrialResult(solutions, np.array([4.0]), np.array([0.25]), np.array([True]))
    pheromone, own = Pheromone(3, 3, 0.01, 1.0), as_rule(rule)
    own.global_update(pheromone, result, 0.0, 0.5)
    visited = pheromone.levels[[0, 1, 1], [1, 0, 2]]
    assert (visited == visited[0]).all()
    assert (visited > 0.05).all()
    assert own.best.cells.tolist() == [0, 1, 1]
    assert own.best.actions.tolist() == [1, 0, 2]


def test_levels_do_not_vanish() -> None:
    """0.5^1000 is 1e-301; after some more trials it would be 0."""
    trial, rule = trial_of(0, m=1), AntSystemUpdate()
    pheromone = trial.pheromone()
    for _ in range(2_000):
        rule.global_update(pheromone, trial.result(), 0.0, 0.5)
    assert pheromone.levels.min() == LEAST_LEVEL


@given(trials, st.floats(0.0, 1.0))
@settings(max_examples=30, deadline=None)
def test_branching_factor_counts_levels_above_the_cutoff(
    trial: Trial, share: float
) -> None:
    n = len(trial.tau)
    everywhere = [range(n)] * n
    found = branching_factor(trial.tau, NONE, np.arange(n), share)
    assert found == pytest.approx(reference.branching(trial.tau, everywhere, share))
    lists = np.sort(
        np.random.default_rng(n).permuted(np.tile(np.arange(n), (n, 1)), axis=1)[:, :2]
    )
    found = branching_factor(trial.tau, lists.astype(np.int32), np.arange(n), share)
    assert found == pytest.approx(reference.branching(trial.tau, lists.tolist(), share))


def test_branching_factor_of_converged_ants_is_two() -> None:
    levels = converged()[1].levels
    assert branching_factor(levels, NONE, np.arange(6)) == 2.0
    levels[0] = 1.0  # all of it counts, but only where the cell does
    assert branching_factor(levels, NONE, np.arange(1, 6)) == 2.0
    assert branching_factor(levels, NONE, np.arange(1)) == 6.0


@pytest.mark.parametrize("rule", RULES)
def test_what_rules_remember_is_all_that_they_need(rule: AntRule) -> None:
    trials = [trial_of(seed) for seed in range(4)]
    one, other = as_rule(rule), as_rule(rule)
    pheromone = trials[0].pheromone()
    for trial in trials[:2]:
        one.global_update(pheromone, trial.result(), 0.0, 0.3)
    other.restore({name: array.copy() for name, array in one.memory().items()})
    copied = trials[0].pheromone()
    copied.set_levels(pheromone.levels)
    for trial in trials[2:]:
        one.global_update(pheromone, trial.result(), 0.0, 0.3)
        other.global_update(copied, trial.result(), 0.0, 0.3)
    np.testing.assert_array_equal(pheromone.levels, copied.levels)


@pytest.mark.parametrize(
    ("name", "value"), [("cells", 6), ("cells", -1), ("actions", 6)]
)
def test_a_remembered_solution_outside_the_table_is_refused(
    name: str, value: int
) -> None:
    """Kernels do not check indices, and a file may hold anything."""
    trial, rule = trial_of(0), AntSystemUpdate("best-so-far")
    pheromone = trial.pheromone()
    rule.global_update(pheromone, trial.result(), 0.0, 0.3)
    memory = rule.memory()
    memory[f"best_{name}"] = memory[f"best_{name}"].copy()
    memory[f"best_{name}"][2] = value
    damaged = AntSystemUpdate("best-so-far")
    damaged.restore(memory)
    with pytest.raises(ValueError, match=r"best solution must lie in 0\.\.5"):
        damaged.global_update(pheromone, trial.result(), 0.0, 0.3)


@pytest.mark.parametrize("rule", RULES)
def test_files_hold_rules(rule: AntRule, tmp_path: Path) -> None:
    found = update_from_settings(to_settings(rule))
    assert found == rule
    grid = Crisp([np.arange(6.0)])
    colony = ACL(chains(20), grid, update=rule, tau0=1e-3, max_steps=30, seed=3)
    colony.learn(trials=3)
    loaded = ACL.load(colony.save(tmp_path / "colony"), chains(20))
    colony.learn(trials=2)
    loaded.learn(trials=2)
    np.testing.assert_array_equal(colony.table, loaded.table)
    assert isinstance(loaded.update, type(rule))
    assert loaded.update.best.cost == 1.0  # from the cell beside the goal


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        (AntSystemUpdate, {"update_set": "iteration"}, "update_set must be one of"),
        (AntSystemUpdate, {"elitists": -1}, r"elitists must lie in \[0, inf\)"),
        (AntSystemUpdate, {"ranks": 3, "elitists": 2}, "ranks must stand alone"),
        (AntSystemUpdate, {"ranks": 3, "update_set": "trial-best"}, "must stand alone"),
        (AntColonySystemUpdate, {"q0": 1.2}, r"q0 must lie in \[0, 1\]"),
        (AntColonySystemUpdate, {"update_set": "trial"}, "update_set must be one of"),
        (MaxMinUpdate, {"update_set": "trial"}, "update_set must be one of"),
        (MaxMinUpdate, {"p_best": 1.0}, r"p_best must lie in \(0, 1\)"),
        (MaxMinUpdate, {"smoothing": 2}, r"smoothing must lie in \[0, 1\]"),
        (MaxMinUpdate, {"patience": -1}, "patience must be at least 0"),
    ],
)
def test_parameters_out_of_range(
    kind: type, parameters: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        kind(**parameters)


def test_symmetric_needs_a_square_table() -> None:
    with pytest.raises(TypeError, match="symmetric must be True or False"):
        AntSystemUpdate(symmetric=1)  # type: ignore[arg-type]
    colony = ACL(
        gym.make_vec("acl_gym/GridSearch1D-v0", num_envs=4),
        update=AntSystemUpdate(symmetric=True),
        tau0=1e-6,
        max_steps=40,
    )
    with pytest.raises(ValueError, match="symmetric needs an action for each cell"):
        colony.learn(trials=1)


class Wide(gym.Env[Any, Any]):
    """Two states and far more actions, each of which ends the episode."""

    observation_space = spaces.Discrete(2)
    action_space = spaces.Discrete(50_000)

    def reset(self, **kwargs: Any) -> tuple[int, dict[str, Any]]:
        super().reset(**kwargs)
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        return 1, -1.0, True, False, {}


@pytest.mark.parametrize("rule", [AntSystemUpdate, AntColonySystemUpdate, MaxMinUpdate])
def test_no_kernel_sees_a_table_that_does_not_fit(rule: type[Any]) -> None:
    """A local update would write beyond it before the trial has ended."""
    env = WaitingVectorEnv([Wide] * 3)
    colony = ACL(env, update=rule(symmetric=True), tau0=0.1, max_steps=5)
    with pytest.raises(ValueError, match="symmetric needs an action for each cell"):
        colony.learn(trials=1)
    wrong = rule()
    wrong.candidates = np.full((2, 3), 50_000, np.int32)
    colony = ACL(env, update=wrong, tau0=0.1, max_steps=5)
    with pytest.raises(ValueError, match="candidates must be int32 numbers of actions"):
        colony.learn(trials=1)


def as_rule(rule: AntRule) -> Any:
    """A rule of its own."""
    return as_update(rule)
