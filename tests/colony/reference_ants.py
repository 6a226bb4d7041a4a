"""The equations of chapter 2 again, in plain loops, and colonies made of them.

Nothing here comes from the package. `tau` and `eta` are `(n, n)`, a tour is a list of
cities, and random numbers come in as coins and choices in [0, 1).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Array = np.ndarray


def weights(
    tau: Array, eta: Array, i: int, among: Sequence[int], a: float, b: float
) -> list[float]:
    """The numerators of (2.2)."""
    return [float(tau[i, j] ** a * eta[i, j] ** b) for j in among]


def best(
    tau: Array,
    eta: Array,
    i: int,
    among: Sequence[int],
    a: float,
    b: float,
    choice: float,
) -> int:
    """The city with the largest tau^alpha eta^beta, ties drawn."""
    values = [tau[i, j] * eta[i, j] ** (b / a) for j in among]
    tied = [
        j
        for j, v in zip(among, values, strict=True)
        if np.isclose(v, max(values), rtol=1e-13)
    ]
    return tied[int(choice * len(tied))]


def drawn(
    tau: Array,
    eta: Array,
    i: int,
    among: Sequence[int],
    a: float,
    b: float,
    choice: float,
) -> int:
    """A city drawn by (2.2)."""
    values = weights(tau, eta, i, among, a, b)
    total = 0.0
    for j, value in zip(among, values, strict=True):
        total += value / sum(values)
        if choice < total:
            return j
    return among[-1]


def next_city(
    tau: Array,
    eta: Array,
    tour: list[int],
    candidates: int,
    a: float,
    b: float,
    q0: float,
    coin: float,
    choice: float,
) -> int:
    """Where an ant goes that has been to the cities of `tour`."""
    i, n = tour[-1], len(tau)
    nearest = sorted(range(n), key=lambda j: (-eta[i, j], j))[:candidates]
    left = [j for j in range(n) if j not in tour]
    if not left:
        return tour[0]
    near = [j for j in left if j in nearest]
    if not near:
        return best(tau, eta, i, left, a, b, choice)
    rule = best if coin < q0 else drawn
    return rule(tau, eta, i, near, a, b, choice)


def decay_on_the_way(
    tau: Array, i: int, j: int, gamma: float, tau0: float, symmetric: bool
) -> None:
    """(2.6), in place."""
    tau[i, j] = (1 - gamma) * tau[i, j] + gamma * tau0
    if symmetric:
        tau[j, i] = tau[i, j]


def tours(
    tau: Array,
    eta: Array,
    starts: Sequence[int],
    draws: Array,
    *,
    candidates: int,
    a: float,
    b: float,
    q0: float = 0.0,
    gamma: float = 0.0,
    tau0: float = 1.0,
    symmetric: bool = False,
) -> list[list[int]]:
    """The tours of all ants, step by step and ant by ant; changes tau where gamma > 0."""
    found = [[int(start)] for start in starts]
    for t in range(len(tau)):
        for ant, tour in enumerate(found):
            coin, choice = draws[t, :, ant]
            j = next_city(tau, eta, tour, candidates, a, b, q0, coin, choice)
            if gamma > 0:
                decay_on_the_way(tau, tour[-1], j, gamma, tau0, symmetric)
            if t < len(tau) - 1:
                tour.append(j)
    return found


def arcs(tour: Sequence[int]) -> list[tuple[int, int]]:
    """The components of a tour, the closing arc included."""
    return list(zip(tour, [*tour[1:], tour[0]], strict=True))


def length(tour: Sequence[int], distances: Array) -> float:
    return float(sum(distances[i, j] for i, j in arcs(tour)))


def deposits(tour: Sequence[int], fitness: float, n: int, symmetric: bool) -> Array:
    """Delta tau of one solution, (2.4)."""
    delta = np.zeros((n, n))
    for i, j in arcs(tour):
        delta[i, j] += fitness
        if symmetric:
            delta[j, i] += fitness
    return delta


def ant_system(
    tau: Array,
    solutions: Sequence[Sequence[int]],
    fitness: Sequence[float],
    rho: float,
    symmetric: bool,
) -> Array:
    """(2.3) with the update set `solutions`."""
    new = (1 - rho) * tau
    for tour, value in zip(solutions, fitness, strict=True):
        new = new + deposits(tour, value, len(tau), symmetric)
    return new


def ant_colony_system(
    tau: Array, tour: Sequence[int], fitness: float, rho: float, symmetric: bool
) -> Array:
    """(2.5)."""
    new = tau.copy()
    for i, j in arcs(tour):
        new[i, j] = (1 - rho) * tau[i, j] + rho * fitness
        if symmetric:
            new[j, i] = (1 - rho) * tau[j, i] + rho * fitness
    return new


def limits(
    fitness: float, rho: float, n: int, choices: int, p_best: float
) -> tuple[float, float]:
    """tau_min and tau_max of Stützle and Hoos (2000), (11) there, with avg = choices / 2.

    From p_dec = tau_max / (tau_max + (avg - 1) tau_min), p_dec^n = p_best.
    """
    most = fitness / rho
    p_dec = p_best ** (1 / n)
    return (most / p_dec - most) / (choices / 2 - 1), most


def branching(tau: Array, among: Sequence[Sequence[int]], share: float) -> float:
    """The mean number of arcs whose level is not below the cutoff of their city."""
    counts = []
    for i, row in enumerate(among):
        levels = [tau[i, j] for j in row]
        cutoff = min(levels) + share * (max(levels) - min(levels))
        counts.append(sum(level >= cutoff for level in levels))
    return sum(counts) / len(counts)
