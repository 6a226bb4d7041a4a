"""Instances: distances by metric, what is refused, and the data of the package."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from itertools import permutations
from typing import Any

import networkx as nx
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

from acl_gym.envs.graph import (
    TravellingSalesmanInstance,
    load_instance,
    optimal_tour,
)
from acl_gym.envs.graph.instances import OPTIMA

ASYMMETRIC = [[0, 1, 9], [2, 0, 3], [4, 8, 0]]
NAN, INF = float("nan"), float("inf")
WITH_TOUR = [name for name in OPTIMA if name != "lin318"]  # TSPLIB has none of it


def made(distances: Any, **keywords: Any) -> TravellingSalesmanInstance:
    return TravellingSalesmanInstance.from_distances(distances, **keywords)


def degrees(value: float) -> float:
    """TSPLIB's radians of DDD.MM, with its own pi."""
    whole = math.trunc(value)
    return 3.141592 * (whole + 5.0 * (value - whole) / 3.0) / 180.0


def reference(a: list[float], b: list[float], metric: str) -> float:
    """The distance between two cities as TSPLIB's description computes it."""
    dx, dy = a[0] - b[0], a[1] - b[1]
    if metric == "att":
        exact = math.sqrt((dx * dx + dy * dy) / 10.0)
        rounded = math.floor(exact + 0.5)
        return rounded + 1 if rounded < exact else rounded
    if metric == "geo":
        q1 = math.cos(degrees(a[1]) - degrees(b[1]))
        q2 = math.cos(degrees(a[0]) - degrees(b[0]))
        q3 = math.cos(degrees(a[0]) + degrees(b[0]))
        cosine = 0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3)
        return math.trunc(6378.388 * math.acos(min(cosine, 1.0)) + 1.0)
    exact = math.sqrt(dx * dx + dy * dy)
    if metric == "euc_2d":
        return math.floor(exact + 0.5)
    return math.ceil(exact) if metric == "ceil_2d" else exact


@pytest.mark.parametrize("metric", ["euclidean", "euc_2d", "ceil_2d", "att", "geo"])
def test_distances_are_those_of_tsplib(metric: str) -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-90, 90, (30, 2)).round(2)
    places[5] = places[6]  # two cities in one place
    found = TravellingSalesmanInstance.from_coordinates(places, metric).distances
    rows = places.tolist()
    wanted = [[reference(a, b, metric) for b in rows] for a in rows]
    np.fill_diagonal(array := np.array(wanted, dtype=np.float64), 0.0)
    np.testing.assert_array_equal(found, array)


def test_halves_are_rounded_up() -> None:
    # NumPy's rint would give 2 for 2.5.
    places = [[0.0, 0.0], [2.5, 0.0]]
    made = TravellingSalesmanInstance.from_coordinates(places, "euc_2d")
    assert made.distances[0, 1] == 3.0


@pytest.mark.parametrize("name", OPTIMA)
def test_instances_of_the_package(name: str) -> None:
    found = load_instance(name)
    assert found.name == name
    assert found.n_cities == int("".join(filter(str.isdigit, name)))
    assert found.symmetric
    assert found.coordinates is not None
    assert found.optimum == OPTIMA[name]
    assert (found.distances == np.round(found.distances)).all()
    assert load_instance(name) is found


@pytest.mark.parametrize("name", WITH_TOUR)
def test_optimal_tours_have_the_known_length(name: str) -> None:
    tour = optimal_tour(name)
    assert tour.dtype == np.int32
    assert load_instance(name).length(tour) == OPTIMA[name]
    assert optimal_tour(name) is not tour


def test_known_lengths() -> None:
    lengths = {"att48": 10_628, "eil51": 426, "kroA100": 21_282, "lin318": 42_029}
    assert {**lengths, "pr2392": 378_032} == OPTIMA


def test_the_first_arcs_of_lin318() -> None:
    # There is no optimal tour to check its distances with. By hand:
    # (63, 71) -> (94, 71) -> (142, 370) -> (173, 1276).
    distances = load_instance("lin318").distances
    assert distances[[0, 1, 2], [1, 2, 3]].tolist() == [31.0, 303.0, 907.0]


def test_unknown_names() -> None:
    with pytest.raises(ValueError, match=r"instance must be one of .*'eil51'\?"):
        load_instance("eil50")
    with pytest.raises(ValueError, match="instance must be one of"):
        optimal_tour("lin318")


