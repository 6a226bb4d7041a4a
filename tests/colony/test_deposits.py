"""What ants deposit for a cost: against definitions, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.colony.deposits import (
    FunctionDeposit,
    InverseCost,
    Rank,
    Return,
    as_deposit,
    deposit_from_settings,
)
from acl_gym.utils.serialization import to_settings

Costs = st.lists(st.integers(-20, 20), min_size=1, max_size=12).map(
    lambda values: np.array(values, dtype=np.float64)
)


@given(Costs)
def test_the_inverse_cost_with_an_offset(costs: np.ndarray) -> None:
    np.testing.assert_allclose(
        InverseCost(offset=21.0)(costs, 1e-4), [1 / (cost + 21) for cost in costs]
    )


@pytest.mark.parametrize("cost", [0.0, -0.0, -3.5, 1e-310, np.nan, np.inf, -np.inf])
def test_a_cost_that_cannot_be_inverted_is_refused(cost: float) -> None:
    with pytest.raises(ValueError, match=r"> 0 and finite.* got .* for ant 1\. Where"):
        InverseCost()(np.array([1.0, cost, 2.0]), 1e-4)


@given(Costs)
def test_the_return_deposits_more_than_tau0(costs: np.ndarray) -> None:
    costs = -np.abs(costs)
    np.testing.assert_allclose(Return()(costs, 0.5), [0.5 - cost for cost in costs])


def test_a_negative_return_is_no_deposit() -> None:
    with pytest.raises(ValueError, match=r"never negative, got -2 for ant 1.*rank"):
        Return()(np.array([-1.0, 2.0]), 1e-4)


@given(Costs, st.sampled_from([1.0, 2.0]))
def test_the_rank_is_the_share_of_the_others_outdone(
    costs: np.ndarray, exponent: float
) -> None:
    deposits = Rank(exponent)(costs, 0.25)
    for ant, cost in enumerate(costs):
        others = np.delete(costs, ant)
        share = 1.0
        if others.size:
            share = np.mean((others > cost) + 0.5 * (others == cost))
        assert deposits[ant] == pytest.approx(0.25 + share**exponent)


@given(Costs)
def test_the_rank_looks_at_the_order_only(costs: np.ndarray) -> None:
    np.testing.assert_array_equal(
        Rank()(costs, 0.1), Rank()(np.exp(costs / 10) - 100.0, 0.1)
    )


@pytest.mark.parametrize("name", ["inverse_cost", "return", "rank"])
def test_deposits_have_names_and_survive_a_file(name: str) -> None:
    deposit = as_deposit(name)
    assert deposit_from_settings(to_settings(deposit)) == deposit
    assert as_deposit(deposit) is deposit


def test_a_function_of_the_costs_is_a_deposit() -> None:
    deposit = as_deposit(lambda costs: 2.0**-costs)
    np.testing.assert_allclose(deposit(np.array([1.0, 3.0]), 1e-4), [0.5, 0.125])
    restored = deposit_from_settings(to_settings(deposit))
    with pytest.raises(ValueError, match=r"a file cannot hold; set agent\.deposit"):
        restored(np.array([1.0]), 1e-4)


@pytest.mark.parametrize(
    "result", [0.0, [1.0], [1.0, 0.0], [1.0, np.nan], [1.0, -1.0], [[1.0, 2.0]]]
)
def test_a_function_that_gives_no_deposits_is_refused(result: object) -> None:
    with pytest.raises(ValueError, match="a finite number > 0 for each of the 2 ants"):
        FunctionDeposit(lambda _: result)(np.array([1.0, 2.0]), 1e-4)  # type: ignore[arg-type,return-value]


def test_other_things_are_no_deposits() -> None:
    with pytest.raises(ValueError, match="'inverse_cost', 'return', 'rank'"):
        as_deposit("reward")
    for wrong in (None, 3, Rank):
        with pytest.raises(TypeError, match="deposit must be one of"):
            as_deposit(wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="deposit must be one of"):
        deposit_from_settings({"type": "Path"})
    with pytest.raises(ValueError, match="deposit must be a Deposit"):
        deposit_from_settings(3)
    with pytest.raises(ValueError, match="exponent"):
        Rank(0.0)
