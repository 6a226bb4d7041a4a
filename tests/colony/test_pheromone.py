"""The pheromone's two updates, against the equations and their invariants."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.colony import update_kernels
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions, _strike_tried
from acl_gym.colony.update_rules import EachVisit, Reinforcement
from acl_gym.partitions.kernels import written_out
from tests.agents import reference_colony as reference
from tests.colony.listed import recorded

Array = np.ndarray


@dataclass
class Trial:
    """What some ants did, as the package holds it and as the reference does."""

    pheromone: Pheromone
    index: Array  # (ants, steps, k)
    degree: Array
    action: Array  # (ants, steps)
    length: Array
    costs: Array
    gamma: float
    rho: float

    @property
    def tau(self) -> Array:
        return self.pheromone.levels

    @property
    def solutions(self) -> list[reference.Solution]:
        return [self.solution(ant) for ant in range(len(self.length))]

    def solution(self, ant: int) -> reference.Solution:
        return [
            (
                reference.dense(self.index[ant, t], self.degree[ant, t], len(self.tau)),
                int(self.action[ant, t]),
            )
            for t in range(self.length[ant])
        ]

    def packed(self, order: Array | None = None) -> Solutions:
        """Record the steps as the colony does, all walking ants at once."""
        order = np.arange(len(self.length)) if order is None else order
        return recorded(
            self.index[order],
            self.degree[order],
            self.action[order],
            self.length[order],
            self.tau.shape[1],
        )

    def deposit(self, order: Array | None = None) -> None:
        order = np.arange(len(self.length)) if order is None else order
        deposits = 1.0 / self.costs[order]
        reinforce(self.pheromone, self.packed(order), deposits, self.rho)

    def decay(self, t: int, order: Array | None = None) -> None:
        order = np.arange(len(self.length)) if order is None else order
        rows = order[self.length[order] > t]
        EachVisit().local_update(
            self.pheromone,
            self.index[rows, t],
            self.degree[rows, t],
            self.action[rows, t],
            self.gamma,
        )


def degrees(rng: np.random.Generator, *shape: int) -> Array:
    """Degrees that sum to 1 over the last axis; some of them 0, some states crisp."""
    weights = rng.exponential(size=shape) * (rng.random(shape) < 0.7)
    weights[..., 0] += weights.sum(axis=-1) == 0
    return weights / weights.sum(axis=-1, keepdims=True)


def reinforce(
    pheromone: Pheromone, solutions: Solutions, deposits: Array, rho: float
) -> None:
    Reinforcement(pheromone.levels.size)(pheromone, solutions, deposits, rho)


@st.composite
def trials(draw: st.DrawFn, revisits: bool = True) -> Trial:
    """Trials of any size; without `revisits` an ant visits a pair at most once."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    k = draw(st.integers(1, 4), label="k")
    steps = draw(st.integers(1, 5), label="steps")
    n_cells = draw(st.integers(1, 6), label="more cells") + (
        k if revisits else k * steps
    )
    n_actions = draw(st.integers(1, 4), label="actions")
    ants = draw(st.integers(1, 6), label="ants")
    tau0 = draw(st.sampled_from([1e-9, 1e-4, 1.0]), label="tau0")
    pheromone = Pheromone(n_cells, n_actions, tau0, alpha=2.0)
    levels = tau0 * np.exp(rng.normal(scale=2.0, size=(n_cells, n_actions)))
    levels[rng.random(levels.shape) < 0.3] = tau0
    pheromone.set_levels(levels)
    permuted = np.array([rng.permutation(n_cells) for _ in range(ants * steps)])
    index = permuted[:, :k].reshape(ants, steps, k)
    if not revisits:
        index = permuted[:ants, : k * steps].reshape(ants, steps, k)
    return Trial(
        pheromone,
        index.astype(np.int32),
        degrees(rng, ants, steps, k),
        rng.integers(n_actions, size=(ants, steps)),
        rng.integers(1, steps + 1, size=ants),
        np.exp(rng.normal(scale=3.0, size=ants)),
        draw(st.sampled_from([0.0, 0.01, 0.5]) | st.floats(0.0, 0.999), label="gamma"),
        draw(st.sampled_from([0.0, 0.1, 1.0]) | st.floats(0.0, 1.0), label="rho"),
    )


