"""An Ant System with a lower limit and the global-best update, §2.6, simulated.

Part of `acl_gym.theory`. It is the algorithm that §2.6 proves its propositions and
theorems for, on travelling salesman problems so small that their optimum is known by
trying all tours. Many colonies advance side by side, so that what happens to a share of
them can be compared with probabilities. The agents that solve larger problems are
`AntSystem`, `AntColonySystem` and `MaxMinAntSystem`.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

MOST_CITIES = 9
"""The most cities: all tours through so many are tried within a tenth of a second."""

SHORTEST = 1e-100
"""The shortest road; one over it is the longest. Lengths and fitness are then numbers."""

SAME = 1e-12
"""The relative difference below which two lengths are equal: sums in another order differ
by rounding."""


class LimitedAnts(NamedTuple):
    """What colonies of an Ant System with a lower limit have done.

    Levels are those after each trial, row 0 holds those of before the first.

    Attributes:
        fitness: F(s*) = 1 / length of a shortest tour.
        first_optimum: k*, the trial, counted from 1, in which each colony found its
            first shortest tour; 0 if it found none. `(n_colonies,)`.
        highest: the highest level of each colony, `(n_trials + 1, n_colonies)`.
        on_optimum: the lowest level on the arcs of the first shortest tour that a
            colony found, NaN before; `(n_trials + 1, n_colonies)`.
        elsewhere: the highest level on all other arcs, NaN before.
    """

    fitness: float
    first_optimum: IntArray
    highest: FloatArray
    on_optimum: FloatArray
    elsewhere: FloatArray


@njit
def one_trial(
    distances: FloatArray,
    levels: FloatArray,
    uniforms: FloatArray,
    best_tour: IntArray,
    best_length: FloatArray,
    alpha: float,
    rho: float,
    tau_min: float,
    all_evaporate: bool,
) -> None:
    """Let the ants of each colony walk one tour, and update its levels.

    Args:
        distances: `(n, n)`.
        levels: `(n_colonies, n, n)`, updated in place.
        uniforms: from [0, 1), `(n_colonies, n_ants, n)`: of each ant one for the city
            that it starts in and one for each choice.
        best_tour: `(n_colonies, n)`, updated in place.
        best_length: its length, `(n_colonies,)`, infinite before the first trial.
        alpha: exponent of (2.2).
        rho: of (2.3).
        tau_min: the lower limit of the levels.
        all_evaporate: whether levels evaporate on all arcs, or only on those of the
            best tour.
    """
    n_colonies, n_ants, n = uniforms.shape
    tour = np.empty(n, np.int64)
    weight = np.empty(n)
    for colony in range(n_colonies):
        for ant in range(n_ants):
            for city in range(n):
                tour[city] = city
            length = 0.0
            for step in range(n):
                # The cities from `step` on are those that have not been visited.
                total, largest = 0.0, 0.0
                for j in range(step, n):  # relative to it no power underflows
                    largest = max(largest, levels[colony, tour[step - 1], tour[j]])
                for j in range(step, n):
                    level = levels[colony, tour[step - 1], tour[j]]
                    total += 1.0 if step == 0 else (level / largest) ** alpha
                    weight[j] = total
                drawn = uniforms[colony, ant, step] * total
                chosen = step
                while chosen < n - 1 and weight[chosen] <= drawn:
                    chosen += 1
                tour[step], tour[chosen] = tour[chosen], tour[step]
                if step > 0:
                    length += distances[tour[step - 1], tour[step]]
            length += distances[tour[n - 1], tour[0]]
            if length < best_length[colony] * (1.0 - SAME):
                best_length[colony] = length
                best_tour[colony] = tour
        if all_evaporate:
            for i in range(n):
                for j in range(n):
                    levels[colony, i, j] *= 1.0 - rho
        for step in range(n):
            i, j = best_tour[colony, step - 1], best_tour[colony, step]
            if not all_evaporate:
                levels[colony, i, j] *= 1.0 - rho
            levels[colony, i, j] += 1.0 / best_length[colony]
        for i in range(n):
            for j in range(n):
                levels[colony, i, j] = max(levels[colony, i, j], tau_min)


def simulate_limited_ants(
    distances: Any,
    n_colonies: int,
    n_trials: int,
    *,
    n_ants: int = 1,
    global_decay: float = 0.1,
    tau_min: float,
    tau0: float | None = None,
    alpha: float = 1.0,
    evaporation: str = "all",
    seed: int | None = None,
) -> LimitedAnts:
    """Let colonies of the algorithm of §2.6 search for a shortest tour.

    In each trial every ant starts in a random city and walks through all of them by
    (2.2), without heuristic variables. Then the levels evaporate, the best tour since
    the beginning receives its fitness F = 1 / length on each arc, (2.3) and (2.4), and
    levels below `tau_min` become `tau_min`.

    Args:
        distances: `(n, n)` with 3 to 9 cities, in [1e-100, 1e100] off the diagonal; the
            way back may be of another length.
        n_colonies: >= 1.
        n_trials: >= 1.
        n_ants: M, ants of each colony, >= 1.
        global_decay: rho, in (0, 1).
        tau_min: the lower limit of the levels, > 0.
        tau0: the initial level, >= `tau_min`; None takes `tau_min`, as the thesis does.
        alpha: exponent of the selection rule, >= 0.
        evaporation: `"all"` arcs, as in (2.3), or only those of the best `"tour"`, so
            that all others "remain the same" as the proof of Theorem 2.5 says.
        seed: of the random numbers; None draws one.

    Raises:
        ValueError: an argument is out of range, or no memory is large enough.
        TypeError: an argument is of the wrong type.
    """
    lengths = _checked_distances(distances)
    n = len(lengths)
    n_colonies = validation.integer("n_colonies", n_colonies, at_least=1)
    n_trials = validation.integer("n_trials", n_trials, at_least=1)
    n_ants = validation.integer("n_ants", n_ants, at_least=1)
    rho = validation.number("global_decay", global_decay, above=0, below=1)
    low = validation.number("tau_min", tau_min, above=0)
    start = low if tau0 is None else validation.number("tau0", tau0, at_least=low)
    alpha = validation.number("alpha", alpha, at_least=0)
    validation.one_of("evaporation", evaporation, ("all", "tour"))
    validation.check_memory(
        f"levels of {n_colonies:,} colonies in {n_trials:,} trials",
        8 * n_colonies * (3 * n_trials + n_ants * n + 2 * n * n),
        "use fewer of them",
    )
    rng = np.random.default_rng(validation.seed(seed))
    shortest = _shortest(lengths)

    levels = np.full((n_colonies, n, n), start)
    best_tour = np.zeros((n_colonies, n), np.int64)
    best_length = np.full(n_colonies, math.inf)
    off_diagonal = ~np.eye(n, dtype=np.bool_)
    first_optimum = np.zeros(n_colonies, np.int64)
    highest, on_optimum, elsewhere = np.full((3, n_trials + 1, n_colonies), math.nan)
    highest[0] = start
    for trial in range(1, n_trials + 1):
        uniforms = rng.random((n_colonies, n_ants, n))
        one_trial(
            lengths, levels, uniforms, best_tour, best_length,
            alpha, rho, low, evaporation == "all",
        )  # fmt: skip
        highest[trial] = levels[:, off_diagonal].max(axis=1)
        optimal = best_length <= shortest * (1.0 + SAME)
        first_optimum[optimal & (first_optimum == 0)] = trial
        if optimal.any():
            on_tour = _arcs(best_tour[optimal])
            found = levels[optimal]
            on_optimum[trial, optimal] = np.where(on_tour, found, np.inf).min((1, 2))
            others = np.where(on_tour | ~off_diagonal, 0.0, found)
            elsewhere[trial, optimal] = others.max((1, 2))
    return LimitedAnts(1.0 / shortest, first_optimum, highest, on_optimum, elsewhere)


def _arcs(tours: IntArray) -> BoolArray:
    """Which arcs tours take, `(n_tours, n, n)`."""
    n_tours, n = tours.shape
    taken = np.zeros((n_tours, n, n), dtype=np.bool_)
    rows = np.arange(n_tours)[:, None]
    taken[rows, tours, np.roll(tours, -1, axis=1)] = True
    return taken


def _shortest(distances: FloatArray) -> float:
    """The length of a shortest tour, by trying all of them."""
    n = len(distances)
    tours = np.array(list(itertools.permutations(range(1, n))))
    lengths = distances[tours[:, :-1], tours[:, 1:]].sum(axis=1)
    lengths += distances[0, tours[:, 0]] + distances[tours[:, -1], 0]
    return float(lengths.min())


def _checked_distances(distances: Any) -> FloatArray:
    matrix = validation.real_array("distances", distances, ndim=2)
    validation.check_square("distances", matrix.shape, "city")
    n = len(matrix)
    if not 3 <= n <= MOST_CITIES:
        raise ValueError(
            f"distances must be those of 3 to {MOST_CITIES} cities, so that all tours "
            f"can be tried, got {n}."
        )
    roads = matrix[~np.eye(n, dtype=np.bool_)]
    if not ((roads >= SHORTEST) & (roads <= 1.0 / SHORTEST)).all():
        raise ValueError(
            f"distances off the diagonal must lie in [{SHORTEST:g}, {1.0 / SHORTEST:g}], "
            "because fitness is 1 / length, got "
            f"{validation.shown(matrix)}; give them in another unit."
        )
    return np.ascontiguousarray(matrix)
