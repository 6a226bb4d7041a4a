"""Local searches against plain references that try every move."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from acl_gym.colony.local_search import (
    METHODS,
    LocalSearch,
    nearest_neighbours,
)
from acl_gym.colony.local_search.improve import improve
from acl_gym.colony.local_search.moves import exchange_segments, find_places, reverse
from acl_gym.envs.graph import TravellingSalesmanInstance

Tour = list[int]


def plane(n: int, seed: int) -> NDArray[np.float64]:
    """Distances of random points in the unit square."""
    points = np.random.default_rng(seed).random((n, 2))
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


def one_way(n: int, seed: int) -> NDArray[np.float64]:
    """Distances without symmetry, geometry or the triangle inequality."""
    return np.random.default_rng(seed).random((n, n))


def whole_numbers(n: int, seed: int) -> NDArray[np.float64]:
    """Symmetric distances of 0 to 3: full of ties, with cities at the same place."""
    half = np.triu(np.random.default_rng(seed).integers(0, 4, (n, n)), 1)
    return (half + half.T).astype(float)


def random_tours(count: int, n: int, seed: int = 0) -> NDArray[np.int32]:
    rng = np.random.default_rng(seed)
    return np.array([rng.permutation(n) for _ in range(count)], np.int32)


def length(tour: Tour, distances: NDArray[np.float64]) -> float:
    return sum(distances[a, b] for a, b in zip(tour, tour[1:] + tour[:1], strict=True))


def with_two_others(tour: Tour) -> Iterator[Tour]:
    """All tours with two other arcs: any path may be turned round."""
    for i, j in itertools.combinations(range(len(tour) + 1), 2):
        yield tour[:i] + tour[i:j][::-1] + tour[j:]


def with_exchanged_segments(tour: Tour) -> Iterator[Tour]:
    """All tours in which two neighbouring segments have changed places."""
    for i, j, k in itertools.combinations(range(len(tour) + 1), 3):
        yield tour[:i] + tour[j:k] + tour[i:j] + tour[k:]


def with_three_others(tour: Tour) -> Iterator[Tour]:
    """All tours with two or three other arcs."""
    yield from with_two_others(tour)
    yield from with_exchanged_segments(tour)
    for i, j, k in itertools.combinations(range(len(tour) + 1), 3):
        left, right = tour[i:j], tour[j:k]
        for middle in (
            left[::-1] + right[::-1],
            right + left[::-1],
            right[::-1] + left,
        ):
            yield tour[:i] + middle + tour[k:]


def with_segment_elsewhere(
    tour: Tour, distances: NDArray[np.float64], turned: bool
) -> Iterator[Tour]:
    """Moves of one to three cities of which an end comes nearer to its neighbour.

    In one direction it is the last city, whose next one comes nearer.
    """
    n = len(tour)
    for start, size in itertools.product(range(n), range(1, min(3, n - 3) + 1)):
        around = tour[start:] + tour[:start]
        segment, rest = around[:size], around[size:]
        for cut in range(1, len(rest)):
            before, after = rest[cut - 1], rest[cut]
            first = distances[segment[0], before] < distances[segment[0], rest[-1]]
            last = distances[segment[-1], after] < distances[segment[-1], rest[0]]
            if last or (turned and first):
                yield rest[:cut] + segment + rest[cut:]
            first = distances[segment[0], after] < distances[segment[0], rest[-1]]
            last = distances[segment[-1], before] < distances[segment[-1], rest[0]]
            if turned and (first or last):
                yield rest[:cut] + segment[::-1] + rest[cut:]


def around(
    method: str, tour: Tour, distances: NDArray[np.float64], symmetric: bool
) -> Iterator[Tour]:
    """The neighbourhood of a tour that a method must have searched."""
    if method == "or-opt":
        yield from with_segment_elsewhere(tour, distances, symmetric)
    if symmetric:
        yield from (with_three_others if method == "3-opt" else with_two_others)(tour)
    elif method == "3-opt":
        yield from with_exchanged_segments(tour)


cities = TravellingSalesmanInstance.from_distances


def searching(method: str, distances: NDArray[np.float64], k: int) -> LocalSearch:
    """A search that looks at the k nearest neighbours of each city."""
    instance = cities(distances)
    return LocalSearch(method, instance, nearest_neighbours(instance, k))


CASES = [
    (method, make)
    for method in METHODS
    for make in (plane, whole_numbers, one_way)
    if not (method == "2-opt" and make is one_way)
]


@pytest.mark.parametrize("n", range(2, 9))
@pytest.mark.parametrize(("method", "make"), CASES)
def test_no_move_is_left(method: str, make: type, n: int) -> None:
    """With all cities as candidates; the result is a tour, and no longer than before."""
    for seed in range(5):
        distances = make(n, seed)
        search = searching(method, distances, n)
        tours = random_tours(6, n, seed)
        before = [length(tour, distances) for tour in tours.tolist()]
        lengths, looked_at = search.improve(tours), None
        # Don't-look bits may leave moves, which are found where all are looked at again.
        while not np.array_equal(tours, looked_at):
            looked_at = tours.copy()
            lengths = search.improve(tours)
        assert (np.sort(tours) == np.arange(n)).all()
        # The sum of the same arcs from another city on may round otherwise.
        assert (lengths <= np.array(before) * (1 + 1e-15 * n)).all()
        for tour, found in zip(tours.tolist(), lengths, strict=True):
            assert found == pytest.approx(length(tour, distances), rel=1e-12)
            others = around(method, tour, distances, make is not one_way)
            # Sums of eight distances are exact to 1e-14.
            assert all(length(other, distances) > found - 1e-12 for other in others)


@pytest.mark.parametrize(("method", "make"), CASES)
def test_larger_instances(method: str, make: type) -> None:
    """With lists and don't-look bits: tours, of the lengths said, much shorter."""
    distances = make(120, 1)
    tours = random_tours(8, 120)
    before = np.array([length(tour, distances) for tour in tours.tolist()])
    lengths = searching(method, distances, 10).improve(tours)
    assert (np.sort(tours) == np.arange(120)).all()
    found = [length(tour, distances) for tour in tours.tolist()]
    assert lengths == pytest.approx(found, rel=1e-12)
    # Random tours are 5 to 7 times as long as the best of points in a square.
    assert (lengths < 0.6 * before).all()