@given(trials())
@settings(max_examples=50)
def test_local_update_is_that_of_the_ants_one_after_another(trial: Trial) -> None:
    expected = trial.tau.copy()
    for ant in range(len(trial.length)):
        beta, action = trial.solution(ant)[0]
        reference.local_update(
            expected, beta, action, trial.gamma, trial.pheromone.tau0
        )
    product = reference.local_product(
        trial.tau,
        [solution[0] for solution in trial.solutions],
        trial.gamma,
        trial.pheromone.tau0,
    )
    trial.decay(0)
    np.testing.assert_allclose(trial.tau, expected, rtol=1e-12)
    np.testing.assert_allclose(trial.tau, product, rtol=1e-12)


@given(trials())
@settings(max_examples=50)
def test_global_update_is_that_of_the_equations(trial: Trial) -> None:
    expected = reference.global_update(
        trial.tau, trial.solutions, trial.costs, trial.rho
    )
    trial.deposit()
    np.testing.assert_allclose(trial.tau, expected, rtol=1e-12, atol=1e-300)


@given(trials(), st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_the_order_of_the_ants_does_not_matter(trial: Trial, seed: int) -> None:
    """Theorems 4.1 and 4.2, over several steps and the deposit that follows them."""
    start = trial.tau.copy()
    order = np.random.default_rng(seed).permutation(len(trial.length))
    results = []
    for one in (np.arange(len(order)), order):
        trial.pheromone.set_levels(start)
        for t in range(trial.length.max()):
            trial.decay(t, one)
        trial.deposit(one)
        results.append(trial.tau.copy())
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12, atol=1e-300)


@given(trials(revisits=False))
@settings(max_examples=50)
def test_total_update_is_local_then_global(trial: Trial) -> None:
    """(4.21) presumes that an ant visits a pair once."""
    expected = reference.total_update(
        trial.tau,
        trial.solutions,
        trial.costs,
        trial.gamma,
        trial.rho,
        trial.pheromone.tau0,
    )
    for t in range(trial.length.max()):
        trial.decay(t)
    trial.deposit()
    np.testing.assert_allclose(trial.tau, expected, rtol=1e-11, atol=1e-300)


@given(trials())
@settings(max_examples=50)
def test_untouched_pairs_stay_bit_identical(trial: Trial) -> None:
    before = trial.tau.copy()
    touched = reference.indicator([*chain(*trial.solutions)], trial.tau.shape) > 0
    for t in range(trial.length.max()):
        trial.decay(t)
    trial.deposit()
    np.testing.assert_array_equal(trial.tau[~touched], before[~touched])


@given(trials())
@settings(max_examples=50)
def test_zero_rates_leave_every_level(trial: Trial) -> None:
    before = trial.tau.copy()
    trial.gamma = trial.rho = 0.0
    for t in range(trial.length.max()):
        trial.decay(t)
    trial.deposit()
    np.testing.assert_array_equal(trial.tau, before)


@given(trials(), st.integers(1, 10), st.floats(0.01, 1.0))
@settings(max_examples=50)
def test_levels_stay_above_tau0(trial: Trial, rounds: int, share: float) -> None:
    """Proposition 4.3, at the bound (share = 1) and below it."""
    rho = max(trial.rho, 1e-3)
    tau0 = share * rho / trial.costs.max()
    shape = trial.tau.shape
    trial.pheromone = Pheromone(*shape, tau0, alpha=1.0)
    trial.rho = rho
    for _ in range(rounds):
        for t in range(trial.length.max()):
            trial.decay(t)
        trial.deposit()
        assert (trial.tau >= tau0 * (1 - 1e-12)).all()


def test_levels_fall_below_a_tau0_that_exceeds_every_deposit() -> None:
    """What the bound is for: with tau0 = 2 / J one deposit lowers the level."""
    pheromone = Pheromone(1, 1, tau0=2 / 10.0, alpha=1.0)
    one = np.zeros((1, 1, 1), dtype=np.int32)
    solutions = recorded(one, np.ones((1, 1, 1)), np.array([[0]]))
    reinforce(pheromone, solutions, np.array([0.1]), 0.5)
    assert pheromone.levels[0, 0] == pytest.approx(0.5 * 2 / 10 + 0.5 / 10)
    assert pheromone.levels[0, 0] < pheromone.tau0


def test_a_level_at_tau0_stays_exactly_there() -> None:
    pheromone = Pheromone(2, 2, tau0=0.1, alpha=3.0)
    index = np.array([[0, 1]], dtype=np.int32)
    for _ in range(1000):
        EachVisit().local_update(
            pheromone, index, np.array([[0.3, 0.7]]), np.array([1]), 0.013
        )
    assert (pheromone.levels == 0.1).all()


