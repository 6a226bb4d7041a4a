"""Whole tours built at once: against the equations in loops, and at the edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.colony.ant_rule import AntRule
from acl_gym.colony.ant_rules import AntColonySystemUpdate, AntSystemUpdate
from acl_gym.colony.candidates import candidate_lists, inverse_distances
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.tours import Tours, nearest_neighbour_tour
from acl_gym.envs.graph.instances import load_instance
from tests.colony import reference_ants as reference

Array = np.ndarray


class Problem(NamedTuple):
    """Cities with pheromone between them, and what ants need to build tours."""

    distances: Array
    pheromone: Pheromone
    lists: Array
    starts: Array
    draws: Array
    candidates: int
    symmetric: bool


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    """Of 2 to 9 cities; small whole distances, so that many ways are equally good."""
    n, m = draw(st.integers(2, 9)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    symmetric = draw(st.booleans())
    distances = rng.integers(0 if draw(st.booleans()) else 1, 6, (n, n)).astype(float)
    tau = (
        rng.choice([0.53, 1.0, 3.1], (n, n)) if draw(st.booleans()) else np.ones((n, n))
    )
    if symmetric:
        distances, tau = (
            np.triu(distances) + np.triu(distances, 1).T,
            np.triu(tau) + np.triu(tau, 1).T,
        )
    np.fill_diagonal(distances, 0.0)
    alpha, beta = (
        draw(st.sampled_from([1.0, 2.0, 2.5])),
        draw(st.sampled_from([0.0, 1.0, 2.0, 2.5])),
    )
    eta = inverse_distances(distances)
    pheromone = Pheromone(n, n, 0.7, alpha, eta, beta)
    pheromone.set_levels(tau)
    candidates = draw(st.integers(1, n))
    draws = rng.random((n, 2, m))
    return Problem(
        distances,
        pheromone,
        candidate_lists(eta, candidates),
        rng.integers(n, size=m),
        draws,
        candidates,
        symmetric,
    )


def built(rule: AntRule, problem: Problem, local_decay: float = 0.0) -> Array:
    tours = np.full((problem.starts.size, len(problem.distances)), -1, np.int32)
    rule.candidates = problem.lists
    rule.build(
        problem.pheromone,
        problem.starts,
        problem.draws,
        problem.lists,
        local_decay,
        tours,
    )
    return tours


@given(problems())
@settings(max_examples=60, deadline=None)
def test_tours_are_those_of_the_random_proportional_rule(problem: Problem) -> None:
    pheromone = problem.pheromone
    tau = pheromone.levels.copy()
    expected = reference.tours(
        tau,
        inverse_distances(problem.distances),
        problem.starts,
        problem.draws,
        candidates=problem.candidates,
        a=pheromone.alpha,
        b=pheromone.beta,
    )
    np.testing.assert_array_equal(built(AntSystemUpdate(), problem), expected)
    np.testing.assert_array_equal(pheromone.levels, tau)


@given(problems(), st.sampled_from([0.0, 0.5, 1.0]))
@settings(max_examples=60, deadline=None)
def test_tours_in_turn_are_those_of_the_ant_colony_system(
    problem: Problem, q0: float
) -> None:
    pheromone = problem.pheromone
    tau = pheromone.levels.copy()
    expected = reference.tours(
        tau,
        inverse_distances(problem.distances),
        problem.starts,
        problem.draws,
        candidates=problem.candidates,
        a=pheromone.alpha,
        b=pheromone.beta,
        q0=q0,
        gamma=0.1,
        tau0=pheromone.tau0,
        symmetric=problem.symmetric,
    )
    rule = AntColonySystemUpdate(q0=q0, symmetric=problem.symmetric)
    np.testing.assert_array_equal(built(rule, problem, 0.1), expected)
    np.testing.assert_allclose(pheromone.levels, tau, rtol=1e-13)


@given(problems(), st.sampled_from([0.0, 0.5, 1.0]))
@settings(max_examples=60, deadline=None)
def test_ants_that_choose_step_by_step_build_the_same_tours(
    problem: Problem, q0: float
) -> None:
    """The colony's own selection, with the masks that the environment would give."""
    pheromone, (n, _, m) = problem.pheromone, problem.draws.shape
    rule = AntColonySystemUpdate(q0=q0, symmetric=problem.symmetric)
    rule.candidates = problem.lists
    before = pheromone.levels.copy()
    walked = [problem.starts]

    class Told:
        """Gives the numbers that the tours were built with."""

        def random(self, shape: tuple[int, int]) -> Array:
            return problem.draws[len(walked) - 1]

    allowed = np.ones((m, n), np.bool_)
    for t in range(n):
        allowed[np.arange(m), walked[-1]] = False
        if t == n - 1:
            allowed[np.arange(m), problem.starts] = True
        index = walked[-1].astype(np.int32)[:, None]
        walked.append(
            rule.choose(
                "any", pheromone, index, np.ones((m, 1)), 0.5, Told(), allowed, 0.1
            )  # type: ignore[arg-type]
        )
    levels = pheromone.levels.copy()
    pheromone.set_levels(before)
    np.testing.assert_array_equal(built(rule, problem, 0.1), np.stack(walked[:-1], 1))
    np.testing.assert_array_equal(pheromone.levels, levels)


