"""Interactions of a user's own, which no kernel sums."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm import Everyone, Links, Radius, run
from acl_gym.swarm.aggregation import (
    AggregatingAgents,
    BoundedRepulsion,
    Field,
    Interaction,
    UnboundedRepulsion,
    flow,
    forces_over_links,
    forces_within,
)
from tests.swarm.aggregation.cases import interactions, positions


class Own(Interaction):
    """What another interaction does, out of the sight of the kernels."""

    def __init__(self, law: Interaction) -> None:
        self.law = law

    def net_attraction(self, distance: Any) -> np.ndarray:
        return self.law.net_attraction(distance)


class Stiff(BoundedRepulsion):
    """A hundred times as strong a pull, with parameters that kernels know."""

    def net_attraction(self, distance: Any) -> np.ndarray:
        return np.full(np.shape(distance), 100.0)


class Spring(Interaction):
    """A rest length of 1."""

    def net_attraction(self, distance: Any) -> np.ndarray:
        return 1.0 - 1.0 / np.maximum(distance, 1e-9)


def assert_close(one: np.ndarray, other: np.ndarray, most: float = 1e-9) -> None:
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=most)


@given(st.data(), positions(axes=3))
def test_the_sums_are_those_of_the_kernels(data: st.DataObject, x: np.ndarray) -> None:
    n = len(x)
    law = data.draw(interactions(n))
    heard = x + data.draw(st.sampled_from([0.0, 0.3]))
    pairs = data.draw(
        st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)), max_size=60)
    )
    for links in (
        Links.everyone(n),
        Links.everyone(n, include_self=False),
        Links.from_pairs(n, *np.reshape(pairs, (-1, 2)).T.astype(int)),
    ):
        wanted = forces_over_links(x, heard, links, law)
        assert_close(forces_over_links(x, heard, links, Own(law)), wanted)
    for radius in (np.inf, 0.7):
        wanted = forces_within(x, law, radius)
        assert_close(forces_within(x, Own(law), radius), wanted)


def test_what_a_subclass_changes_counts() -> None:
    x = [[0.0, 0.0], [1.0, 0.0]]
    assert Stiff()([1.0, 0.0]).tolist() == [-100.0, 0.0]
    assert forces_within(x, Stiff()).tolist() == [[100.0, 0.0], [-100.0, 0.0]]
    assert forces_within(x, Stiff(), 2.0).tolist() == [[100.0, 0.0], [-100.0, 0.0]]


def test_a_subclass_that_changes_nothing_is_left_to_the_kernels() -> None:
    class Named(BoundedRepulsion):
        """Has another name."""

    x = np.random.default_rng(0).normal(size=(30, 2))
    assert np.array_equal(
        forces_within(x, Named(), 1.0), forces_within(x, BoundedRepulsion(), 1.0)
    )


@pytest.mark.parametrize("channel", [Everyone(), Radius(5.0)])
def test_a_swarm_with_an_interaction_of_its_own(channel: Any) -> None:
    field = Field([[0.0, 0.0], [3.0, 0.0]], time_step=0.1)
    run(AggregatingAgents(Spring()), field, 200, channel=channel)
    assert_close(np.ptp(field.positions, axis=0), np.array([1.0, 0.0]))
    end = flow([[0.0, 0.0], [3.0, 0.0]], Spring(), [20.0])[0]
    assert_close(end, np.array([[1.0, 0.0], [2.0, 0.0]]))


def test_a_law_returns_a_number_for_each_distance() -> None:
    class Lame(Interaction):
        result: Any = None

        def net_attraction(self, distance: Any) -> Any:
            return self.result

    law, x = Lame(), [[0.0, 0.0], [1.0, 0.0]]
    for bad, message in (
        (None, "net_attraction of Lame must return numbers"),
        ("a", "net_attraction of Lame must return numbers"),
        ([1.0, 2.0, 3.0], r"must have the shape of the distances, \(2,\), got \(3,\)"),
        (np.nan, "must be finite, got .* for agent 0"),
    ):
        law.result = bad
        with pytest.raises(ValueError, match=message):
            forces_within(x, law)


def test_y_has_a_row_for_each_agent_whose_parameters_differ() -> None:
    law = BoundedRepulsion(attraction=[1.0, 2.0, 3.0])
    assert law(np.ones((3, 2))).shape == (3, 2)
    with pytest.raises(ValueError, match=r"need y with a row for each"):
        law([1.0, 0.0])
    with pytest.raises(ValueError, match="y must have an axis of coordinates"):
        law(1.0)


@pytest.mark.parametrize("radius", [np.inf, 1.0])
def test_a_push_that_no_float_can_hold_is_an_error(radius: float) -> None:
    with pytest.raises(ValueError, match=r"must be finite, got .* for agent 0"):
        forces_within([[0.0, 0.0], [1e-160, 0.0]], UnboundedRepulsion(), radius)
