"""The kernels of the travelling salesman problem.

A state is `(3 + n_cities,)`: the city where the ant is, the one where it began, the arcs
that it has walked, and the rank of each city in its tour, 0 for the first; `UNVISITED`
where it has not been.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

HERE, FIRST, ARCS, RANKS = 0, 1, 2, 3
"""Rows of a state; the ranks fill the last n_cities."""

UNVISITED = -1.0
"""The rank of a city that the ant has not been to."""

MaskArray = NDArray[np.int8]


@njit
def start(states: FloatArray, cities: IntArray) -> None:
    """Let tours begin.

    Args:
        states: `(3 + n_cities, n)`, overwritten.
        cities: where each begins, `(n,)`.
    """
    states[RANKS:] = UNVISITED
    for slot in range(cities.size):
        states[HERE, slot] = states[FIRST, slot] = cities[slot]
        states[ARCS, slot] = 0.0
        states[RANKS + cities[slot], slot] = 0.0


@njit
def first_illegal(states: FloatArray, actions: IntArray) -> int:
    """The first slot whose action is not allowed, -1 if there is none.

    Args:
        states: `(3 + n_cities, n)`.
        actions: `(n,)`, numbers of cities.
    """
    n_cities = states.shape[0] - RANKS
    for slot in range(actions.size):
        arcs = states[ARCS, slot]
        if arcs == n_cities:
            legal = actions[slot] != states[HERE, slot]
        elif arcs == n_cities - 1:
            legal = actions[slot] == states[FIRST, slot]
        else:
            legal = states[RANKS + actions[slot], slot] == UNVISITED
        if not legal:
            return slot
    return -1


@njit
def advance(
    states: FloatArray,
    actions: IntArray,
    distances: FloatArray,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Walk to the next cities, in place; the actions are legal.

    Args:
        states: `(3 + n_cities, n)`. A closed tour begins anew in its first city.
        actions: `(n,)`, numbers of cities.
        distances: `(n_cities, n_cities)`.
        rewards: `(n,)`, receives minus the length of the arcs.
        reached: `(n,)`, receives whether the tours are closed.
    """
    n_cities = states.shape[0] - RANKS
    for slot in range(actions.size):
        city = actions[slot]
        if states[ARCS, slot] == n_cities:
            states[RANKS:, slot] = UNVISITED
            states[RANKS + int(states[FIRST, slot]), slot] = 0.0
            states[ARCS, slot] = 0.0
        rewards[slot] = 0.0 - distances[int(states[HERE, slot]), city]
        states[HERE, slot] = city
        states[ARCS, slot] += 1.0
        reached[slot] = states[ARCS, slot] == n_cities
        if not reached[slot]:
            states[RANKS + city, slot] = states[ARCS, slot]


@njit
def allowed(states: FloatArray, mask: MaskArray) -> None:
    """Which cities may be next.

    Args:
        states: `(3 + n_cities, n)`.
        mask: `(n, n_cities)`, receives 1 for those that have not been visited, in the last
            step for the first city only. In a closed tour, for all but the first city.
    """
    n, n_cities = mask.shape
    for slot in range(n):
        column = np.uint64(slot)  # unsigned: no check for indices from the end
        for city in range(n_cities):
            rank = states[np.uint64(RANKS + city), column]
            mask[column, np.uint64(city)] = rank == UNVISITED
        arcs = states[ARCS, slot]
        if arcs == n_cities:
            mask[slot] = 1
            mask[slot, int(states[FIRST, slot])] = 0
        elif arcs == n_cities - 1:
            mask[slot, int(states[FIRST, slot])] = 1
