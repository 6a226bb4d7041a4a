"""Selection rules and policy, against the equations, and what they remember."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from acl_gym.colony import greedy, selection
from acl_gym.colony import pheromone as pheromone_module
from acl_gym.colony.greedy import greedy_actions
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import RULES, choose_actions
from acl_gym.colony.update_rules import EachVisit, Reinforcement
from acl_gym.partitions.kernels import MOST_WRITTEN_OUT, written_out
from acl_gym.policies import table as tables
from tests.agents import reference_colony as reference
from tests.colony.listed import recorded
from tests.colony.test_pheromone import degrees

Array = np.ndarray
SIZES = ((1, 2), (2, 1), (2, 3), (4, 5), (4, MOST_WRITTEN_OUT + 1))
"""Cells per state, and actions: few, for each pair has kernels of its own to compile."""

ALPHAS = (0.5, 1.0, 2.0, 2.5, 3.0, 8.0, 9.0, 60.0)


@st.composite
def colonies(draw: st.DrawFn) -> tuple[Pheromone, Array, Array, np.random.Generator]:
    """A pheromone of any size and spread, and the states of some ants."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    k, n_actions = draw(st.sampled_from(SIZES), label="k, actions")
    n_cells = draw(st.integers(k, k + 5), label="cells")
    alpha = draw(
        st.sampled_from(ALPHAS) | st.floats(0.01, 20.0) | st.just(1e4), label="alpha"
    )
    spread = draw(st.sampled_from([0.1, 1.0, 10.0]), label="spread")
    ants = draw(st.integers(1, 6), label="ants")
    pheromone = Pheromone(n_cells, n_actions, 1e-4, alpha)
    pheromone.set_levels(np.exp(spread * rng.normal(size=(n_cells, n_actions))))
    index = np.array(
        [rng.permutation(n_cells)[:k] for _ in range(ants)], dtype=np.int32
    )
    return pheromone, index, degrees(rng, ants, k), rng


@given(colonies(), st.sampled_from(RULES), st.sampled_from([0.0, 0.3, 1.0]))
@settings(max_examples=50)
def test_choices_are_those_of_the_reference(
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
    rule: str,
    epsilon: float,
) -> None:
    pheromone, index, degree, rng = colony
    state = rng.bit_generator.state
    actions = choose_actions(rule, pheromone, index, degree, epsilon, rng)
    rng.bit_generator.state = state
    coins, choices = rng.random((2, len(index)))
    for j, action in enumerate(actions):
        beta = reference.dense(index[j], degree[j], len(pheromone.levels))
        assert action == reference.chosen(
            rule,
            pheromone.levels,
            beta,
            pheromone.alpha,
            epsilon,
            coins[j],
            choices[j],
        )


@given(colonies())
@settings(max_examples=50)
def test_probabilities_are_those_of_the_equation(
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
) -> None:
    pheromone, index, degree, rng = colony
    choose_actions("boltzmann", pheromone, index, degree, 0.0, rng)
    visited = np.unique(index)
    assert not pheromone.stale[visited].any()
    for cell in visited:
        beta = np.eye(len(pheromone.levels))[cell]
        expected = reference.boltzmann(pheromone.levels, beta, pheromone.alpha)
        actual = pheromone.probabilities[cell]
        np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-12)
        assert actual.sum() == pytest.approx(1.0, abs=1e-14)
    untouched = np.setdiff1d(np.arange(len(pheromone.levels)), visited)
    assert pheromone.stale[untouched].all()


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("alpha", "epsilon"), [(3.0, 0.1), (2.5, 0.4), (0.7, 0.0), (1.0, 1.0)]
)
def test_frequencies_are_those_of_the_rule(
    rule: str, alpha: float, epsilon: float
) -> None:
    """One call, 200,000 ants in one state: each has a coin and a choice of its own."""
    levels = np.array(
        [[0.1, 0.5, 0.2, 0.5], [0.3, 0.2, 0.4, 0.2], [1.0, 1.0, 1.0, 1.0]]
    )
    pheromone = Pheromone(3, 4, 1e-4, alpha)
    pheromone.set_levels(levels)
    ants = 200_000
    index = np.tile(np.array([2, 0], dtype=np.int32), (ants, 1))
    degree = np.tile([0.35, 0.65], (ants, 1))
    rng = np.random.default_rng(20100)
    actions = choose_actions(rule, pheromone, index, degree, epsilon, rng)
    counts = np.bincount(actions, minlength=4)
    beta = np.array([0.65, 0.0, 0.35])
    expected = ants * reference.rule_probabilities(rule, levels, beta, alpha, epsilon)
    assert (counts[expected == 0] == 0).all()
    possible = expected > 0
    assert stats.chisquare(counts[possible], expected[possible]).pvalue > 1e-3


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("alpha", ALPHAS)
def test_extreme_levels_are_no_trouble(rule: str, alpha: float) -> None:
    pheromone = Pheromone(2, 3, 1e-300, alpha)
    pheromone.set_levels(np.array([[1e-300, 1e300, 1e-300], [1e-308, 1e-308, 1e-308]]))
    index = np.array([[0], [0], [1]] * 100, dtype=np.int32)
    rng = np.random.default_rng(0)
    actions = choose_actions(rule, pheromone, index, np.ones((300, 1)), 0.0, rng)
    assert (actions.reshape(-1, 3)[:, :2] == 1).all()
    assert set(actions.reshape(-1, 3)[:, 2]) == {0, 1, 2}
    if rule != "epsilon_greedy":
        assert pheromone.probabilities[1] == pytest.approx([1 / 3] * 3)
        # 1e-600 is 0, 1e-300 (alpha = 0.5) is all but that.
        assert pheromone.probabilities[0] == pytest.approx([0, 1, 0], abs=1e-299)


