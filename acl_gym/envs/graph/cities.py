"""Cities and the distances between them: an instance of the travelling salesman problem."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.graph.lengths import tour_lengths
from acl_gym.envs.graph.metrics import distances_between
from acl_gym.utils import validation
from acl_gym.utils.hashing import hashed_numbers
from acl_gym.utils.typing import FloatArray

MOST_CITIES = 100_000
"""Cities of an instance at most; a matrix of so many takes 80 GB."""

UNNAMED = ("distances", "coordinates", "graph")
"""The default names of instances, which say what they were made of."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TravellingSalesmanInstance:
    """Cities and the distances between them; immutable, and equal by value.

    Use `from_distances`, `from_coordinates`, `from_networkx`, `instances.load_instance`
    or `tsplib.read_tsplib`.

    Attributes:
        name: what pictures and tables call it.
        distances: from each city (row) to each other (column), `(n, n)`, float64,
            read-only, n >= 2, finite and >= 0. The diagonal, which no tour uses, is set
            to 0 whatever it was.
        coordinates: where pictures show the cities, x and y, `(n, 2)`, read-only; of
            places on the earth longitude and latitude; None if unknown.
        optimum: the length of a shortest tour, >= 0; None if unknown.

    Raises:
        ValueError: a distance is negative, NaN or infinite, or a shape is wrong.
        TypeError: `name` is not text, or `optimum` not a number.
    """

    name: str
    distances: FloatArray
    coordinates: FloatArray | None = None
    optimum: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise TypeError(
                f"name must be text, got {validation.shown(self.name)} of type "
                f"{type(self.name).__name__}."
            )
        distances = _checked_distances(self.distances)
        places = self.coordinates
        if places is not None:
            places = _checked_coordinates(places)
            if len(places) != len(distances):
                raise ValueError(
                    f"coordinates must have a row for each of the {len(distances)} "
                    f"cities, got {len(places)} rows."
                )
            places = _frozen(places)
        if self.optimum is not None:
            best = validation.number("optimum", self.optimum, at_least=0)
            object.__setattr__(self, "optimum", best)
        object.__setattr__(self, "distances", _frozen(distances))
        object.__setattr__(self, "coordinates", places)

    @classmethod
    def from_distances(
        cls,
        distances: ArrayLike,
        *,
        name: str = "distances",
        coordinates: ArrayLike | None = None,
        optimum: float | None = None,
    ) -> Self:
        """Make an instance of a matrix of distances, symmetric or not.

        Args:
            distances: from each city (row) to each other (column), `(n, n)`, finite and
                >= 0; the diagonal is ignored.
            name: what pictures and tables call it.
            coordinates: for pictures, `(n, 2)`.
            optimum: the length of a shortest tour, if known.

        Raises:
            ValueError: a distance is negative, NaN or infinite, or a shape is wrong.
        """
        return cls(
            name=name,
            distances=distances,  # type: ignore[arg-type]
            coordinates=coordinates,  # type: ignore[arg-type]
            optimum=optimum,
        )

    @classmethod
    def from_coordinates(
        cls,
        coordinates: ArrayLike,
        metric: str = "euclidean",
        *,
        name: str = "coordinates",
        optimum: float | None = None,
    ) -> Self:
        """Make an instance of the coordinates of the cities.

        Args:
            coordinates: `(n, 2)`; for "geo" latitude and longitude as DDD.MM, degrees
                and minutes.
            metric: "euclidean" (exact), or one of TSPLIB's, which give whole numbers:
                "euc_2d" (rounded), "ceil_2d" (rounded up), "att" (pseudo-Euclidean) or
                "geo" (km on the earth).
            name: what pictures and tables call it.
            optimum: the length of a shortest tour, if known.

        Raises:
            ValueError: the coordinates or the metric are not valid.
        """
        places = _checked_coordinates(coordinates)
        return cls(
            name=name,
            distances=distances_between(places, metric),
            coordinates=places[:, ::-1] if metric == "geo" else places,
            optimum=optimum,
        )

    @classmethod
    def from_networkx(
        cls, graph: Any, weight: str = "weight", *, name: str | None = None
    ) -> Self:
        """Make an instance of a complete networkx graph; city i is its i-th node.

        Args:
            graph: a `networkx.Graph` or, for an asymmetric instance, a `DiGraph`, with
                an edge between any two nodes. A node attribute `"pos"`, if all nodes
                have it, gives the coordinates for pictures.
            weight: the edge attribute that holds the distances.
            name: what pictures and tables call it; None takes the graph's own.

        Raises:
            DependencyNotInstalled: networkx is missing.
            TypeError: `graph` is not such a graph.
            ValueError: an edge or its weight is missing or not valid.
        """
        try:
            import networkx as nx
        except ImportError as error:
            raise DependencyNotInstalled(
                "from_networkx needs networkx; install it with "
                '`pip install "acl-gym[networkx]"`.'
            ) from error
        if not isinstance(graph, nx.Graph) or graph.is_multigraph():
            raise TypeError(
                "graph must be a networkx.Graph or DiGraph without parallel edges, got "
                f"{validation.shown(graph)}."
            )
        check_size(len(graph))
        nodes = list(graph)
        index = {node: i for i, node in enumerate(nodes)}
        distances = np.full((len(nodes), len(nodes)), np.nan)
        np.fill_diagonal(distances, 0.0)
        for tail, head, length in graph.edges(data=weight):
            if tail != head:
                what = f"the {weight!r} of edge ({tail!r}, {head!r})"
                if length is None:
                    raise TypeError(
                        f"{what} must be a real number, its length, but it has none; set "
                        "it, or name another attribute: from_networkx(graph, weight=...)."
                    )
                value = validation.number(what, length, at_least=0)
                distances[index[tail], index[head]] = value
                if not graph.is_directed():
                    distances[index[head], index[tail]] = value
        if np.isnan(distances).any():
            i, j = np.argwhere(np.isnan(distances))[0]
            raise ValueError(
                "graph must have an edge between any two nodes, got none from "
                f"{nodes[i]!r} to {nodes[j]!r}; add it with the length of the shortest "
                "path, or with a very large one."
            )
        places = [graph.nodes[node].get("pos") for node in nodes]
        return cls(
            name=str(name if name is not None else graph.name or "graph"),
            distances=distances,
            coordinates=None if any(p is None for p in places) else places,  # type: ignore[arg-type]
        )

    @property
    def n_cities(self) -> int:
        """The number n of cities."""
        return len(self.distances)

    @cached_property
    def symmetric(self) -> bool:
        """Whether each road has the same length in both directions."""
        return bool(np.array_equal(self.distances, self.distances.T))

    @cached_property
    def fingerprint(self) -> bytes:
        """A hash of the distances: equal only where all distances are."""
        return hashed_numbers(self.distances)

    def difference(self, other: TravellingSalesmanInstance) -> str | None:
        """In words how its distances differ from those of another; None if they do not.

        Names, coordinates and optima do not count: tours have the same lengths.
        """
        mine, others = self.distances, other.distances
        if mine is others or np.array_equal(mine, others):
            return None
        if len(mine) != len(others):
            return f"{len(mine)} cities in place of {len(others)}"
        i, j = np.argwhere(mine != others)[0]
        return (
            f"a distance of {float(mine[i, j])!r} from city {i} to city {j} in place of "
            f"{float(others[i, j])!r}"
        )

    def length(self, tour: ArrayLike) -> float | FloatArray:
        """Return the length of a tour, or of each of several, closing arc included.

        Args:
            tour: each city once, numbered from 0, `(n,)`, or rows of tours `(k, n)`.

        Returns:
            A float, or an array `(k,)`.

        Raises:
            ValueError: the shape is wrong, or a tour misses a city.
        """
        tours = checked_tours(tour, self.n_cities)
        rows = np.atleast_2d(tours).astype(np.int32)
        lengths: FloatArray = tour_lengths(rows, self.distances)
        return float(lengths[0]) if tours.ndim == 1 else lengths

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TravellingSalesmanInstance):
            return NotImplemented
        places, others = self.coordinates, other.coordinates
        return self is other or (
            (self.name, self.optimum) == (other.name, other.optimum)
            and np.array_equal(self.distances, other.distances)
            and (places is None) == (others is None)
            and (places is None or others is None or np.array_equal(places, others))
        )

    def __hash__(self) -> int:
        return hash((self.name, self.n_cities, self.distances[0].tobytes()))

    def __repr__(self) -> str:
        kind = "symmetric" if self.symmetric else "asymmetric"
        known = "" if self.optimum is None else f", optimum {self.optimum:g}"
        return f"<{self.name}: {self.n_cities} cities, {kind}{known}>"

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: Any) -> Self:
        return self  # immutable, and a matrix may be large

    def __reduce__(self) -> Any:
        # Arrays come back from a pickle as writable ones.
        parts = self.name, self.distances, self.coordinates, self.optimum
        return _rebuilt, (type(self), *parts)