def test_lengths_are_added_up_in_the_order_of_the_steps() -> None:
    """As rewards are, so that a best tour has the cost of the ant that found it."""
    rng = np.random.default_rng(3)
    instance = TravellingSalesmanInstance.from_distances(rng.random((40, 40)) + 1e-3)
    tours = np.stack([rng.permutation(40) for _ in range(50)])
    found = instance.length(tours)
    assert isinstance(found, np.ndarray)
    for tour, length in zip(tours, found, strict=True):
        total = 0.0
        for city, following in zip(tour, [*tour[1:], tour[0]], strict=True):
            total += instance.distances[city, following]
        assert length == total
        assert instance.length(tour) == total
    assert instance.length(tours[:0]).shape == (0,)  # type: ignore[union-attr]


def test_lengths_of_tours_are_sums_with_the_closing_arc() -> None:
    instance = made(ASYMMETRIC)
    assert not instance.symmetric
    tours = list(permutations(range(3)))
    lengths = instance.length(np.array(tours, dtype=np.int32))
    for tour, length in zip(tours, np.asarray(lengths), strict=True):
        arcs = zip(tour, (*tour[1:], tour[0]), strict=True)
        assert length == sum(ASYMMETRIC[i][j] for i, j in arcs)
        assert instance.length(tour) == length
    assert isinstance(instance.length([0, 1, 2]), float)


@pytest.mark.parametrize(
    "tour",
    [
        [0, 1],
        [0, 1, 1],
        [0, 1, 3],
        [-1, 0, 1],
        [0, 1, 2, 0],
        [0.0, 1.0, 2.0],
        "012",
        None,
        [[[0, 1, 2]]],
        [[0, 1, 2], [0, 0, 2]],
        np.array([0, 1, 2**63], dtype=np.uint64),
    ],
)
def test_what_is_no_tour_is_refused(tour: Any) -> None:
    with pytest.raises(ValueError, match=r"tour must hold .*0\.\.2"):
        made(ASYMMETRIC).length(tour)


@pytest.mark.parametrize("diagonal", [0.0, -1.0, NAN, INF, 9999.0])
def test_the_diagonal_does_not_count(diagonal: float) -> None:
    matrix = np.array(ASYMMETRIC, dtype=np.float64)
    np.fill_diagonal(matrix, diagonal)
    assert made(matrix) == made(ASYMMETRIC)
    assert matrix[0, 0] == diagonal or math.isnan(diagonal)  # the caller's array


@pytest.mark.parametrize(
    ("bad", "words"),
    [(-1.0, "got -1"), (NAN, "got nan"), (INF, "got inf"), (1e308, r"got 1e\+308")],
)
def test_bad_distances_are_named(bad: float, words: str) -> None:
    matrix = np.array(ASYMMETRIC, dtype=np.float64)
    matrix[2, 0] = bad
    with pytest.raises(
        ValueError, match=f"finite, >= 0.*{words} from city 2 to city 0"
    ):
        made(matrix)


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.0]],
        [],
        [[0, 1]],
        [[0, 1], [1, 0], [1, 1]],
        [0, 1],
        "matrix",
        None,
        [["a", "b"], ["c", "d"]],
        [[1j, 1], [1, 1]],
        [[True, False], [False, True]],
        np.broadcast_to(1.0, (200_000, 200_000)),
    ],
)
def test_what_is_no_matrix_is_refused(matrix: Any) -> None:
    with pytest.raises(
        ValueError, match=r"distances must|must have 2 to|must fit into"
    ):
        made(matrix)


@pytest.mark.parametrize(
    "places",
    [
        [[0.0, 0.0]],
        [[0.0, 0.0], [1.0, NAN]],
        [[0.0], [1.0]],
        [0.0, 1.0],
        [[0.0, 0.0], [1e200, 0.0]],  # its square is infinite
        None,
    ],
)
def test_bad_coordinates_are_refused(places: Any) -> None:
    with pytest.raises(
        ValueError, match=r"coordinates must|must have 2 to|must be fin"
    ):
        TravellingSalesmanInstance.from_coordinates(places)


def test_the_city_whose_coordinates_are_no_numbers_is_named() -> None:
    places = np.random.default_rng(0).random((500, 2))
    places[321] = 3.5, NAN
    with pytest.raises(
        ValueError, match=r"got \[3\.5, nan\] for city 321 of 0 to 499;"
    ):
        TravellingSalesmanInstance.from_coordinates(places)


def test_how_distances_differ() -> None:
    distances = np.arange(9.0).reshape(3, 3)
    instance = made(distances)
    assert instance.difference(made(distances)) is None
    assert instance.fingerprint == made(distances).fingerprint
    assert len(instance.fingerprint) == 32
    other = distances.copy()
    other[2, 1] = 0.1
    assert made(other).difference(instance) == (
        "a distance of 0.1 from city 2 to city 1 in place of 7.0"
    )
    assert made(other).fingerprint != instance.fingerprint
    assert made(np.ones((2, 2))).difference(instance) == "2 cities in place of 3"