@pytest.mark.parametrize("alpha", [8.0, 9.0, 1e19, 1e308])
@pytest.mark.parametrize("k", [1, 4])
def test_exponents_that_no_integer_holds_are_no_trouble(alpha: float, k: int) -> None:
    """Small whole exponents are multiplied out; these would take for ever."""
    pheromone = Pheromone(4, 2, 0.1, alpha, np.ones((4, 2)))
    pheromone.set_levels(np.array([[0.5, 1.0]] * 4))
    index, degree = np.arange(k, dtype=np.int32)[None], np.full((1, k), 1 / k)
    choose_actions("boltzmann", pheromone, index, degree, 0.0, np.random.default_rng(0))
    low = 0.5**alpha
    assert pheromone.probabilities[0] == pytest.approx([low / (1 + low), 1 / (1 + low)])


@pytest.mark.parametrize("choice", [0.0, np.nextafter(1.0, 0.0)])
@pytest.mark.parametrize("n_actions", [1, 2, 17])
def test_the_ends_of_the_unit_interval_choose_the_first_and_last(
    choice: float, n_actions: int
) -> None:
    levels = np.ones((1, n_actions))
    index, degree = np.zeros((1, 1), dtype=np.int32), np.ones((1, 1))
    end = 0 if choice == 0.0 else n_actions - 1
    for coin in (0.0, 0.9):  # explores, exploits
        draws = np.array([[coin], [choice]])
        actions = np.full((2, 1), -1, dtype=np.int64)
        selection._boltzmann(
            levels,
            3.0,
            None,
            np.full(levels.shape, 1 / n_actions),
            np.zeros(len(levels), dtype=np.bool_),
            index,
            degree,
            draws,
            0.5,
            greedy.ALL,
            written_out(n_actions),
            written_out(1),
            actions[0],
        )
        greedy._epsilon_greedy(
            levels, None, index, degree, draws, 0.5, greedy.ALL, actions[1]
        )
        assert actions.tolist() == [[end], [end]]


Operations = st.lists(
    st.sampled_from(["local", "global", "alpha", "levels", "choose"]),
    min_size=2,
    max_size=12,
)


@given(colonies(), Operations)
@settings(max_examples=50)
def test_remembered_probabilities_are_never_out_of_date(
    colony: tuple[Pheromone, Array, Array, np.random.Generator], operations: list[str]
) -> None:
    """Whatever happened in between, what is not stale is what (4.3) gives now."""
    pheromone, index, degree, rng = colony
    ants = len(index)
    n_cells, n_actions = pheromone.levels.shape
    for operation in [*operations, "choose"]:
        some = slice(int(rng.integers(ants)), None)
        actions = rng.integers(n_actions, size=ants)
        if operation == "local":
            EachVisit().local_update(
                pheromone, index[some], degree[some], actions[some], 0.3
            )
        elif operation == "global":
            solutions = recorded(
                index[:, None],
                degree[:, None],
                actions[:, None],
                (np.arange(ants) >= some.start).astype(np.int64),
            )
            deposits = rng.uniform(1, 9, size=ants)
            Reinforcement(pheromone.levels.size)(pheromone, solutions, deposits, 0.4)
        elif operation == "alpha":
            pheromone.alpha = float(rng.choice(ALPHAS))
        elif operation == "levels":
            pheromone.set_levels(rng.exponential(size=(n_cells, n_actions)) + 1e-9)
        else:
            choose_actions("boltzmann", pheromone, index[some], degree[some], 0.0, rng)
            assert not pheromone.stale[np.unique(index[some])].any()
        for cell in np.flatnonzero(~pheromone.stale):
            np.testing.assert_allclose(
                pheromone.probabilities[cell],
                reference.boltzmann(
                    pheromone.levels, np.eye(n_cells)[cell], pheromone.alpha
                ),
                rtol=1e-9,
                atol=1e-12,
            )


@given(colonies(), st.booleans())
@settings(max_examples=50)
def test_the_policy_maximises_the_weighted_level(
    colony: tuple[Pheromone, Array, Array, np.random.Generator], rounded: bool
) -> None:
    """(4.16); ties, which rounding of the levels provokes, go by rank."""
    pheromone, index, degree, rng = colony
    table = np.round(pheromone.levels) if rounded else pheromone.levels
    n_cells, n_actions = table.shape
    ranks = tables.random_ranks(n_cells, n_actions, rng)
    actions = greedy_actions(table, ranks, index, degree)
    for j, action in enumerate(actions):
        best = reference.maximisers(
            table, reference.dense(index[j], degree[j], n_cells)
        )
        foremost = index[j, np.argmax(degree[j])]
        # The order of summation may part values that are equal but for rounding.
        values = [
            sum(d * table[c, u] for c, d in zip(index[j], degree[j], strict=True))
            for u in range(n_actions)
        ]
        assert values[action] == pytest.approx(values[best[0]], rel=1e-14)
        tied = [u for u in range(n_actions) if values[u] == max(values)]
        assert action == min(tied, key=lambda u: ranks[foremost, u])