def test_a_pair_counts_once_with_its_largest_degree() -> None:
    """(4.13): three visits with degrees 0.2, 0.9, 0.5 deposit 0.9 / J."""
    pheromone = Pheromone(2, 2, tau0=1.0, alpha=1.0)
    index = np.array([[[0, 1]] * 3])
    degree = np.array([[[d, 1 - d] for d in (0.2, 0.9, 0.5)]])
    solutions = recorded(index, degree, np.ones((1, 3), dtype=np.int64))
    reinforce(pheromone, solutions, np.array([0.25]), 0.1)
    expected = np.ones((2, 2))
    expected[:, 1] = [(1 - 0.1 * d) + 0.1 * d / 4 for d in (0.9, 0.8)]
    np.testing.assert_allclose(pheromone.levels, expected, rtol=1e-15)


def test_the_decay_of_a_deposit_weighs_with_the_largest_degree_of_all_ants() -> None:
    """(4.14), (4.15): deposits add up, the decay does not."""
    pheromone = Pheromone(2, 1, tau0=1.0, alpha=1.0)
    index = np.array([[[0, 1]], [[1, 0]]])
    degree = np.array([[[0.25, 0.75]], [[0.5, 0.5]]])
    solutions = recorded(index, degree, np.zeros((2, 1), dtype=np.int64))
    reinforce(pheromone, solutions, np.array([0.5, 0.2]), 0.2)
    expected = [
        (1 - 0.2 * 0.5) + 0.2 * (0.25 / 2 + 0.5 / 5),
        (1 - 0.2 * 0.75) + 0.2 * (0.75 / 2 + 0.5 / 5),
    ]
    np.testing.assert_allclose(pheromone.levels[:, 0], expected, rtol=1e-15)


@given(trials())
@settings(max_examples=50)
def test_scratch_and_solutions_leave_nothing_behind(trial: Trial) -> None:
    """The same update from the same levels twice is the same to the last bit."""
    start = trial.tau.copy()
    solutions = trial.packed()
    results = []
    for _ in range(2):
        trial.pheromone.set_levels(start)
        reinforce(trial.pheromone, solutions, 1.0 / trial.costs, trial.rho)
        results.append(trial.tau.copy())
    np.testing.assert_array_equal(results[0], results[1])
    solutions.clear()
    reinforce(trial.pheromone, solutions, 1.0 / trial.costs, 1.0)
    np.testing.assert_array_equal(trial.tau, results[1])


@pytest.mark.parametrize("deposit", [0.0, -0.0, -3.5, np.nan, np.inf, -np.inf])
def test_a_deposit_that_is_none_is_refused(deposit: float) -> None:
    pheromone = Pheromone(2, 2, tau0=0.5, alpha=1.0)
    ones = np.ones((3, 1, 1))
    solutions = recorded(0 * ones, ones, np.zeros((3, 1), dtype=np.int64))
    with pytest.raises(ValueError, match=r"> 0 and their sum finite.*ant 1") as error:
        reinforce(pheromone, solutions, np.array([1.0, deposit, 2.0]), 0.1)
    assert f"got {deposit} " in str(error.value)
    assert (pheromone.levels == 0.5).all()


def walked(pairs: list[tuple[int, int]]) -> Solutions:
    """The solution of one ant: cells and actions."""
    cells, actions = np.array(pairs or [(0, 0)]).T
    index = cells[None, :, None]
    return recorded(index, np.ones(index.shape), actions[None], np.array([len(pairs)]))


Pairs = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2)), max_size=20)


@given(Pairs, st.integers(0, 2), st.lists(st.booleans(), min_size=3, max_size=3))
def test_the_tabu_list_is_that_of_a_list_per_state(
    pairs: list[tuple[int, int]], cell: int, mask: list[bool]
) -> None:
    allowed = np.array([mask])
    left = set(np.flatnonzero(allowed[0]).tolist())
    everything = set(left)
    for other, action in pairs:
        if other == cell and action in left:
            left.remove(action)
            left = left or set(everything)
    one = np.array([0])
    untried = walked(pairs).untried(one, np.array([[cell]], dtype=np.int32), allowed)
    assert set(np.flatnonzero(untried[0]).tolist()) == left
    np.testing.assert_array_equal(allowed[0], mask)  # untouched
    plain = allowed.copy()
    solutions = walked(pairs)
    if pairs:
        _strike_tried.py_func(
            one,
            np.array([[cell]]),
            solutions._rows,
            solutions._action,
            solutions.length,
            allowed,
            plain,
        )
    np.testing.assert_array_equal(plain, untried)


