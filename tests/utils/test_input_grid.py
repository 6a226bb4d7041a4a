"""Actions on a grid, and the neighbours of each."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.utils.input_grid import InputGrid


def neighbour(values: np.ndarray, action: int, axis: int, sign: int) -> int:
    """The nearest action on one side whose other inputs are alike, by looking at all."""
    alike = np.delete(values == values[action], axis, axis=1).all(axis=1)
    ahead = sign * (values[:, axis] - values[action, axis])
    candidates = np.flatnonzero(alike & (ahead > 0))
    return int(candidates[np.argmin(ahead[candidates])]) if candidates.size else -1


@given(
    st.lists(st.integers(1, 5), min_size=1, max_size=3),
    st.integers(0, 2**32 - 1),
)
def test_neighbours_in_any_order(counts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    axes = [rng.normal(size=n) for n in counts]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(counts))
    points = rng.permutation(points)
    grid = InputGrid(points)
    assert grid.counts == tuple(counts)
    np.testing.assert_array_equal(grid.values, points)
    for axis, values in enumerate(axes):
        np.testing.assert_array_equal(grid.axes[axis], np.sort(values))
        for action in range(len(points)):
            assert grid.below[action, axis] == neighbour(points, action, axis, -1)
            assert grid.above[action, axis] == neighbour(points, action, axis, 1)


def test_a_single_input_may_be_a_row() -> None:
    grid = InputGrid([3.0, 1.0, 2.0])
    assert grid.below.ravel().tolist() == [2, -1, 1]
    assert repr(grid) == "InputGrid(3)"


def test_it_cannot_be_changed() -> None:
    given_values = np.array([[0.0], [1.0]])
    grid = InputGrid(given_values)
    given_values[:] = 7.0
    assert grid.values.tolist() == [[0.0], [1.0]]
    for array in (grid.values, grid.below, grid.above, grid.axes[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(AttributeError, match="fixed"):
        grid.below = grid.above


@pytest.mark.parametrize(
    "values",
    [
        [[0.0, 0.0], [1.0, 1.0]],
        [[0.0], [0.0]],
        np.empty((0, 1)),
        np.empty((3, 0)),
        np.zeros((2, 2, 2)),
        5.0,
        "ab",
        [1e300, 0.0],
        # 2^62 points: the product must not overflow.
        np.arange(62 * 4.0).reshape(4, 62),
    ],
)
def test_what_is_no_grid(values: object) -> None:
    with pytest.raises(ValueError, match="inputs must"):
        InputGrid(values)
