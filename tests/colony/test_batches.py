"""Deposits of ants that come back one after the other, in batches of M (§7.3)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.colony import update_kernels
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.update_rule import TrialResult
from acl_gym.colony.update_rules import UPDATE_RULES, Reinforcement
from tests.agents import reference_colony as reference
from tests.colony.test_pheromone import Trial, trials

Array = np.ndarray


def parts_of(seed: int, n_ants: int) -> list[Array]:
    """Who comes back in the same step, in the order of time."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(n_ants)
    cuts = np.flatnonzero(rng.random(n_ants - 1) < 0.6) + 1
    return [np.sort(part) for part in np.split(order, cuts)]


def expected(trial: Trial, parts: list[Array], tau: Array) -> Array:
    """Pair by pair: what evaporates is what is missing to rho times the largest degree."""
    tau, paid = tau.copy(), np.zeros(tau.shape)
    for part in parts:
        unions = [
            reference.indicator(trial.solution(ant), trial.tau.shape) for ant in part
        ]
        largest = np.maximum(np.max(unions, axis=0), paid)
        with np.errstate(invalid="ignore"):
            left = (1 - trial.rho * largest) / (1 - trial.rho * paid)
        left[largest == paid] = 1.0
        laid = sum(u / trial.costs[ant] for u, ant in zip(unions, part, strict=True))
        tau = left * tau + trial.rho * laid
        paid = largest
    return tau


