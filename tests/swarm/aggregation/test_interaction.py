"""Attraction and repulsion between two agents, (6.5)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acl_gym.swarm.aggregation import BoundedRepulsion, Interaction, UnboundedRepulsion
from tests.swarm.aggregation import reference
from tests.swarm.aggregation.cases import interactions

BOTH = pytest.mark.parametrize(
    "interaction", [BoundedRepulsion(), UnboundedRepulsion()]
)


@given(st.data(), st.integers(1, 5), st.integers(1, 3))
def test_g_is_that_of_the_equation(data: st.DataObject, n: int, dim: int) -> None:
    interaction = data.draw(interactions(n))
    y = data.draw(arrays(np.float64, (n, dim), elements=st.floats(-4.0, 4.0)))
    y[np.abs(y) < 1e-100] = 0.0  # whose squares are 0 in floats
    wanted = [reference.g(interaction, i, row) for i, row in enumerate(y)]
    np.testing.assert_allclose(interaction(y), wanted, rtol=1e-12, atol=1e-13)


@BOTH
def test_it_is_odd_and_nothing_where_two_are_in_one_place(
    interaction: Interaction,
) -> None:
    y = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_array_equal(interaction(-y), -interaction(y))
    assert interaction([0.0, 0.0]).tolist() == [0.0, 0.0]


@BOTH
def test_it_is_the_descent_of_its_potential(interaction: Interaction) -> None:
    r, step = np.linspace(0.3, 4.0, 40), 1e-5
    slope = interaction.potential(r + step) - interaction.potential(r - step)
    along = interaction(np.stack([r, np.zeros_like(r)], axis=1))[:, 0]
    np.testing.assert_allclose(along, -slope / (2 * step), rtol=1e-7, atol=1e-8)


@BOTH
def test_it_vanishes_at_rest_and_attracts_beyond(interaction: Interaction) -> None:
    delta = interaction.rest_distance
    assert abs(float(interaction.net_attraction(delta))) < 1e-13
    assert interaction.net_attraction(1.01 * delta) > 0
    assert interaction.net_attraction(0.99 * delta) < 0


def test_rest_distances() -> None:
    assert float(BoundedRepulsion().rest_distance) == math.sqrt(0.2 * math.log(20.0))
    assert round(float(BoundedRepulsion().rest_distance), 4) == 0.7740
    assert float(UnboundedRepulsion(repulsion=9.0).rest_distance) == 3.0
    several = BoundedRepulsion(attraction=[1.0, 2.0, 0.0], repulsion=[0.5, 0.0, 1.0])
    assert several.rest_distance.tolist() == [0.0, 0.0, math.inf]
    nothing = {"attraction": 0.0, "repulsion": 0.0}
    assert BoundedRepulsion(**nothing).rest_distance == 0.0
    assert UnboundedRepulsion(**nothing).rest_distance == 0.0


@pytest.mark.parametrize("kind", [BoundedRepulsion, UnboundedRepulsion])
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("attraction", -1.0, r"attraction must lie in \[0, inf\), got -1"),
        ("attraction", math.inf, r"attraction must lie in \[0, inf\), got inf"),
        ("repulsion", math.nan, r"repulsion must lie in \[0, inf\), got nan"),
        ("repulsion", [[1.0]], "repulsion must be a number, or one for each"),
        ("repulsion", "b", "repulsion must be an array of real numbers, got 'b'"),
    ],
)
def test_what_is_no_parameter_is_refused(
    kind: Any, name: str, value: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        kind(**{name: value})


def test_a_spread_is_positive() -> None:
    with pytest.raises(ValueError, match=r"spread must lie in \[1e-300, inf\), got 0"):
        BoundedRepulsion(spread=0.0)


def test_parameters_are_for_as_many_agents_as_there_are() -> None:
    interaction = BoundedRepulsion(repulsion=[1.0, 2.0, 3.0])
    assert interaction.coefficients(3).repulsion.tolist() == [1.0, 2.0, 3.0]
    assert interaction.coefficients(3).rate.tolist() == [5.0] * 3
    message = "repulsion must be a number or have one value for each of the 4 agents"
    with pytest.raises(ValueError, match=message):
        interaction.coefficients(4)
    given = np.array([1.0, 2.0])
    kept = UnboundedRepulsion(attraction=given)
    given[:] = 5.0
    assert kept.coefficients(2).attraction.tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        kept.attraction[0] = 3.0  # type: ignore[index]


@BOTH
@pytest.mark.parametrize(
    "bad", [math.nan, math.inf, 1e200, 1j, "near", None, [[1.0], [1.0, 2.0]]], ids=repr
)
def test_distances_that_are_none_are_refused(
    interaction: Interaction, bad: Any
) -> None:
    for call in (interaction.net_attraction, interaction.potential):
        with pytest.raises(ValueError, match="distance must"):
            call(bad)
    with pytest.raises(ValueError, match="y must"):
        interaction([bad, 0.0])


@BOTH
def test_distances_are_not_negative(interaction: Interaction) -> None:
    with pytest.raises(ValueError, match="distance must be >= 0, got -1"):
        interaction.net_attraction([1.0, -1.0])


@BOTH
def test_extreme_distances_have_finite_pushes(interaction: Interaction) -> None:
    assert np.isfinite(interaction.potential([1e-160, 1e150])).all()
    assert interaction.net_attraction(1e150) == 1.0
    assert not np.isnan(interaction.net_attraction(1e-160))