def test_other_bad_arguments() -> None:
    with pytest.raises(ValueError, match="metric must be one of 'euclidean'"):
        TravellingSalesmanInstance.from_coordinates([[0, 0], [1, 1]], "taxi")
    with pytest.raises(ValueError, match="a row for each of the 3 cities, got 2"):
        made(ASYMMETRIC, coordinates=[[0, 0], [1, 1]])
    with pytest.raises(ValueError, match="optimum must lie in"):
        made(ASYMMETRIC, optimum=-1.0)
    with pytest.raises(TypeError, match="name must be text, got 3"):
        made(ASYMMETRIC, name=3)


def test_instances_are_immutable_and_equal_by_value() -> None:
    matrix = np.array(ASYMMETRIC, dtype=np.float64)
    first = made(matrix, coordinates=[[0, 0], [1, 0], [0, 1]])
    matrix[0, 1] = 7.0
    assert first.distances[0, 1] == 1.0
    for array in (first.distances, first.coordinates):
        assert array is not None
        assert array.flags.c_contiguous
        assert array.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1.0
    same = made(ASYMMETRIC, coordinates=[[0, 0], [1, 0], [0, 1]])
    assert first == same
    assert hash(first) == hash(same)
    assert first != made(ASYMMETRIC)
    assert first != made(np.array(ASYMMETRIC).T)
    assert first != "distances"
    assert copy.deepcopy(first) is first
    twin = pickle.loads(pickle.dumps(first))
    assert twin == first
    assert not twin.distances.flags.writeable
    assert repr(first) == "<distances: 3 cities, asymmetric>"
    assert repr(load_instance("att48")).endswith("48 cities, symmetric, optimum 10628>")


def test_graphs_of_networkx() -> None:
    graph = nx.DiGraph(name="three")
    for i, tail in enumerate("abc"):
        graph.add_node(tail, pos=(i, 2 * i))
        for j, head in enumerate("abc"):
            graph.add_edge(tail, head, weight=ASYMMETRIC[i][j], time=1.0)
    found = TravellingSalesmanInstance.from_networkx(graph)
    np.testing.assert_array_equal(found.distances, ASYMMETRIC)
    assert found.name == "three"
    assert found.coordinates is not None
    assert found.coordinates.tolist() == [[0, 0], [1, 2], [2, 4]]
    timed = TravellingSalesmanInstance.from_networkx(graph, "time", name="hours")
    assert timed.length([0, 1, 2]) == 3.0
    assert timed.name == "hours"
    undirected = nx.Graph()
    undirected.add_weighted_edges_from(
        [("b", "a", 3.0), ("c", "a", 4.0), ("b", "c", 5)]
    )
    found = TravellingSalesmanInstance.from_networkx(undirected)
    assert found.symmetric
    assert found.distances.tolist() == [[0, 3, 5], [3, 0, 4], [5, 4, 0]]
    assert found.coordinates is None


def test_graphs_that_are_refused() -> None:
    path = nx.path_graph(3)
    nx.set_edge_attributes(path, 1.0, "weight")
    with pytest.raises(
        ValueError, match="an edge between any two nodes, got none from 0"
    ):
        TravellingSalesmanInstance.from_networkx(path)
    complete = nx.complete_graph(3)
    with pytest.raises(
        TypeError, match=r"the 'weight' of edge \(0, 1\) must be a real"
    ):
        TravellingSalesmanInstance.from_networkx(complete)
    nx.set_edge_attributes(complete, -1.0, "weight")
    with pytest.raises(ValueError, match=r"the 'weight' of edge .* got -1"):
        TravellingSalesmanInstance.from_networkx(complete)
    for bad in (nx.MultiGraph(), "graph", None):
        with pytest.raises(TypeError, match=r"networkx\.Graph or DiGraph"):
            TravellingSalesmanInstance.from_networkx(bad)
    with pytest.raises(ValueError, match="must have 2 to 100,000 cities, got 0"):
        TravellingSalesmanInstance.from_networkx(nx.Graph())


def test_without_networkx_the_error_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "networkx", None)
    with pytest.raises(DependencyNotInstalled, match=r"acl-gym\[networkx\]"):
        TravellingSalesmanInstance.from_networkx(object())


def test_instances_do_not_import_networkx() -> None:
    program = (
        "import sys; from acl_gym.envs.graph import load_instance; "
        "load_instance('att48'); print('networkx' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"
