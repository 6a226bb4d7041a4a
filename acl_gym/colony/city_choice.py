"""How an ant chooses its next city: kernels for those that build whole tours."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.pheromone import whole_exponent
from acl_gym.colony.selection import boltzmann_allowed
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray


@njit(inline="always")
def _power(ratio: float, alpha: float, whole: int) -> float:
    if whole == 0:
        return float(ratio**alpha)
    value = ratio
    for _ in range(1, whole):
        value *= ratio
    return value


@njit(error_model="numpy")
def weigh_candidates(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    candidates: CellArray,
    weighed: FloatArray,
) -> None:
    """Write tau^alpha eta^beta of each city's candidates to `weighed`, `(n, k)`.

    Once per trial, where levels do not change within it. Levels are scaled by the
    largest of their row: no underflow of what matters.

    Args:
        levels: `(n, n)`, > 0.
        alpha: exponent of the levels.
        weights: `Pheromone.weights`; None: 1 everywhere.
        candidates: `(n, k)`.
        weighed: receives the products.
    """
    whole = whole_exponent(alpha)
    for i in range(candidates.shape[0]):
        largest = 0.0
        for c in range(candidates.shape[1]):
            largest = max(largest, levels[i, candidates[i, c]])
        for c in range(candidates.shape[1]):
            j = candidates[i, c]
            weight = _power(levels[i, j] / largest, alpha, whole)
            if weights is not None:
                weight *= weights[i, j]
            weighed[i, c] = weight


@njit
def last_increase(sums: FloatArray) -> np.uint64:
    """The first place at which cumulated sums have reached their last value."""
    place = sums.size - 1
    while place > 0 and sums[place - 1] == sums[place]:
        place -= 1
    return np.uint64(place)


@njit(error_model="numpy")
def choose_otherwise(
    city: np.uint64,
    free: FloatArray,
    candidates: CellArray,
    choice: float,
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    greedy_weights: FloatArray | None,
    rest: CellArray,
    n_rest: int,
) -> tuple[int, int]:
    """Choose where the candidates seem to offer nothing: their weights sum to 0.

    Either they are merely too small, and are scaled by the largest of those that are
    left; or no candidate is left, and then the best of all cities that are left is
    taken.

    Returns:
        The city, and how many cities are in `rest` now.
    """
    allowed: BoolArray = np.zeros(free.size, np.bool_)
    some = False
    for c in range(candidates.shape[1]):
        j = candidates[city, c]
        if free[j] > 0.0 and (weights is None or weights[city, j] > 0.0):
            allowed[j] = some = True
    if some:
        cell, degree = np.array([np.int32(city)]), np.ones(1)
        found = boltzmann_allowed(levels, alpha, weights, cell, degree, allowed, choice)
        return found, n_rest
    return best_of_rest(city, free, choice, levels, greedy_weights, rest, n_rest)


@njit(error_model="numpy")
def best_of_rest(
    city: np.uint64,
    free: FloatArray,
    choice: float,
    levels: FloatArray,
    greedy_weights: FloatArray | None,
    rest: CellArray,
    n_rest: int,
) -> tuple[int, int]:
    """The city not yet visited with the largest tau^alpha eta^beta; ties by `choice`.

    `rest` holds the cities that were left when an ant last looked here, in ascending
    order, or nothing if `n_rest` < 0. It shrinks with the tour, so all cities are looked
    at only once per tour.

    Returns:
        The city, and how many cities are in `rest` now.
    """
    if n_rest < 0:
        n_rest = free.size
        for j in range(n_rest):
            rest[j] = j
    count, tied, best = 0, 0, -1.0
    counts = False  # whether any heuristic variable is positive
    for r in range(n_rest):
        j = rest[r]
        if free[j] > 0.0:
            rest[count] = j
            count += 1
            counts |= greedy_weights is not None and greedy_weights[city, j] > 0.0
    for r in range(count):
        value = _value(city, rest[r], levels, greedy_weights, counts)
        if value > best:
            best, tied = value, 0
        tied += value == best
    skip = int(choice * tied)
    for r in range(count):
        if _value(city, rest[r], levels, greedy_weights, counts) == best:
            if skip == 0:
                return int(rest[r]), count
            skip -= 1
    return int(rest[0]), count


@njit(inline="always")
def _value(
    city: np.uint64,
    j: int,
    levels: FloatArray,
    greedy_weights: FloatArray | None,
    counts: bool,
) -> float:
    """What the best city has most of."""
    if greedy_weights is None or not counts:
        return float(levels[city, j])
    return float(levels[city, j] * greedy_weights[city, j])


@njit
def of_candidates(weights: FloatArray | None, candidates: CellArray) -> FloatArray:
    """The weights of each city's candidates, side by side, `(n, k)`; None: 1.

    In a large table each entry that an ant looks at lies in a part of the memory of its
    own.
    """
    near = np.ones(candidates.shape)
    if weights is not None:
        for i in range(candidates.shape[0]):
            for c in range(candidates.shape[1]):
                near[i, c] = weights[i, candidates[i, c]]
    return near


@njit(inline="always")
def best_candidate(
    city: np.uint64,
    free: FloatArray,
    candidates: CellArray,
    choice: float,
    levels: FloatArray,
    near: FloatArray,
    values: FloatArray,
) -> int:
    """The candidate left with the largest tau^alpha eta^beta; -1 if all have none.

    `near` are the greedy weights `of_candidates`.
    """
    k = np.uint64(candidates.shape[1])
    best = 0.0
    for c in range(k):
        j = np.uint64(candidates[city, c])
        value = levels[city, j] * free[j] * near[city, c]
        values[c] = value
        best = max(best, value)
    if best == 0.0:
        return -1
    tied = 0
    for c in range(k):
        tied += values[c] == best
    skip = int(choice * tied)
    for c in range(k):
        if values[c] == best:
            if skip == 0:
                return int(candidates[city, c])
            skip -= 1
    return -1


@njit(inline="always")
def drawn_candidate(
    city: np.uint64,
    free: FloatArray,
    candidates: CellArray,
    choice: float,
    levels: FloatArray,
    alpha: float,
    whole: int,
    near: FloatArray,
    sums: FloatArray,
) -> int:
    """A candidate left, drawn by (2.2); -1 if their weights sum to 0.

    `near` are the weights `of_candidates`.
    """
    k = np.uint64(candidates.shape[1])
    largest = 0.0
    for c in range(k):
        j = np.uint64(candidates[city, c])
        largest = max(largest, levels[city, j] * free[j])
    if largest == 0.0:
        return -1
    total = 0.0
    for c in range(k):
        j = np.uint64(candidates[city, c])
        weight = _power(levels[city, j] * free[j] / largest, alpha, whole)
        total += weight * near[city, c]
        sums[c] = total
    if not total > 0.0:
        return -1
    place, target = np.uint64(0), choice * total
    for c in range(k):
        place += np.uint64(sums[c] <= target)
    if place == k:
        place = last_increase(sums)
    return int(candidates[city, place])