@given(trials(), st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_levels_are_those_of_the_equation(trial: Trial, seed: int) -> None:
    parts, tau = parts_of(seed, len(trial.length)), trial.tau.copy()
    pheromone, solutions = trial.pheromone, trial.packed()
    lay = Reinforcement(tau.size)
    for _ in range(2):  # the second batch begins anew
        before = pheromone.levels.copy()
        for number, part in enumerate(parts):
            deposits, begins = 1.0 / trial.costs[part], number == 0
            lay(pheromone, solutions.of(part), deposits, trial.rho, begins)
        wanted = expected(trial, parts, before)
        np.testing.assert_allclose(pheromone.levels, wanted, rtol=1e-9)


@given(trials())
@settings(max_examples=50)
def test_a_whole_batch_is_a_synchronous_trial_to_the_bit(trial: Trial) -> None:
    tau, deposits = trial.tau.copy(), 1.0 / trial.costs
    levels = []
    for begins in (None, True):
        pheromone = Pheromone(*tau.shape, tau0=trial.pheromone.tau0, alpha=1.0)
        pheromone.set_levels(tau)
        lay = Reinforcement(tau.size)
        lay(pheromone, trial.packed(), deposits, trial.rho, begins)
        levels.append(pheromone.levels.tobytes())
    assert levels[0] == levels[1]


def test_one_by_one_in_any_order_comes_to_the_same() -> None:
    """Where all degrees are 1 the sum over a batch is that of a synchronous trial."""
    solutions = Solutions(4, 3, 2, partition=_CELLS)
    for t in range(3):
        index = np.array([[t], [0], [0], [2]], dtype=np.int32)
        solutions.append(np.arange(4), index, index, np.array([0, 0, 1, 0]))
    deposits = np.array([1.0, 2.0, 3.0, 4.0])
    levels = []
    for order in ([[0, 1, 2, 3]], [[0], [1], [2], [3]], [[3], [0, 2], [1]]):
        pheromone = Pheromone(3, 2, tau0=1.0, alpha=1.0)
        lay = Reinforcement(6)
        for number, part in enumerate(map(np.array, order)):
            lay(pheromone, solutions.of(part), deposits[part], 0.5, number == 0)
        levels.append(pheromone.levels)
    wanted = 0.5 + 0.5 * np.array([[1 + 2, 3], [1, 1], [1 + 4, 1]])
    for each in levels:
        np.testing.assert_allclose(each, wanted, rtol=1e-15)


class _Cells:
    """As much of a partition as solutions of one cell a state look at."""

    n_cells, cells_per_state = 3, 1


_CELLS = _Cells()


def test_every_rule_evaporates_once_a_batch() -> None:
    index = np.zeros((1, 1), dtype=np.int32)
    solutions = Solutions(2, 3, 1, partition=_CELLS)
    solutions.append(
        np.array([0, 1]),
        np.repeat(index, 2, 0),
        np.repeat(index, 2, 0),
        np.zeros(2, int),
    )
    for name in UPDATE_RULES:
        rule = type(UPDATE_RULES[name])()
        pheromone = Pheromone(3, 1, tau0=1.0, alpha=1.0)
        for trial in (0, 1):
            rule.start_trial(pheromone, trial)
            for ant in (0, 1):
                before = pheromone.levels[0, 0]
                part = solutions.of(np.array([ant]))
                one, no = np.array([1.0]), np.array([False])
                result = TrialResult(part, one, one, no, begins_batch=ant == 0)
                rule.global_update(pheromone, result, 0.0, 0.5)
                kept = 0.5 if ant == 0 else 1.0
                assert pheromone.levels[0, 0] == kept * before + 0.5


@given(trials(), st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_a_part_of_the_solutions_is_what_those_ants_did(
    trial: Trial, seed: int
) -> None:
    whole = trial.packed()
    for part in parts_of(seed, len(trial.length)):
        some = whole.of(part)
        assert some.n_ants == part.size
        np.testing.assert_array_equal(some.length, trial.length[part])
        rows = [
            (block.index.copy(), block.degree.copy(), block.action.copy(), block.ends)
            for block in some.blocks()
        ]
        index = np.concatenate([row[0] for row in rows])
        action = np.concatenate([row[2] for row in rows])
        steps = [(ant, t) for ant in part for t in range(trial.length[ant])]
        np.testing.assert_array_equal(action, [trial.action[s] for s in steps])
        dense = np.zeros((len(steps), len(trial.tau)))
        degree = np.concatenate([row[1] for row in rows])
        for row, (cells, weights) in enumerate(zip(index, degree, strict=True)):
            dense[row] = reference.dense(cells, weights, len(trial.tau))
        wanted = [
            reference.dense(trial.index[s], trial.degree[s], len(trial.tau))
            for s in steps
        ]
        np.testing.assert_allclose(dense, wanted, atol=1e-12)


def test_solutions_of_some_are_forgotten_alone() -> None:
    index = np.array([[0], [1], [2]], dtype=np.int32)
    solutions = Solutions(3, 5, 2, partition=_CELLS)
    for _ in range(4):
        solutions.append(np.arange(3), index, index, np.array([0, 1, 0]))
    solutions.clear(np.array([1]))
    assert solutions.length.tolist() == [4, 0, 4]
    solutions.append(np.array([1]), index[[2]], index[[2]], np.array([0]))
    (block,) = solutions.of(np.array([1])).blocks()
    assert (block.index.tolist(), block.action.tolist()) == ([[2]], [0])


@pytest.mark.parametrize("rho", [0.3, 1.0])
def test_the_kernel_agrees_with_itself_as_plain_python(rho: float) -> None:
    rng = np.random.default_rng(0)
    results = []
    laid = np.column_stack([np.zeros(6), *rng.random((2, 6)), rng.random(6)])
    laid[3, 3] = 1.0
    paid = np.array([0.0, 0.5, 1.0, 1.0, 0.2, 0.0])
    for kernel in (update_kernels.reinforce, update_kernels.reinforce.py_func):
        levels, stale = np.full((3, 2), 2.0), np.zeros(3, np.bool_)
        again = paid.copy()
        kernel(np.arange(5), laid.copy(), rho, levels, stale, again)
        results.append((levels, again, stale))
        np.testing.assert_array_equal(again[:5], np.maximum(paid, laid[:, 3])[:5])
        assert levels[2, 1] == 2.0  # not touched
        assert np.isfinite(levels).all()
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-15)