@given(colonies())
@settings(max_examples=50)
def test_the_best_action_of_a_cell_is_its_policy(
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
) -> None:
    pheromone, _, _, rng = colony
    table = np.round(pheromone.levels)
    n_cells, n_actions = table.shape
    ranks = tables.random_ranks(n_cells, n_actions, rng)
    centres = np.arange(n_cells, dtype=np.int32)[:, None]
    best = tables.best_of_rows(table, ranks)
    np.testing.assert_array_equal(
        best, greedy_actions(table, ranks, centres, np.ones((n_cells, 1)))
    )
    np.testing.assert_array_equal(best, tables.best_of_rows.py_func(table, ranks))


def test_ranks_are_orders_and_each_order_is_as_likely() -> None:
    ranks = tables.random_ranks(60_000, 3, np.random.default_rng(3))
    assert ranks.dtype == np.int32
    np.testing.assert_array_equal(np.sort(ranks, axis=1), [[0, 1, 2]] * 60_000)
    _, counts = np.unique(ranks, axis=0, return_counts=True)
    assert len(counts) == 6
    assert stats.chisquare(counts).pvalue > 1e-3


@given(colonies(), st.sampled_from(RULES), st.sampled_from([0.0, 0.3, 1.0]))
@settings(max_examples=100)
def test_a_restricted_choice_is_that_of_a_table_with_the_allowed_actions_only(
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
    rule: str,
    epsilon: float,
) -> None:
    pheromone, index, degree, rng = colony
    allowed = rng.random((len(index), pheromone.levels.shape[1])) < 0.5
    allowed[~allowed.any(axis=1), 0] = True
    state = rng.bit_generator.state
    actions = choose_actions(rule, pheromone, index, degree, epsilon, rng, allowed)
    rng.bit_generator.state = state
    coins, choices = rng.random((2, len(index)))
    for j, action in enumerate(actions):
        beta = reference.dense(index[j], degree[j], len(pheromone.levels))
        columns = np.flatnonzero(allowed[j])
        expected = reference.chosen(
            rule,
            pheromone.levels[:, columns],
            beta,
            pheromone.alpha,
            epsilon,
            coins[j],
            choices[j],
        )
        assert action == columns[expected]


@given(colonies())
@settings(max_examples=50)
def test_the_policy_of_allowed_actions_is_that_of_their_columns(
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
) -> None:
    pheromone, index, degree, rng = colony
    table = np.round(pheromone.levels)  # so that there are ties
    columns = np.flatnonzero(rng.random(table.shape[1]) < 0.7)
    columns = columns if columns.size else np.array([0])
    allowed = np.zeros((len(index), table.shape[1]), dtype=bool)
    allowed[:, columns] = True
    ranks = tables.random_ranks(*table.shape, rng)
    among = greedy_actions(table[:, columns], ranks[:, columns], index, degree)
    np.testing.assert_array_equal(
        greedy_actions(table, ranks, index, degree, allowed), columns[among]
    )


@pytest.mark.parametrize("restricted", [False, True])
@given(colonies())
@settings(max_examples=50)
def test_kernels_agree_with_themselves_as_plain_python(
    restricted: bool,
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
) -> None:
    pheromone, index, degree, rng = colony
    levels, alpha = pheromone.levels, pheromone.alpha
    ants, (n_cells, n_actions) = len(index), levels.shape
    draws = rng.random((2, ants))
    ranks = tables.random_ranks(n_cells, n_actions, rng)
    allowed = greedy.ALL
    if restricted:
        allowed = rng.random((ants, n_actions)) < 0.7
        allowed[:, 0] = True
    results = []
    for version in (lambda kernel: kernel, lambda kernel: kernel.py_func):
        probabilities = np.empty_like(levels)
        stale = np.ones(n_cells, dtype=bool)
        actions = np.full((3, ants), -1, dtype=np.int64)
        states = index, degree
        columns, corners = written_out(n_actions), written_out(index.shape[1])
        version(pheromone_module.repair)(
            levels, alpha, None, index, columns, corners, probabilities, stale
        )
        version(selection._boltzmann)(
            levels,
            alpha,
            None,
            probabilities,
            stale,
            *states,
            draws,
            0.2,
            allowed,
            columns,
            corners,
            actions[0],
        )
        version(greedy._epsilon_greedy)(
            levels, None, *states, draws, 0.2, allowed, actions[1]
        )
        version(greedy._greedy)(levels, ranks, *states, allowed, actions[2])
        results.append((probabilities[~stale], actions))
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-13, atol=1e-300)