def test_first_steps_have_the_probabilities_of_the_rule() -> None:
    """40,000 ants: each share within five standard deviations."""
    n, m, alpha, beta = 6, 40_000, 2.0, 1.5
    rng = np.random.default_rng(4)
    eta, tau = rng.random((n, n)), rng.random((n, n)) + 0.2
    np.fill_diagonal(eta, 0.0)
    pheromone = Pheromone(n, n, 1.0, alpha, eta, beta)
    pheromone.set_levels(tau)
    tours = np.empty((m, n), np.int32)
    lists = candidate_lists(eta, n)
    starts, draws = np.full(m, 2), rng.random((n, 2, m))
    AntSystemUpdate().build(pheromone, starts, draws, lists, 0.0, tours)
    expected = tau[2] ** alpha * eta[2] ** beta
    expected /= expected.sum()
    shares = np.bincount(tours[:, 1], minlength=n) / m
    assert (
        np.abs(shares - expected) <= 5 * np.sqrt(expected * (1 - expected) / m)
    ).all()


@pytest.mark.parametrize("rule", [AntSystemUpdate(), AntColonySystemUpdate(q0=0.0)])
@pytest.mark.parametrize("choice", [0.0, np.nextafter(1.0, 0.0)])
def test_extreme_numbers_choose_cities_that_are_left(
    rule: AntRule, choice: float
) -> None:
    """choice * total may be rounded up to the total."""
    n = 7
    eta = inverse_distances(np.random.default_rng(1).random((n, n)) + 0.1)
    pheromone = Pheromone(n, n, 1.0 / 3.0, 1.0, eta, 2.0)
    tours = np.empty((n, n), np.int32)
    draws = np.full((n, 2, n), choice)
    rule.build(pheromone, np.arange(n), draws, candidate_lists(eta, 3), 0.1, tours)
    np.testing.assert_array_equal(np.sort(tours), np.tile(np.arange(n), (n, 1)))


@pytest.mark.parametrize("rule", [AntSystemUpdate(), AntColonySystemUpdate(q0=0.0)])
def test_levels_that_vanish_in_powers_still_tell_cities_apart(rule: AntRule) -> None:
    """1e-9 and 3e-9 to the power of 40 are 0 beside 1, but not beside each other."""
    n = 4
    pheromone = Pheromone(n, n, 1.0, 40.0)
    levels = np.ones((n, n))
    levels[1] = [1.0, 1.0, 1e-9, 3e-9]
    pheromone.set_levels(levels)
    eta = np.ones((n, n))
    tours = np.empty((1, n), np.int32)
    draws = np.full((n, 2, 1), 0.5)
    levels[0] = [1.0, 5.0, 1.0, 1.0]  # from city 0 to city 1
    pheromone.set_levels(levels)
    rule.build(
        pheromone, np.zeros(1, np.int64), draws, candidate_lists(eta, n), 0.0, tours
    )
    assert tours[0].tolist() == [0, 1, 3, 2]


def test_candidates_that_are_not_connected_do_not_trap_ants() -> None:
    """Two groups of cities that are no candidates of each other."""
    places = np.array([0.0, 1.0, 2.0, 100.0, 101.0, 102.0])
    eta = inverse_distances(np.abs(places[:, None] - places))
    lists = candidate_lists(eta, 2)
    pheromone = Pheromone(6, 6, 1.0, 1.0, eta, 2.0)
    rng = np.random.default_rng(0)
    tours = np.empty((20, 6), np.int32)
    starts, draws = rng.integers(6, size=20), rng.random((6, 2, 20))
    AntSystemUpdate().build(pheromone, starts, draws, lists, 0.0, tours)
    np.testing.assert_array_equal(np.sort(tours), np.tile(np.arange(6), (20, 1)))
    for tour in tours:  # each crosses between the groups once on its way
        assert (np.diff((tour > 2).astype(int)) != 0).sum() == 1


def test_candidate_lists_are_nearest_neighbours_in_ascending_order() -> None:
    distances = load_instance("att48").distances
    lists = candidate_lists(inverse_distances(distances), 5)
    for i, row in enumerate(lists):
        others = [j for j in range(48) if j != i]
        nearest = sorted(others, key=lambda j: (distances[i, j], j))[:5]
        assert row.tolist() == sorted(nearest)


def test_inverse_distances_of_cities_at_the_same_place() -> None:
    distances = np.array([[0.0, 0.0, 4.0], [0.0, 0.0, 2.0], [4.0, 2.0, 0.0]])
    eta = inverse_distances(distances)
    np.testing.assert_array_equal(
        eta, [[0.0, 5.0, 0.25], [5.0, 0.0, 0.5], [0.25, 0.5, 0.0]]
    )
    assert (inverse_distances(np.zeros((3, 3))) == 1.0 - np.eye(3)).all()


def test_nearest_neighbour_tour_by_hand() -> None:
    places = np.array([0.0, 3.0, 1.0, 7.0])
    distances = np.abs(places[:, None] - places)
    assert nearest_neighbour_tour(distances, 0).tolist() == [0, 2, 1, 3]
    assert nearest_neighbour_tour(distances, 3).tolist() == [3, 1, 2, 0]


@pytest.mark.parametrize(("n", "m"), [(5, 3), (2, 1), (1_000, 9), (5_000, 2)])
def test_blocks_hold_every_arc_of_every_ant(n: int, m: int) -> None:
    solutions = Tours(m, n)
    rng = np.random.default_rng(n)
    solutions.tours[:] = [rng.permutation(n) for _ in range(m)]
    ants, found = [], []
    for block in solutions.blocks():
        assert (block.degree == 1.0).all()
        begin = 0
        for ant, end in zip(
            range(block.ants.start, block.ants.stop), block.ends, strict=True
        ):
            ants.append(ant)
            rows = slice(begin, int(end))
            found.append(np.column_stack([block.index[rows, 0], block.action[rows]]))
            begin = int(end)
    assert ants == list(range(m))
    for ant in range(m):
        expected = reference.arcs(solutions.tours[ant].tolist())
        np.testing.assert_array_equal(found[ant], expected)
    assert solutions.length.tolist() == [n] * m