def _rebuilt(
    kind: type[TravellingSalesmanInstance],
    name: str,
    distances: FloatArray,
    coordinates: FloatArray | None,
    optimum: float | None,
) -> TravellingSalesmanInstance:
    return kind(
        name=name, distances=distances, coordinates=coordinates, optimum=optimum
    )


def checked_instance(value: Any) -> TravellingSalesmanInstance:
    """Return a value that must be an instance.

    Raises:
        TypeError: it is not a `TravellingSalesmanInstance`.
    """
    if not isinstance(value, TravellingSalesmanInstance):
        raise TypeError(
            "instance must be a TravellingSalesmanInstance, got "
            f"{validation.shown(value)}; take env.unwrapped.instance, or "
            "TravellingSalesmanInstance.from_distances(distances)."
        )
    return value


def checked_tours(tour: Any, n_cities: int) -> NDArray[np.int64]:
    """Return tours as int64 `(n,)` or `(k, n)`, each city once.

    Raises:
        ValueError: the shape is wrong, or a tour misses a city.
    """
    array = validation.as_array(tour)
    if (
        array is None
        or array.dtype.kind not in "iu"
        or array.ndim not in (1, 2)
        or array.shape[-1] != n_cities
    ):
        raise ValueError(
            f"tour must hold the integers 0..{n_cities - 1}, shape ({n_cities},) or "
            f"(k, {n_cities}), got {validation.shown(tour)}."
        )
    tours = array.astype(np.int64)
    wrong = np.atleast_1d((np.sort(tours, axis=-1) != np.arange(n_cities)).any(axis=-1))
    if wrong.any():
        row = int(np.argmax(wrong))
        where = f" in row {row}" if tours.ndim == 2 else ""
        raise ValueError(
            f"tour must hold each city 0..{n_cities - 1} once, without the return to the "
            f"first, got {validation.shown(np.atleast_2d(tours)[row].tolist())}{where}."
        )
    return tours


