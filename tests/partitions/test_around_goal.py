"""Cells that become smaller towards a goal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.partitions.around_goal import CELLS, partition_around_goal

BOUND = np.array([5.0, 2.0, 5.0, 2.0])
HALF = np.array([0.25, 0.05, 0.25, 0.05])


def test_centres_are_at_the_goal_and_its_ends_and_at_the_bounds() -> None:
    found = partition_around_goal(-BOUND, BOUND, -HALF, HALF)
    assert found is not None
    assert [len(axis) for axis in found.centres] == [CELLS[4]] * 4
    for axis, bound, half in zip(found.centres, BOUND, HALF, strict=True):
        np.testing.assert_allclose(axis, -axis[::-1], rtol=1e-12)
        assert axis[[0, 2, 4]].tolist() == [-bound, 0.0, bound]
        assert axis[3] == pytest.approx(half)


def test_distances_from_the_goal_grow_by_equal_factors() -> None:
    found = partition_around_goal([-9.0] * 3, [9.0] * 3, [-0.5] * 3, [0.5] * 3)
    assert found is not None
    for axis in found.centres:
        factors = axis[6:] / axis[5:-1]
        assert len(factors) == CELLS[3] // 2 - 1
        np.testing.assert_allclose(factors, factors[0])


@settings(max_examples=50, deadline=None)
@given(st.integers(3, 6), st.integers(0, 2**32 - 1))
def test_a_goal_anywhere_within_any_bounds(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.01, 1.0, (4, n)) * [[1], [1], [0.05], [1]], axis=0)
    low, goal_low, goal_high, high = points
    found = partition_around_goal(low, high, goal_low, goal_high)
    even = (high - low) / (CELLS[n] - 1)
    assert (found is None) == bool((goal_high - goal_low >= even).all())
    if found is not None:
        for axis, bounds in zip(found.centres, points.T, strict=True):
            assert (np.diff(axis) > 0).all()
            assert (axis[0], axis[-1]) == (bounds[0], bounds[3])
            for end in bounds[1:3]:
                assert np.abs(axis - end).min() < 1e-9


@pytest.mark.parametrize(
    ("low", "high", "goal_low", "goal_high"),
    [
        pytest.param([-1] * 2, [1] * 2, [-0.01] * 2, [0.01] * 2, id="two variables"),
        pytest.param([-1] * 7, [1] * 7, [-0.01] * 7, [0.01] * 7, id="seven"),
        pytest.param([-1] * 4, [1] * 4, [-0.5] * 4, [0.5] * 4, id="a large goal"),
        pytest.param([-1] * 4, [np.inf] * 4, [-0.1] * 4, [0.1] * 4, id="no bounds"),
        pytest.param([-1] * 4, [1] * 4, [-1] * 4, [0.1] * 4, id="a goal at a bound"),
    ],
)
def test_otherwise_an_even_grid_is_as_good(
    low: list[float], high: list[float], goal_low: list[float], goal_high: list[float]
) -> None:
    assert partition_around_goal(low, high, goal_low, goal_high) is None
