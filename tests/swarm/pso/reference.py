"""Particle swarms as their equations read: one particle, one variable at a time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

State = tuple[list[float], list[float]]


def folded(position: float, lower: float, upper: float) -> tuple[float, bool]:
    """A position mirrored at the bounds until it is inside, and whether by an odd number
    of mirrors."""
    odd = False
    while not lower <= position <= upper:
        wall = lower if position < lower else upper
        position = 2 * wall - position
        odd = not odd
    return position, odd


def moved(
    theta: list[float],
    nu: list[float],
    u: list[float],
    *,
    w: float,
    lower: list[float],
    upper: list[float],
    boundary: str,
    limit: list[float],
    order: str,
) -> State:
    """(6.1) and (6.2) for one particle, with what happens at the bounds."""
    new_theta, new_nu = [], []
    for k in range(len(theta)):
        velocity = w * nu[k] + u[k]
        velocity = math.copysign(min(abs(velocity), limit[k]), velocity)
        position = theta[k] + (velocity if order == "standard" else nu[k])
        outside = not lower[k] <= position <= upper[k]
        if outside and lower[k] == upper[k] and boundary == "reflect":
            position, velocity = lower[k], 0.0
        elif outside and boundary == "reflect":
            position, odd = folded(position, lower[k], upper[k])
            velocity = -velocity if odd else velocity
        elif outside and boundary in ("absorb", "clip"):
            position = lower[k] if position < lower[k] else upper[k]
            velocity = 0.0 if boundary == "absorb" else velocity
        new_theta.append(position)
        new_nu.append(velocity)
    return new_theta, new_nu


def input_of(
    theta: Any, pbest: Any, lbest: Any, c1: float, c2: float, r: Any
) -> list[float]:
    """u of (6.3) for one particle; r is `(2, d)`."""
    return [
        c1 * r[0][k] * (pbest[k] - theta[k]) + c2 * r[1][k] * (lbest[k] - theta[k])
        for k in range(len(theta))
    ]


def swarm(
    function: Any,
    lower: np.ndarray,
    upper: np.ndarray,
    hears: list[list[int]],
    rng: np.random.Generator,
    iterations: int,
    *,
    w: Any,
    c1: Any,
    c2: Any,
    boundary: str = "reflect",
    order: str = "standard",
    asynchronous: bool = False,
) -> tuple[list[float], float, list[float]]:
    """A whole search: the best point, its value, and the best value after each iteration.

    Args:
        hears: whom each particle hears, in ascending order.
        w, c1, c2: of each particle.
    """
    n, d = len(hears), lower.size
    share = rng.random((n, d))
    theta = [list(lower + (upper - lower) * share[i]) for i in range(n)]
    point = lower + (upper - lower) * rng.random((n, d))
    nu = [[(point[i][k] - theta[i][k]) / 2 for k in range(d)] for i in range(n)]
    pbest = [list(each) for each in theta]
    value = [float(function(np.array(each))) for each in theta]

    def move(i: int, known: list[tuple[float, list[float]]], r: Any) -> None:
        senders = hears[i]
        lbest = (
            known[min(senders, key=lambda j: known[j][0])][1] if senders else pbest[i]
        )
        theta[i], nu[i] = moved(
            theta[i],
            nu[i],
            input_of(theta[i], pbest[i], lbest, c1[i], c2[i], r),
            w=w[i],
            lower=list(lower),
            upper=list(upper),
            boundary=boundary,
            limit=[math.inf] * d,
            order=order,
        )

    def remember(i: int) -> None:
        found = float(function(np.array(theta[i])))
        if found < value[i]:
            value[i], pbest[i] = found, list(theta[i])

    best = [min(value)]
    for _ in range(iterations):
        r = rng.random((n, 2, d))
        known = list(zip(value, [list(each) for each in pbest], strict=True))
        for i in range(n):
            if asynchronous:
                known = list(zip(value, pbest, strict=True))
            move(i, known, r[i])
            if asynchronous:
                remember(i)
        if not asynchronous:
            for i in range(n):
                remember(i)
        best.append(min(value))
    winner = value.index(min(value))
    return pbest[winner], value[winner], best
