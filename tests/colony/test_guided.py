"""Choices led by a heuristic, against what their docstring says, action by action."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.colony.greedy import epsilon_greedy_actions
from acl_gym.colony.guided import guided_actions, shares_of

Array = np.ndarray


def remaining(values: Array, allowed: Array, explores: bool) -> list[int]:
    """The actions among which one is drawn."""
    may = np.flatnonzero(allowed)
    if explores:
        return list(may)
    best = values[may].max()
    return [u for u in may if values[u] == best]


@given(
    st.integers(0, 2**32 - 1),
    st.booleans(),
    st.sampled_from([0.0, 0.5, 1.0, 4.0]),
    st.sampled_from([0.0, 0.3, 1.0]),
)
@settings(max_examples=60, deadline=None)
def test_choices_are_those_of_the_definition(
    seed: int, restricted: bool, beta: float, epsilon: float
) -> None:
    rng = np.random.default_rng(seed)
    n_cells, n_actions, n, k = 5, 4, 20, 2
    # Few different levels, of both signs: ties are frequent.
    table = rng.integers(-1, 1, (n_cells, n_actions)).astype(float)
    eta = rng.random((n_cells, n_actions)) * (rng.random((n_cells, n_actions)) < 0.7)
    eta[~eta.any(axis=1), 0] = 1.0
    index = rng.integers(0, n_cells, (n, k)).astype(np.int32)
    degree = np.stack([np.full(n, 0.75), np.full(n, 0.25)], axis=1)
    allowed = np.ones((n, n_actions), dtype=bool)
    if restricted:
        allowed = rng.random(allowed.shape) < 0.5
        allowed[~allowed.any(axis=1), 1] = True
    mask = allowed if restricted else None
    state = rng.bit_generator.state
    actions = guided_actions(
        shares_of(eta, beta), table, index, degree, epsilon, rng, mask
    )
    rng.bit_generator.state = state
    coins, choices = rng.random((2, n))
    for j, action in enumerate(actions):
        values = degree[j] @ table[index[j]]
        columns = remaining(values, allowed[j], coins[j] < epsilon)
        proposed = np.zeros(n_actions)
        for cell, share in zip(index[j], degree[j], strict=True):
            powers = np.where(eta[cell] > 0, eta[cell] ** beta, 0.0)
            proposed += share * powers / powers.sum()
        weight = proposed[columns]
        if not weight.any():
            weight = np.ones(len(columns))
        edges = np.concatenate([[0.0], np.cumsum(weight / weight.sum())])
        assert action in columns
        place = columns.index(action)
        assert weight[place] > 0.0
        assert edges[place] - 1e-9 <= choices[j] <= edges[place + 1] + 1e-9


@pytest.mark.parametrize("restricted", [False, True])
def test_a_heuristic_of_ones_chooses_as_none_does(restricted: bool) -> None:
    rng = np.random.default_rng(1)
    table = rng.integers(-2, 2, (30, 5)).astype(float)
    index = rng.integers(0, 30, (500, 1)).astype(np.int32)
    degree = np.ones((500, 1))
    allowed = np.ones((500, 5), dtype=bool)
    allowed[:, 1] = rng.random(500) < 0.5
    choice = table, index, degree, 0.3, np.random.default_rng(2)
    mask = allowed if restricted else None
    plain = epsilon_greedy_actions(*choice, mask)
    choice = table, index, degree, 0.3, np.random.default_rng(2)
    led = guided_actions(shares_of(np.ones((30, 5)), 2.0), *choice, mask)
    np.testing.assert_array_equal(led, plain)


def test_each_state_may_explore_as_often_as_it_likes() -> None:
    """The promise says 0, the heuristic 1."""
    table, shares = np.array([[1.0, 0.0]]), shares_of(np.array([[0.0, 1.0]]), 1.0)
    index, degree = np.zeros((2, 1), np.int32), np.ones((2, 1))
    epsilon = np.array([0.0, 1.0])
    rng = np.random.default_rng(0)
    actions = guided_actions(shares, table, index, degree, epsilon, rng)
    assert actions.tolist() == [0, 1]


def test_an_exponent_of_zero_forgets_all_but_what_is_ruled_out() -> None:
    eta = np.array([[0.0, 1.0, 9.0], [2.0, 2.0, 2.0]])
    assert shares_of(eta, 0.0).tolist() == [[0.0, 0.5, 0.5], [1 / 3, 1 / 3, 1 / 3]]
    assert shares_of(eta, 1.0)[0] == pytest.approx([0.0, 0.1, 0.9], abs=1e-15)
    assert shares_of(np.array([[1e-300, 1e300]]), 5.0).tolist() == [[0.0, 1.0]]


def test_shares_of_another_table_are_refused() -> None:
    index, degree = np.zeros((1, 1), np.int32), np.ones((1, 1))
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"shape of the table, \(1, 2\), got \(1, 3\)"):
        guided_actions(np.ones((1, 3)), np.ones((1, 2)), index, degree, 0.1, rng)
    index[:] = 5
    with pytest.raises(ValueError, match=r"cells in 0\.\.0"):
        guided_actions(np.ones((1, 2)), np.ones((1, 2)), index, degree, 0.1, rng)
