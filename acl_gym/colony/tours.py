"""Whole tours of all ants in one call: what colonies on the travelling salesman do.

An ant that walks in the environment chooses the next city in every step. Where every
state is a city and every action leads to the city of its number, that is a loop over
arrays, and the kernels here run it for all ants and all steps at once. They choose by
the rules of `acl_gym.colony.selection`, among the candidates of a city as
`acl_gym.colony.candidates` says, and take the same random numbers, so that an ant that
walks goes the same way.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acl_gym.colony.city_choice import (
    best_candidate,
    best_of_rest,
    choose_otherwise,
    drawn_candidate,
    last_increase,
    of_candidates,
)
from acl_gym.colony.pheromone import whole_exponent
from acl_gym.colony.solutions import ROWS_PER_BLOCK, Block
from acl_gym.colony.update_kernels import decay_pair
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

_TOGETHER = 8
"""Ants whose random numbers, which lie side by side, are taken at a time."""


class Tours:
    """The tours of all ants as solutions: a component for each arc, the last one too.

    Offers what update rules take of `Solutions`. Its memory is used again in every trial.

    Args:
        n_ants: m.
        n_cities: n.

    Attributes:
        tours: int32 `(n_ants, n)`, permutations of the cities.
        n_ants: m.
        length: how many components each solution has, `(n_ants,)`.
        may_repeat: False: no solution has a component twice.
    """

    may_repeat = False

    def __init__(self, n_ants: int, n_cities: int) -> None:
        self.n_ants = n_ants
        self.tours: CellArray = np.empty((n_ants, n_cities), np.int32)
        self.length = np.full(n_ants, n_cities)
        most = min(n_ants, max(1, ROWS_PER_BLOCK // n_cities))
        self._ends: IntArray = np.arange(1, most + 1) * n_cities
        self._degree: FloatArray = np.ones((most * n_cities, 1))
        self._next: CellArray = np.empty((most, n_cities), np.int32)

    def of(self, ants: IntArray) -> Tours:
        """The tours of some ants, which are 0, 1, ... m - 1 in what is returned.

        Args:
            ants: different ones in ascending order, `(m,)`.
        """
        some = Tours(ants.size, self.tours.shape[1])
        some.tours[:] = self.tours[ants]
        return some

    def blocks(self) -> Iterator[Block]:
        """All solutions, ant by ant, in parts that fit into the processor's cache.

        The arrays of a block are valid until the next block is requested.
        """
        most = len(self._next)
        for first in range(0, self.n_ants, most):
            part = self.tours[first : first + most]
            m, following = len(part), self._next[: len(part)]
            following[:, :-1], following[:, -1] = part[:, 1:], part[:, 0]
            yield Block(
                slice(first, first + m),
                part.reshape(-1, 1),
                self._degree[: part.size],
                following.reshape(-1),
                self._ends[:m],
            )


@njit
def nearest_neighbour_tour(distances: FloatArray, start: int) -> CellArray:
    """The tour that always goes to the nearest city not yet visited, `(n,)`.

    Of cities that are equally near, the first.

    Args:
        distances: `(n, n)`.
        start: the first city.
    """
    n = len(distances)
    tour, free = np.empty(n, np.int32), np.ones(n, np.bool_)
    tour[0], free[start] = start, False
    for t in range(1, n):
        row, nearest = distances[tour[t - 1]], -1
        for j in range(n):
            if free[j] and (nearest < 0 or row[j] < row[nearest]):
                nearest = j
        tour[t], free[nearest] = nearest, False
    return tour


@njit(error_model="numpy")
def build_tours(
    starts: IntArray,
    draws: FloatArray,
    candidates: CellArray,
    weighed: FloatArray,
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    greedy_weights: FloatArray | None,
    tours: CellArray,
) -> None:
    """Let all ants build their tours by the random-proportional rule (2.2).

    The pheromone stays as it is meanwhile, so one ant finishes before the next begins.

    Args:
        starts: the first city of each ant, `(m,)`.
        draws: uniform in [0, 1), `(n, 2, m)`: for each step the coins, which this rule
            does not use, and the choices of all ants.
        candidates: `(n, k)`, each row ascending, see `candidate_lists`.
        weighed: by `weigh_candidates`, `(n, k)`.
        levels: `(n, n)`.
        alpha: exponent of the levels.
        weights: `Pheromone.weights`; None: 1 everywhere.
        greedy_weights: `Pheromone.greedy_weights`; None: 1 everywhere.
        tours: receives the tours, `(m, n)`.
    """
    m, n = tours.shape
    k = np.uint64(candidates.shape[1])
    # Numbers, not truth values: a product needs no branch, which could not be predicted.
    free, sums, rest = np.empty(n), np.empty(candidates.shape[1]), np.empty(n, np.int32)
    choices = np.empty((_TOGETHER, n))
    for a in range(m):
        if a % _TOGETHER == 0:
            for t in range(n):
                for other in range(a, min(a + _TOGETHER, m)):
                    choices[other - a, t] = draws[t, 1, other]
        free[:] = 1.0
        n_rest = -1
        city = np.uint64(starts[a])
        tours[a, 0], free[city] = starts[a], 0.0
        for t in range(1, n):
            choice = choices[a % _TOGETHER, t - 1]
            total = 0.0
            for c in range(k):
                total += weighed[city, c] * free[np.uint64(candidates[city, c])]
                sums[c] = total
            if total > 0.0:
                place, target = np.uint64(0), choice * total
                for c in range(k):
                    place += np.uint64(sums[c] <= target)
                if place == k:  # the product was rounded up to the total
                    place = last_increase(sums)
                chosen = np.uint64(candidates[city, place])
            else:
                slow, n_rest = choose_otherwise(
                    city,
                    free,
                    candidates,
                    choice,
                    levels,
                    alpha,
                    weights,
                    greedy_weights,
                    rest,
                    n_rest,
                )
                chosen = np.uint64(slow)
            tours[a, t], free[chosen] = chosen, 0.0
            city = chosen


@njit(error_model="numpy")
def build_tours_in_turn(
    starts: IntArray,
    draws: FloatArray,
    candidates: CellArray,
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    greedy_weights: FloatArray | None,
    q0: float,
    local_decay: float,
    tau0: float,
    symmetric: bool,
    stale: BoolArray,
    tours: CellArray,
) -> None:
    """Let all ants build their tours as in the Ant Colony System.

    In each step one ant after the other chooses by the pseudo-random-proportional rule
    and decays its arc by (2.6) before the next ant chooses; so do the closing arcs.

    Args:
        starts: the first city of each ant, `(m,)`.
        draws: uniform in [0, 1), `(n, 2, m)`: coins and choices.
        candidates: `(n, k)`, each row ascending.
        levels: `(n, n)`, changed in place.
        alpha: exponent of the levels.
        weights: `Pheromone.weights`; None: 1 everywhere.
        greedy_weights: `Pheromone.greedy_weights`; None: 1 everywhere.
        q0: the probability to take the best candidate, in [0, 1].
        local_decay: gamma of (2.6), in [0, 1).
        tau0: the level towards which arcs decay.
        symmetric: an arc and its reverse have the same level.
        stale: `Pheromone.stale`, set where levels change.
        tours: receives the tours, `(m, n)`.
    """
    m, n = tours.shape
    free, rest = np.ones((m, n)), np.empty((m, n), np.int32)
    n_rest = np.full(m, -1)
    near = of_candidates(weights, candidates)
    near_greedy = near if alpha == 1.0 else of_candidates(greedy_weights, candidates)
    values, whole = np.empty(candidates.shape[1]), whole_exponent(alpha)
    for a in range(m):
        tours[a, 0] = starts[a]
        free[a, starts[a]] = 0.0
    for t in range(1, n + 1):
        for a in range(m):
            city = np.uint64(tours[a, t - 1])
            if t == n:
                chosen = int(tours[a, 0])
            else:
                coin, choice = draws[t - 1, 0, a], draws[t - 1, 1, a]
                chosen = -1
                if coin < q0:
                    chosen = best_candidate(
                        city,
                        free[a],
                        candidates,
                        choice,
                        levels,
                        near_greedy,
                        values,
                    )
                else:
                    chosen = drawn_candidate(
                        city,
                        free[a],
                        candidates,
                        choice,
                        levels,
                        alpha,
                        whole,
                        near,
                        values,
                    )
                if chosen < 0 and coin < q0:
                    chosen, n_rest[a] = best_of_rest(
                        city,
                        free[a],
                        choice,
                        levels,
                        greedy_weights,
                        rest[a],
                        n_rest[a],
                    )
                elif chosen < 0:
                    chosen, n_rest[a] = choose_otherwise(
                        city,
                        free[a],
                        candidates,
                        choice,
                        levels,
                        alpha,
                        weights,
                        greedy_weights,
                        rest[a],
                        n_rest[a],
                    )
                tours[a, t] = chosen
                free[a, chosen] = 0.0
            decay_pair(levels, city, chosen, local_decay, tau0, stale)
            if symmetric:
                levels[chosen, city] = levels[city, chosen]
                stale[chosen] = True
