"""Arguments of the local searches, and which cities are nearest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acl_gym.colony.local_search import LocalSearch, nearest_neighbours
from acl_gym.envs.graph import TravellingSalesmanInstance

cities = TravellingSalesmanInstance.from_distances

SQUARE = np.array(
    [
        [0.0, 1.0, 2.0, 1.0],
        [1.0, 0.0, 1.0, 2.0],
        [2.0, 1.0, 0.0, 1.0],
        [1.0, 2.0, 1.0, 0.0],
    ]
)
NEAREST = np.array([[1, 3], [0, 2], [1, 3], [0, 2]], np.int32)


def test_nearest_first_and_of_equals_the_lower_number() -> None:
    assert np.array_equal(nearest_neighbours(cities(SQUARE), 2), NEAREST)
    assert nearest_neighbours(cities(SQUARE), 9).tolist() == [
        *([1, 3, 2], [0, 2, 3], [1, 3, 0], [0, 2, 1])
    ]


def test_nearest_neighbours_as_by_sorting() -> None:
    """Rows are from a city to others; many are equally far."""
    distances = np.random.default_rng(0).integers(0, 9, (40, 40)).astype(float)
    apart = distances.copy()
    np.fill_diagonal(apart, np.inf)
    expected = np.argsort(apart, axis=1, kind="stable")[:, :7]
    assert np.array_equal(nearest_neighbours(cities(distances), 7), expected)


@pytest.mark.parametrize("wrong", [SQUARE, "att48", None])
def test_what_is_no_instance(wrong: Any) -> None:
    words = r"^instance must be a TravellingSalesmanInstance, got .*from_distances"
    with pytest.raises(TypeError, match=words):
        nearest_neighbours(wrong, 1)
    with pytest.raises(TypeError, match=words):
        LocalSearch("3-opt", wrong, NEAREST)


def test_wrong_number_of_neighbours() -> None:
    with pytest.raises(ValueError, match=r"^k must be at least 1, got 0"):
        nearest_neighbours(cities(SQUARE), 0)
    with pytest.raises(TypeError, match=r"^k must be an integer, got 1\.5"):
        nearest_neighbours(cities(SQUARE), 1.5)


def changed(row: int, values: list[int]) -> Any:
    neighbours = NEAREST.copy()
    neighbours[row] = values
    return neighbours


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        (NEAREST.astype(np.int64), r"int32 of shape \(4, k\), got an array of int64"),
        (NEAREST[:3], r"int32 of shape \(4, k\), got .* of shape \(3, 2\)"),
        (NEAREST.tolist(), r"int32 of shape \(4, k\), got \[\[1, 3\]"),
        (
            changed(2, [1, 2]),
            r"neighbours\[2\] must be other cities, .* got .*\[1, 2\]",
        ),
        (changed(2, [1, 4]), r"neighbours\[2\] must be other cities"),
        (changed(2, [-1, 1]), r"neighbours\[2\] must be other cities"),
        (changed(2, [0, 1]), r"neighbours\[2\] must be .*nearest first"),
    ],
)
def test_wrong_neighbours(wrong: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        LocalSearch("3-opt", cities(SQUARE), wrong)


def read_only(tours: Any) -> Any:
    tours.flags.writeable = False
    return tours


TOUR = np.array([[0, 2, 1, 3]], np.int32)
TWO_OPT = LocalSearch("2-opt", cities(SQUARE), NEAREST)


@pytest.mark.parametrize(
    "wrong",
    [
        TOUR.tolist(),
        TOUR[0],
        TOUR.astype(np.int64),
        TOUR[:, :3],
        np.repeat(TOUR, 2, axis=1)[:, ::2],
        read_only(TOUR.copy()),
    ],
)
def test_wrong_arrays_of_tours(wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"^tours must be a writable, C-contiguous"):
        TWO_OPT.improve(wrong)


@pytest.mark.parametrize("wrong", [[0, 1, 1, 2], [0, 1, 2, 4], [0, 1, 2, -1]])
def test_rows_that_are_no_tours(wrong: list[int]) -> None:
    tours = np.array([[0, 2, 1, 3], wrong], np.int32)
    with pytest.raises(
        ValueError, match=r"^tours\[1\] must hold each of .* 0 to 3 once"
    ):
        TWO_OPT.improve(tours)


def test_no_tours() -> None:
    assert TWO_OPT.improve(np.empty((0, 4), np.int32)).shape == (0,)


def test_methods() -> None:
    with pytest.raises(ValueError, match=r"one of '2-opt', .* Did you mean '3-opt'\?"):
        LocalSearch("3opt", cities(SQUARE), NEAREST)
    one_way = SQUARE + np.triu(np.ones((4, 4)))
    neighbours = nearest_neighbours(cities(one_way), 2)
    assert not LocalSearch("3-opt", cities(one_way), neighbours).symmetric
    with pytest.raises(ValueError, match=r"^2-opt turns paths round.*take '3-opt'"):
        LocalSearch("2-opt", cities(one_way), neighbours)


def test_a_square_is_walked_round() -> None:
    tours = TOUR.copy()
    assert TWO_OPT.improve(tours).tolist() == [4.0]