def test_quality() -> None:
    """Mean gaps to the shortest tours, of random uniform instances, from random tours.

    Long runs of a Max-Min Ant System with 3-opt came to tours of 16.556, 16.710 and
    16.425. From random tours the literature has gaps of ten to fifteen per cent for
    2-opt, about six for 2-opt with Or-opt and three to four for 3-opt.
    """
    shortest = (16.556, 16.710, 16.425)
    gaps = {}
    for method in METHODS:
        found = []
        for seed, best in enumerate(shortest):
            distances = plane(500, seed)
            search = searching(method, distances, 12)
            lengths = search.improve(random_tours(5, 500, seed))
            # A tour shorter than those would be none.
            assert (lengths > 0.995 * best).all()
            found.append(lengths.mean() / best - 1)
        gaps[method] = np.mean(found)
    assert gaps["3-opt"] < 0.045 < gaps["or-opt"] < 0.07 < gaps["2-opt"] < 0.15


def test_tours_do_not_depend_on_each_other() -> None:
    distances = plane(60, 0)
    search = searching("3-opt", distances, 8)
    together, alone = random_tours(4, 60), random_tours(4, 60)
    lengths = search.improve(together)
    assert lengths.tolist() == [search.improve(alone[i : i + 1])[0] for i in range(4)]
    assert np.array_equal(together, alone)


def test_all_cities_at_one_place() -> None:
    distances = np.zeros((20, 20))
    tours = random_tours(3, 20)
    before = tours.copy()
    search = searching("3-opt", distances, 5)
    assert search.improve(tours).tolist() == [0.0, 0.0, 0.0]
    assert np.array_equal(tours, before)


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_any_unit_of_length(scale: float) -> None:
    """What is a gain does not depend on the unit; the result is the same tour."""
    distances = plane(60, 0)
    neighbours = nearest_neighbours(cities(distances), 8)
    expected, tours = random_tours(4, 60), random_tours(4, 60)
    LocalSearch("3-opt", cities(distances), neighbours).improve(expected)
    LocalSearch("3-opt", cities(distances * scale), neighbours).improve(tours)
    # Scaling rounds: nearly equal gains may be exchanged, in few tours if any.
    lengths = [length(tour, distances) for tour in tours.tolist()]
    expected_lengths = [length(tour, distances) for tour in expected.tolist()]
    assert lengths == pytest.approx(expected_lengths, rel=0.02)


def test_the_kernel_as_plain_python() -> None:
    distances = plane(30, 0)
    neighbours = nearest_neighbours(cities(distances), 6)
    nearby = np.take_along_axis(distances, neighbours, axis=1)
    compiled, plain = random_tours(2, 30), random_tours(2, 30)
    lengths, others = np.empty(2), np.empty(2)
    arguments = (distances, neighbours, nearby, 2, True)
    improve(compiled, *arguments, lengths)
    improve.py_func(plain, *arguments, others)
    assert np.array_equal(compiled, plain)
    assert np.array_equal(lengths, others)


@pytest.mark.parametrize("n", [5, 8])
def test_segments_change_places(n: int) -> None:
    """Wherever they lie and whichever is longest; walked round, it is the same tour."""
    for kernel in (exchange_segments, exchange_segments.py_func):
        for first, left in itertools.product(range(n), range(1, n)):
            for right in range(1, n - left + 1):
                tour = np.arange(n, dtype=np.int32)
                places = np.arange(n, dtype=np.int32)
                kernel(tour, places, first, left, right, np.empty(n, np.int32))
                turned = np.roll(np.arange(n), -first).tolist()
                expected = turned[left : left + right] + turned[:left]
                expected += turned[left + right :]
                start = tour.tolist().index(expected[0])
                assert np.roll(tour, -start).tolist() == expected
                assert np.array_equal(tour[places], np.arange(n))


@pytest.mark.parametrize("n", [5, 8])
def test_paths_are_turned_round(n: int) -> None:
    """The path or all others: in one direction or the other, it is the same tour."""
    for kernel in (reverse, reverse.py_func):
        for first, last in itertools.product(range(n), range(n)):
            tour = np.arange(n, dtype=np.int32)
            places = np.arange(n, dtype=np.int32)
            kernel(tour, places, first, last)
            turned = np.roll(np.arange(n), -first).tolist()
            size = (last - first) % n + 1
            expected = turned[:size][::-1] + turned[size:]
            start = tour.tolist().index(expected[0])
            found = np.roll(tour, -start).tolist()
            assert expected in (found, found[:1] + found[:0:-1])
            assert np.array_equal(tour[places], np.arange(n))


def test_what_is_no_tour() -> None:
    places = np.empty(3, np.int32)
    assert find_places(np.array([2, 0, 1], np.int32), places)
    assert places.tolist() == [1, 2, 0]
    for wrong in ([0, 1, 1], [0, 1, 3], [-1, 0, 1]):
        assert not find_places(np.array(wrong, np.int32), places)