def check_size(n_cities: int) -> None:
    """Refuse instances that are too small, or too large for memory.

    Raises:
        ValueError: there are fewer than 2 cities, or too many.
    """
    if not 2 <= n_cities <= MOST_CITIES:
        raise ValueError(
            f"an instance must have 2 to {MOST_CITIES:,} cities, got "
            f"{validation.shown(n_cities)}."
        )
    # The matrix, and two more while it is made.
    validation.check_memory(
        f"the distances of {n_cities:,} cities", 24 * n_cities**2, "take fewer cities"
    )


def _checked_coordinates(values: Any) -> FloatArray:
    places = validation.real_array("coordinates", values, ndim=2, finite=False)
    if places.shape[1] != 2:
        raise ValueError(
            "coordinates must have two columns, x and y, got shape "
            f"{places.shape}; pass a matrix of distances for other spaces."
        )
    bad = ~np.isfinite(places).all(axis=1)
    if bad.any():
        city = int(np.argmax(bad))
        raise ValueError(
            f"coordinates must be finite, got {places[city].tolist()} for city {city} of "
            f"0 to {len(places) - 1}; correct it or leave the city out."
        )
    check_size(len(places))
    return places


def _checked_distances(values: Any) -> FloatArray:
    matrix = validation.real_array("distances", values, ndim=2, finite=False)
    n_cities = len(matrix)
    validation.check_square("distances", matrix.shape, "city")
    check_size(n_cities)
    np.fill_diagonal(matrix, 0.0)
    # No tour is longer than n times the longest road, which must be a number too.
    most = sys.float_info.max / n_cities
    good = (matrix >= 0.0) & (matrix <= most)
    if not good.all():
        i, j = np.argwhere(~good)[0]
        raise ValueError(
            f"distances must be finite, >= 0 and at most {most:.3g}, got "
            f"{matrix[i, j]:g} from city {i} to city {j}; where there is no road, give "
            "a length greater than that of any tour."
        )
    return matrix + 0.0  # no -0


def _frozen(array: FloatArray) -> FloatArray:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
