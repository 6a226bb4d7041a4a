"""What §2.6 proves of Ant Colony Optimization with one global-best solution.

Part of `acl_gym.theory`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.theory import ranges
from acl_gym.utils.typing import FloatArray


def aco_level_limit(optimal_fitness: ArrayLike, global_decay: ArrayLike) -> FloatArray:
    """tau_max = F(s*) / rho: bound (Proposition 2.2) and limit (2.3) of a level.

    For the global-best update of the Ant System. The Ant Colony System weighs its
    deposit with rho, and its levels go to F(s*) instead. The proof needs
    tau_0 <= F(s), which the text uses and does not state.

    Args:
        optimal_fitness: F(s*), > 0.
        global_decay: rho, in (0, 1].
    """
    fitness = ranges.positive("optimal_fitness", optimal_fitness)
    return fitness / ranges.global_decay_checked(global_decay)


def least_probability(
    tau_min: ArrayLike, tau_max: ArrayLike, n_choices: ArrayLike, alpha: ArrayLike
) -> FloatArray:
    """p_min: no choice is less probable than this (Theorem 2.4).

    Args:
        tau_min: lowest level, > 0.
        tau_max: highest level, >= tau_min.
        n_choices: N_C, from how many vertices an ant chooses at most, >= 1.
        alpha: exponent of the selection rule, >= 0.
    """
    low, high = ranges.positive("tau_min", tau_min), ranges.positive("tau_max", tau_max)
    if not (high >= low).all():
        raise ValueError("tau_max must not be smaller than tau_min.")
    choices = ranges.checked("n_choices", n_choices, at_least=1)
    ratio = (high / low) ** ranges.checked("alpha", alpha, at_least=0)
    return 1.0 / ((choices - 1.0) * ratio + 1.0)


def trials_to_find(
    probability: ArrayLike, length: ArrayLike, failure: ArrayLike
) -> FloatArray:
    """K of Theorem 2.4: after K trials an optimum was found but for a chance `failure`.

    Args:
        probability: p_min, in (0, 1].
        length: n, the choices of the longest solution, >= 1.
        failure: epsilon of the theorem, in (0, 1].

    Returns:
        Whole numbers as floats; infinite where p_min^n underflows.
    """
    chance = ranges.checked("probability", probability, above=0, at_most=1)
    chance = chance ** ranges.checked("length", length, at_least=1)
    failure = ranges.checked("failure", failure, above=0, at_most=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        trials = np.log(failure) / np.log1p(-chance)
    # Certain to find it: one trial. Nothing asked: none. Otherwise rounded up.
    trials = np.where(chance == 1.0, 1.0, np.ceil(trials))
    return np.where(failure == 1.0, 0.0, trials)


def trials_to_dominate(global_decay: ArrayLike) -> FloatArray:
    """k_0 = ceil((1 - rho) / rho) of Theorem 2.5.

    So many trials after the first optimal solution its levels exceed all others. That
    takes evaporation on all edges, tau <- (1 - rho) tau, for then after k trials the
    optimum has at least k (1 - rho)^(k - 1) F(s*), others at most
    (1 - rho)^k F(s*) / rho. The text's proof says that the others "remain the same";
    if they did, an edge at tau_max would never be exceeded.
    """
    rho = ranges.global_decay_checked(global_decay)
    quotient = (1.0 - rho) / rho
    # 0.9 / 0.1 is 9, whatever rounding makes of it.
    nearest = np.round(quotient)
    close = np.isclose(quotient, nearest, rtol=1e-12, atol=0.0)
    return np.where(close, nearest, np.ceil(quotient))
