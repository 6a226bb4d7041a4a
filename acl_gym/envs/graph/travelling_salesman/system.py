"""The travelling salesman problem of §2.4.1 as a system that ants walk through."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control.system import ControlSystem, SlotError
from acl_gym.envs.graph.instances import (
    OPTIMA,
    TravellingSalesmanInstance,
    load_instance,
)
from acl_gym.envs.graph.travelling_salesman import kernels
from acl_gym.envs.graph.travelling_salesman.kernels import (
    ARCS,
    FIRST,
    HERE,
    RANKS,
    UNVISITED,
    MaskArray,
)
from acl_gym.envs.graph.tsplib import read_tsplib
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

DEFAULT_INSTANCE = "att48"

_MOST_EVALUATED = 100
"""First cities from which a policy is evaluated at most, as many as the thesis's states."""


@dataclass(frozen=True, kw_only=True)
class TravellingSalesman(ControlSystem):
    """A tour through all cities and back, arc by arc.

    Only one of `instance`, `distances` with or without `coordinates`, `coordinates` and
    `tsplib` says which cities there are. Afterwards `instance` holds them, and the other
    three are None.

    Attributes:
        instance: the name of an instance that comes with the package ("att48", "eil51",
            "kroA100", "lin318", "pr2392"), or a `TravellingSalesmanInstance`; None takes
            att48 if nothing else is given.
        distances: a matrix of distances, symmetric or not, `(n, n)`, finite and >= 0.
        coordinates: of the cities, `(n, 2)`. With `distances` they are for pictures only.
        metric: of `coordinates`: "euclidean", or TSPLIB's "euc_2d", "ceil_2d", "att" or
            "geo".
        tsplib: the path of a file of TSPLIB.
        start: "random", or the number of the city where every tour begins.
    """

    fully_observed: ClassVar[bool] = False

    instance: TravellingSalesmanInstance | str | None = None
    distances: Any = None
    coordinates: Any = None
    metric: str = "euclidean"
    tsplib: Any = None
    start: str | int = "random"

    def __post_init__(self) -> None:
        found = self._found()
        values = {"instance": found, "distances": None, "coordinates": None}
        for name, value in {**values, "metric": "euclidean", "tsplib": None}.items():
            object.__setattr__(self, name, value)
        if isinstance(self.start, str):
            if self.start != "random":
                raise ValueError(
                    "start must be 'random' or the number of a city, got "
                    f"{validation.shown(self.start)}."
                )
        else:
            city = validation.integer(
                "start", self.start, at_least=0, at_most=found.n_cities - 1
            )
            object.__setattr__(self, "start", city)

    def _found(self) -> TravellingSalesmanInstance:
        """The instance that the arguments describe."""
        given = [
            name
            for name in ("instance", "distances", "coordinates", "tsplib")
            if getattr(self, name) is not None
        ]
        if len(given) > 1 and given != ["distances", "coordinates"]:
            raise ValueError(
                "give one of instance, distances (with coordinates for pictures), "
                f"coordinates and tsplib, got {' and '.join(given)}."
            )
        if self.metric != "euclidean" and given != ["coordinates"]:
            raise ValueError(
                "metric is for coordinates alone, got "
                f"{validation.shown(self.metric)} with {' and '.join(given) or 'none'}."
            )
        for name in given:
            _refuse_others(name, getattr(self, name))
        if self.tsplib is not None:
            return read_tsplib(self.tsplib)
        if self.distances is not None:
            return TravellingSalesmanInstance.from_distances(
                self.distances, coordinates=self.coordinates
            )
        if self.coordinates is not None:
            return TravellingSalesmanInstance.from_coordinates(
                self.coordinates, self.metric
            )
        if isinstance(self.instance, TravellingSalesmanInstance):
            return self.instance
        return load_instance(
            DEFAULT_INSTANCE if self.instance is None else self.instance
        )

    @property
    def cities(self) -> TravellingSalesmanInstance:
        """The instance."""
        return instance_of(self)

    @property
    def n_cities(self) -> int:
        """The number n of cities."""
        return self.cities.n_cities

    @property
    def evaluation_steps(self) -> int:  # type: ignore[override]
        """One step more than a tour, so that its end is never a truncation as well."""
        return self.n_cities + 1

    @cached_property
    def observation_space(self) -> spaces.Discrete:
        """One number for each city."""
        return spaces.Discrete(self.n_cities)

    @cached_property
    def action_space(self) -> spaces.Discrete:
        """The next city."""
        return spaces.Discrete(self.n_cities)

    @cached_property
    def max_stage_cost(self) -> float:
        """The length of the longest arc."""
        return float(self.cities.distances.max())

    def starting_in(self, cities: IntArray) -> FloatArray:
        """The states of tours that begin in these cities, `(state_size, n)`."""
        states = np.empty((RANKS + self.n_cities, cities.size))
        kernels.start(states, cities)
        return states

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw first cities uniformly, or take `start`; `(state_size, count)`."""
        if self.start != "random":
            return self.starting_in(np.full(count, self.start, np.int64))
        # Not with `integers`, counted from 0: an action space with the same seed would
        # sample the very cities where the ants are.
        n = self.n_cities
        drawn = np.minimum((n * rng.random(count)).astype(np.int64), n - 1)
        return self.starting_in(n - 1 - drawn)

    def checked_states(self, states: Any) -> FloatArray:
        """Return states, validated; first cities stand for tours that begin there.

        Args:
            states: first cities, `(n,)` or `(n, 1)`, or states `(n, 3 + n_cities)` as
                `env.states` gives them: the city where the ant is, the first one, the
                number of arcs walked, and each city's rank in the tour, -1 if it has
                not been visited.

        Raises:
            ValueError: the shape is wrong, or a state is not a part of a tour.
        """
        array = validation.real_array("states", states, finite=False)
        size = RANKS + self.n_cities
        if array.shape in ((array.size,), (array.size, 1)):
            cities = array.reshape(-1)
            good = np.isin(cities, np.arange(self.n_cities))
            if not good.all():
                row = int(np.argmin(good))
                raise ValueError(
                    f"states must be cities, integers of 0..{self.n_cities - 1}, got "
                    f"{cities[row]:g} in row {row}."
                )
            return self.starting_in(cities.astype(np.int64)).T.copy()
        if array.ndim != 2 or array.shape[1] != size:
            raise ValueError(
                "states must be first cities, shape (n,) or (n, 1), or tours so far, "
                f"shape (n, {size}), got {array.shape}."
            )
        good = self._are_tours(array)
        if not good.all():
            row = int(np.argmin(good))
            raise ValueError(
                "states must be [city, first city, arcs, rank of each city or -1] of a "
                f"tour, got {validation.shown(array[row].tolist())} in row {row}; take "
                "them from env.states."
            )
        return array + 0.0  # no -0

    def _are_tours(self, states: FloatArray) -> BoolArray:
        """Whether each row is a state that a walk can reach, `(n,)`."""
        n = self.n_cities
        arcs = states[:, ARCS]
        good = np.isin(arcs, np.arange(n + 1)) & (
            np.isin(states[:, :ARCS], np.arange(n)).all(axis=1)
        )
        whole = np.where(good[:, None], states, 0.0)
        arcs = whole[:, ARCS]
        rows = np.arange(len(states))
        visited = np.minimum(arcs + 1, n)
        # The ranks are 0 to visited - 1, each once, and -1 for all other cities.
        ranks = np.sort(whole[:, RANKS:], axis=1)
        wanted = np.arange(n) - (n - visited)[:, None]
        good &= (ranks == np.where(wanted < 0, UNVISITED, wanted)).all(axis=1)
        first, here = (whole[:, i].astype(np.int64) for i in (FIRST, HERE))
        good &= whole[rows, RANKS + first] == 0.0
        closed = arcs == n
        return np.asarray(
            good & np.where(closed, here == first, whole[rows, RANKS + here] == arcs)
        )

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """Walk to the next cities; see `ControlSystem.advance`.

        Raises:
            SlotError: a city may not be the next one; nothing has changed.
        """
        slot = kernels.first_illegal(states, actions)
        if slot >= 0:
            raise SlotError(self._refusal(states[:, slot], int(actions[slot])), slot)
        kernels.advance(states, actions, self.cities.distances, rewards, reached)

    def _refusal(self, state: FloatArray, city: int) -> str:
        arcs = int(state[ARCS])
        if arcs == self.n_cities - 1:
            wanted = f"the first city, {int(state[FIRST])}, to close the tour"
        else:
            wanted = "a city that the ant has not visited"
        return (
            f"the action must be {wanted}, got city {city} after {arcs} arcs in slot "
            "<slot>; choose among those that infos['action_mask'] allows."
        )

    def observe(self, states: FloatArray) -> IntArray:
        """Return the cities where the ants are, int64 `(n,)`."""
        return np.asarray(states[HERE].astype(np.int64))

    def action_mask(self, states: FloatArray) -> MaskArray:  # type: ignore[override]
        """Return which cities may be next, int8 `(n, n_cities)`.

        They are those that have not been visited, and in the last step the first city
        only. After the last step they are those of a new tour from there.
        """
        mask = np.empty((states.shape[1], self.n_cities), np.int8)
        kernels.allowed(states, mask)
        return mask

    def evaluation_states(self) -> FloatArray:
        """Return starts in 100 cities, evenly spread over their numbers; all if fewer.

        Returns:
            Array `(m, state_size)`; one row if `start` is a city.
        """
        if self.start != "random":
            cities = np.array([self.start], np.int64)
        else:
            count = min(self.n_cities, _MOST_EVALUATED)
            cities = np.arange(count) * self.n_cities // count
        return self.starting_in(cities).T.copy()


def _refuse_others(name: str, value: Any) -> None:
    """Say what to make of a graph, or of what is no instance.

    Raises:
        TypeError: the value is a graph of networkx.
        ValueError: it is to be an instance, and is neither that nor the name of one.
    """
    if hasattr(value, "nodes") and hasattr(value, "edges"):
        raise TypeError(
            f"{name} must not be a graph, got {validation.shown(value)}; pass "
            "instance=TravellingSalesmanInstance.from_networkx(graph)."
        )
    if name == "instance" and not isinstance(value, (TravellingSalesmanInstance, str)):
        raise ValueError(
            f"instance must be one of {', '.join(map(repr, OPTIMA))} or a "
            f"TravellingSalesmanInstance, got {validation.shown(value)}; pass a matrix as "
            "distances, points as coordinates, a file as tsplib."
        )


def instance_of(system: ControlSystem) -> TravellingSalesmanInstance:
    """The cities of a travelling salesman's system.

    Raises:
        TypeError: it is another system.
    """
    instance = getattr(system, "instance", None)
    if not isinstance(instance, TravellingSalesmanInstance):
        raise TypeError(
            "system must be that of the travelling salesman, got "
            f"{validation.shown(system)}."
        )
    return instance
