"""The returning ants again, from the equations: one ant after the other, pair by pair."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
Path = tuple[list[Array], list[int], list[float], bool, list[Array]]
"""Degrees over all cells of each state, actions, rewards, whether the end is terminal,
and which actions are allowed in each state."""


def value(levels: Array, beta: Array, allowed: Array) -> float:
    """V(x): the best of what is allowed."""
    return max(float(beta @ levels[:, u]) for u in range(levels.shape[1]) if allowed[u])


def laid(levels: Array, path: Path, discount: float, mix: float) -> list[float]:
    """G_t - Q(x_t, u_t) of each step, from the definition, forwards by recursion."""
    states, actions, rewards, terminated, allowed = path
    length = len(actions)

    def promise(t: int) -> float:
        if t == length and terminated:
            return 0.0
        return value(levels, states[t], allowed[t])

    def from_step(t: int) -> float:
        if t == length:
            return promise(t)
        return rewards[t] + discount * (
            mix * from_step(t + 1) + (1 - mix) * promise(t + 1)
        )

    return [from_step(t) - states[t] @ levels[:, actions[t]] for t in range(length)]


def after(
    levels: Array,
    walked: list[Path],
    remembered: list[Path],
    discount: float,
    mix: float,
    rate: float,
    trust: float,
    bounds: tuple[float, float],
) -> Array:
    """The levels when all paths of `walked` have been merged."""
    new = levels.copy()
    for cell, u in np.ndindex(levels.shape):
        deposits, weights = [], []
        for path in walked:
            for t, short in enumerate(laid(levels, path, discount, mix)):
                if path[1][t] == u and path[0][t][cell] > 0:
                    deposits.append(short)
                    weights.append(path[0][t][cell])
        if weights:
            evidence = sum(
                beta[cell]
                for path in remembered
                for beta, action in zip(path[0], path[1], strict=False)
                if action == u
            )
            step = rate * max(weights) * min(1.0, sum(weights) / evidence) ** trust
            mean = np.average(deposits, weights=weights)
            new[cell, u] = np.clip(levels[cell, u] + step * mean, *bounds)
    return new