@given(trials())
@settings(max_examples=50)
def test_kernels_agree_with_themselves_as_plain_python(trial: Trial) -> None:
    index, degree, action = trial.index[:, 0], trial.degree[:, 0], trial.action[:, 0]
    levels, again = trial.tau.copy(), trial.tau.copy()
    stale, stale_again = np.zeros((2, len(levels)), dtype=bool)
    corners = written_out(index.shape[1])
    rows = index, degree, corners, action, trial.gamma, trial.pheromone.tau0
    update_kernels.decay(*rows, levels, stale)
    update_kernels.decay.py_func(*rows, again, stale_again)
    np.testing.assert_allclose(levels, again, rtol=1e-15)
    np.testing.assert_array_equal(stale, stale_again)

    (block,) = trial.packed().blocks()
    n_touched = []
    for name, table, flags in (
        ("__call__", levels, stale),
        ("py_func", again, stale_again),
    ):
        summed = np.zeros((table.size, 4))
        touched = np.empty(table.size + 1, dtype=np.int64)
        n_touched.append(
            getattr(update_kernels.sum_deposits, name)(
                block.index,
                block.degree,
                corners,
                block.action,
                block.ends,
                0,
                1.0 / trial.costs,
                summed,
                touched,
                0,
                table.shape[1],
            )
        )
        kernel = getattr(update_kernels.reinforce, name)
        kernel(touched[: n_touched[-1]], summed, trial.rho, table, flags)
        assert not summed[:, 1:].any()
    assert n_touched[0] == n_touched[1]
    np.testing.assert_allclose(levels, again, rtol=1e-14)
    np.testing.assert_array_equal(stale, stale_again)


def test_every_changed_cell_becomes_stale_and_no_other() -> None:
    pheromone = Pheromone(4, 2, tau0=1.0, alpha=2.0)
    assert pheromone.stale.all()
    pheromone.stale[:] = False
    index = np.array([[1, 3]], dtype=np.int32)
    EachVisit().local_update(
        pheromone, index, np.array([[1.0, 0.0]]), np.array([0]), 0.0
    )
    assert not pheromone.stale.any()
    EachVisit().local_update(
        pheromone, index, np.array([[1.0, 0.0]]), np.array([0]), 0.1
    )
    assert pheromone.stale.tolist() == [False, True, False, False]
    pheromone.stale[:] = False
    solutions = recorded(index[None], np.array([[[0.0, 1.0]]]), np.array([[1]]))
    reinforce(pheromone, solutions, np.array([1.0]), 0.5)
    assert pheromone.stale.tolist() == [False, False, False, True]
    pheromone.stale[:] = False
    pheromone.alpha = 2.0
    assert not pheromone.stale.any()
    pheromone.alpha = 3.0
    assert pheromone.stale.all()
    pheromone.stale[:] = False
    pheromone.set_levels(np.full((4, 2), 2.0))
    assert pheromone.stale.all()


def test_deposits_whose_sum_overflows_are_refused() -> None:
    pheromone = Pheromone(3, 2, 1.0, 3.0)
    ones = np.ones((50, 1, 1))
    solutions = recorded(0 * ones, ones, np.zeros((50, 1), dtype=np.int64))
    with pytest.raises(ValueError, match="their sum finite"):
        reinforce(pheromone, solutions, np.full(50, 1e307), 0.5)
    assert (pheromone.levels == 1.0).all()


@given(trials(), st.integers(0, 3))
@settings(max_examples=30)
def test_an_update_that_was_interrupted_leaves_no_trace(
    trial: Trial, blocks: int
) -> None:
    class Cut(BaseException):
        """As Ctrl-C, wherever it comes."""

    solutions = trial.packed()
    whole, rows = solutions.blocks, list(trial.packed().blocks())

    def cut_short() -> Iterator[Any]:
        yield from rows[:blocks]
        raise Cut

    clean, struck = trial.pheromone.levels.copy(), trial.pheromone
    deposits = 1.0 / trial.costs
    reinforcement = Reinforcement(clean.size)
    solutions.blocks = cut_short  # type: ignore[method-assign]
    with pytest.raises(Cut):
        reinforcement(struck, solutions, deposits, trial.rho)
    np.testing.assert_array_equal(struck.levels, clean)
    solutions.blocks = whole  # type: ignore[method-assign]
    reinforcement(struck, solutions, deposits, trial.rho)
    fresh = Pheromone(*clean.shape, struck.tau0, struck.alpha)
    fresh.set_levels(clean)
    reinforce(fresh, trial.packed(), deposits, trial.rho)
    np.testing.assert_array_equal(struck.levels, fresh.levels)
