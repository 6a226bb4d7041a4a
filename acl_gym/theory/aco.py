"""Convergence of Ant Colony Optimization with the global-best update, §2.6.

Part of `acl_gym.theory`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.theory import ranges
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


def aco_level_limit(optimal_fitness: ArrayLike, global_decay: ArrayLike) -> FloatArray:
    """tau_max = F(s*) / rho: bound (Proposition 2.2) and limit (2.3) of a level.

    This is for the Ant System with the global-best update. The Ant Colony System
    weights its deposit by rho, so that its levels converge to F(s*) instead. The proof
    uses tau_0 < F(s) of Assumption 2.1; the bound needs no more than tau_0 <= tau_max.

    Args:
        optimal_fitness: fitness of the optimal solution, F(s*), > 0.
        global_decay: rho, in (0, 1].
    """
    fitness = ranges.positive("optimal_fitness", optimal_fitness)
    return fitness / ranges.global_decay_checked(global_decay)


def least_probability(
    tau_min: ArrayLike, tau_max: ArrayLike, n_choices: ArrayLike, alpha: ArrayLike
) -> FloatArray:
    """p_min: every choice has at least this probability (Theorem 2.4).

    Args:
        tau_min: lowest level, > 0.
        tau_max: highest level, >= tau_min.
        n_choices: N_C, the most vertices that an ant chooses from, >= 1.
        alpha: exponent of the selection rule, >= 0.

    Returns:
        In [0, 1]; 0 where a float cannot hold the ratio of the weights.
    """
    low, high = ranges.positive("tau_min", tau_min), ranges.positive("tau_max", tau_max)
    if not (high >= low).all():
        raise ValueError(
            "tau_max must not be smaller than tau_min, got "
            f"{validation.shown(tau_max)} and {validation.shown(tau_min)}."
        )
    others = ranges.checked("n_choices", n_choices, at_least=1) - 1.0
    alpha = ranges.checked("alpha", alpha, at_least=0)
    with np.errstate(over="ignore", invalid="ignore"):  # an infinite ratio is meant
        ratio = (high / low) ** alpha
        # An ant without another choice takes the only one, whatever the levels are.
        weight = np.where(others == 0.0, 0.0, others * ratio)
    return np.asarray(1.0 / (weight + 1.0))


def probability_found(
    probability: ArrayLike, length: ArrayLike, trials: ArrayLike
) -> FloatArray:
    """1 - (1 - p_min^n)^k: least chance to have found an optimum (Theorem 2.4).

    It counts one ant a trial and the worst levels that there can be, so that a colony
    finds an optimum much sooner (docs/aco-theory.md).

    Args:
        probability: p_min, in (0, 1].
        length: n, the number of choices in the longest solution, >= 1.
        trials: k, >= 0.
    """
    chance = _chance_of_a_solution(probability, length)
    trials = ranges.checked("trials", trials, at_least=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        missed = np.log1p(-chance) * trials
    # Where the optimum is certain, 0 trials are still none.
    return np.where(trials == 0.0, 0.0, -np.expm1(missed))


def trials_to_find(
    probability: ArrayLike, length: ArrayLike, failure: ArrayLike
) -> FloatArray:
    """K of Theorem 2.4: trials until an optimum is found with chance 1 - `failure`.

    Args:
        probability: p_min, in (0, 1].
        length: n, the number of choices in the longest solution, >= 1.
        failure: epsilon of the theorem, in (0, 1].

    Returns:
        Whole numbers as floats; infinite where p_min^n underflows.
    """
    chance = _chance_of_a_solution(probability, length)
    failure = ranges.checked("failure", failure, above=0, at_most=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        trials = np.log(failure) / np.log1p(-chance)
    # One trial if the optimum is certain, none if failure is allowed, else rounded up.
    trials = np.where(chance == 1.0, 1.0, np.ceil(trials))
    return np.where(failure == 1.0, 0.0, trials)


def trials_to_dominate(global_decay: ArrayLike) -> FloatArray:
    """k_0 = ceil((1 - rho) / rho) of Theorem 2.5.

    This many trials after the first optimal solution, its levels exceed all others.
    This requires evaporation on all edges, tau <- (1 - rho) tau: after k trials the
    optimum then has at least k (1 - rho)^(k - 1) F(s*), and all others have at most
    (1 - rho)^k F(s*) / rho. The proof in the thesis says that the others "remain the
    same"; then it may take much longer, and an edge at tau_max is never exceeded
    (docs/aco-theory.md).
    """
    rho = ranges.global_decay_checked(global_decay)
    quotient = (1.0 - rho) / rho
    # Undo rounding errors: 0.9 / 0.1 must give 9.
    nearest = np.round(quotient)
    close = np.isclose(quotient, nearest, rtol=1e-12, atol=0.0)
    return np.where(close, nearest, np.ceil(quotient))


def _chance_of_a_solution(probability: ArrayLike, length: ArrayLike) -> FloatArray:
    """p_min^n: an ant finds any given solution with at least this probability."""
    chance = ranges.checked("probability", probability, above=0, at_most=1)
    return np.asarray(chance ** ranges.checked("length", length, at_least=1))
