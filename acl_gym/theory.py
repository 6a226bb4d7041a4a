"""The thesis's theory as functions: bounds and limits of §2.6 and §3.4.

All take numbers or arrays and broadcast them; costs come as deposits, 1 / J, as in the
text. What the special cases of §3.4.7 and §3.4.8 say follows from the general formulas
(3.29) and (3.31), which the tests show; where the text goes further than its formulas,
the docstring says so.

Common arguments:
    n_ants: M, >= 1.
    tau0: the initial level tau_0, > 0.
    local_decay: gamma, in [0, 1).
    global_decay: rho, in (0, 1].
    expected_deposit: J_exp^-1 of `expected_deposit`, > 0.
    expected_deposit_second: the same while the second-best action is taken for the
        best, J_exp^-1 with a bar in the text, > 0.

An argument outside of its range, or NaN, is a ValueError.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym import ranges, validation
from acl_gym.aco_theory import (
    aco_level_limit,
    least_probability,
    trials_to_dominate,
    trials_to_find,
)
from acl_gym.ranges import FloatArray

__all__ = [
    "Coefficients",
    "aco_level_limit",
    "action_probability_bound",
    "expected_band",
    "expected_deposit",
    "expected_lower_limit",
    "expected_upper_limit",
    "least_probability",
    "level_bound",
    "level_gap",
    "level_gap_with_full_local_update",
    "level_gap_without_global_update",
    "level_gap_without_local_update",
    "lower_coefficients",
    "most_ants",
    "one_ant_limit",
    "pair_probability_bound",
    "policy_gap",
    "policy_gap_of_one_ant",
    "policy_gap_with_full_local_update",
    "policy_gap_without_global_update",
    "policy_gap_without_local_update",
    "recursion_limit",
    "recursion_rises",
    "state_probability_bound",
    "tau0_bound",
    "total_update",
    "trials_to_dominate",
    "trials_to_find",
    "update_coefficients",
    "upper_coefficients",
]


class Coefficients(NamedTuple):
    """alpha and beta of (3.25), or a bound on them (Table 3.3).

    Attributes:
        alpha: what is left of the level, in [0, 1).
        beta: what the local update adds, >= 0.
    """

    alpha: FloatArray
    beta: FloatArray


# Total update of the levels, §3.4.3


def update_coefficients(
    visits: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike, global_decay: ArrayLike
) -> Coefficients:
    """alpha(kappa) and beta(kappa) of (3.25): tau <- alpha tau + beta + deposits.

    Args:
        visits: M_qu, how many ants visit the pair, >= 1.
        tau0: see the module.
        local_decay: see the module.
        global_decay: see the module.
    """
    kept = 1.0 - ranges.global_decay_checked(global_decay)
    left = _power(local_decay, visits, "visits")
    return Coefficients(
        kept * left, kept * (1.0 - left) * ranges.positive("tau0", tau0)
    )


def total_update(
    level: ArrayLike,
    visits: ArrayLike,
    deposit: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
) -> FloatArray:
    """A level after a trial, (3.16)-(3.18).

    Args:
        level: tau(k), > 0.
        visits: M_qu(k), how many ants visited the pair, >= 0; with 0 the level stays.
        deposit: the sum of 1 / J of those ants, >= 0.
        tau0: see the module.
        local_decay: see the module.
        global_decay: see the module.
    """
    level, visits = (
        ranges.positive("level", level),
        ranges.checked("visits", visits, at_least=0),
    )
    deposit = ranges.checked("deposit", deposit, at_least=0)
    alpha, beta = update_coefficients(
        np.maximum(visits, 1), tau0, local_decay, global_decay
    )
    updated = alpha * level + beta + ranges.global_decay_checked(global_decay) * deposit
    return np.where(visits > 0, updated, level)


# Probabilities of choices and visits, §3.4.4


def action_probability_bound(epsilon: ArrayLike, n_actions: ArrayLike) -> FloatArray:
    """epsilon / N: epsilon-greedy ants choose no action less often (Proposition 3.1).

    Args:
        epsilon: exploration probability, in [0, 1].
        n_actions: N, >= 1.
    """
    return ranges.epsilon_checked(epsilon) / ranges.checked(
        "n_actions", n_actions, at_least=1
    )


def state_probability_bound(n_states: ArrayLike) -> FloatArray:
    """1 / |Q|: a state is visited no less often in a trial (Proposition 3.2).

    Args:
        n_states: |Q|, the states in which ants may begin, >= 1.
    """
    return 1.0 / ranges.checked("n_states", n_states, at_least=1)


def pair_probability_bound(
    epsilon: ArrayLike, n_actions: ArrayLike, n_states: ArrayLike
) -> FloatArray:
    """epsilon / (N |Q|), for a pair of state and action (Corollary 3.3).

    Args:
        epsilon: see `action_probability_bound`.
        n_actions: see `action_probability_bound`.
        n_states: see `state_probability_bound`.
    """
    bound = action_probability_bound(epsilon, n_actions)
    return bound * state_probability_bound(n_states)


# Bounds on the levels, §3.4.5


def tau0_bound(max_cost: ArrayLike, global_decay: ArrayLike) -> FloatArray:
    """rho / J_max: with a tau0 up to this no level falls below tau0 (Proposition 3.4).

    The proof needs less: the level after an update is at least
    (1 - rho) tau0 + rho / J_max, so tau0 <= 1 / J_max is enough.

    Args:
        max_cost: J_max, > 0.
        global_decay: see the module.
    """
    return ranges.global_decay_checked(global_decay) / ranges.positive(
        "max_cost", max_cost
    )


def recursion_limit(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """b / (1 - a), to where y <- a y + b goes from anywhere (Lemma 3.5).

    Args:
        a: in (-1, 1).
        b: any number.
    """
    a = ranges.checked("a", a, above=-1, below=1)
    return ranges.checked("b", b) / (1.0 - a)


def recursion_rises(a: ArrayLike, b: ArrayLike, start: ArrayLike) -> NDArray[np.bool_]:
    """Whether y <- a y + b never falls from y(0) = `start` (Lemma 3.6).

    Args:
        a: in [0, 1).
        b: any number.
        start: y(0).
    """
    a = ranges.checked("a", a, at_least=0, below=1)
    return np.asarray(ranges.checked("start", start) <= recursion_limit(a, b))


def upper_coefficients(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike, global_decay: ArrayLike
) -> Coefficients:
    """alpha_upper and beta_upper of Table 3.3."""
    one = update_coefficients(1, tau0, local_decay, global_decay)
    all_ants = update_coefficients(
        ranges.n_ants_checked(n_ants), tau0, local_decay, global_decay
    )
    return Coefficients(one.alpha, all_ants.beta)


def lower_coefficients(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike, global_decay: ArrayLike
) -> Coefficients:
    """alpha_lower and beta_lower of Table 3.3."""
    one = update_coefficients(1, tau0, local_decay, global_decay)
    all_ants = update_coefficients(
        ranges.n_ants_checked(n_ants), tau0, local_decay, global_decay
    )
    return Coefficients(all_ants.alpha, one.beta)


def level_bound(
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    largest_deposit: ArrayLike,
) -> FloatArray:
    """No level rises above this (3.23), Proposition 3.7.

    It is the limit of (3.26) and holds where tau0 is not above it, as with the tau0 of
    Proposition 3.4: 1 / J_min >= 1 / J_max >= tau0 / rho.

    Args:
        n_ants: see the module.
        tau0: see the module.
        local_decay: see the module.
        global_decay: see the module.
        largest_deposit: 1 / J_min, > 0.
    """
    deposit = ranges.positive("largest_deposit", largest_deposit)
    return expected_upper_limit(n_ants, tau0, local_decay, global_decay, deposit)


# Bounds on the expected levels, §3.4.6


def expected_deposit(epsilon: ArrayLike, deposits: ArrayLike) -> FloatArray:
    """J_exp^-1 = (1 - epsilon) J_min^-1 + epsilon J_avg^-1 of Proposition 3.8.

    What an epsilon-greedy ant lays in the mean if it takes the first action for the
    best. J_avg^-1 is the mean of the deposits (not the inverse of the mean cost, as the
    text puts it: the derivation averages deposits).

    Args:
        epsilon: exploration probability, in [0, 1].
        deposits: 1 / J of each action along the last axis, > 0, first that of the
            action that ants prefer.
    """
    deposits = ranges.positive("deposits", deposits)
    if deposits.ndim == 0:
        raise ValueError("deposits must hold one entry for each action, got a number.")
    epsilon = ranges.epsilon_checked(epsilon)
    mean = deposits.mean(axis=-1)
    return np.asarray((1.0 - epsilon) * deposits[..., 0] + epsilon * mean)


def expected_upper_limit(
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> FloatArray:
    """No expected level rises above this (3.27), Proposition 3.8."""
    alpha, beta = upper_coefficients(n_ants, tau0, local_decay, global_decay)
    deposit = ranges.positive("expected_deposit", expected_deposit)
    total = (
        ranges.global_decay_checked(global_decay)
        * ranges.n_ants_checked(n_ants)
        * deposit
    )
    return recursion_limit(alpha, beta + total)


def expected_lower_limit(
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> FloatArray:
    """In the limit no expected level lies below this (3.28), Proposition 3.9."""
    alpha, beta = lower_coefficients(n_ants, tau0, local_decay, global_decay)
    deposit = ranges.positive("expected_deposit", expected_deposit)
    return recursion_limit(
        alpha, beta + ranges.global_decay_checked(global_decay) * deposit
    )


def expected_band(
    n_updates: int,
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    """E_lower and E_upper of Propositions 3.8 and 3.9 as they rise from tau0.

    Args:
        n_updates: how many updates to follow, >= 0.
        n_ants: see the module.
        tau0: see the module.
        local_decay: see the module.
        global_decay: see the module.
        expected_deposit: see the module.

    Returns:
        Lower and upper bound after 0, 1, .., n_updates updates, each
        `(n_updates + 1, ...)`.
    """
    count = validation.integer("n_updates", n_updates, at_least=0)
    rho, deposit = (
        ranges.global_decay_checked(global_decay),
        ranges.positive("deposit", expected_deposit),
    )
    common = n_ants, tau0, local_decay, global_decay
    bounds = []
    for (alpha, beta), ants in (
        (lower_coefficients(*common), np.ones(())),
        (upper_coefficients(*common), ranges.n_ants_checked(n_ants)),
    ):
        limit = recursion_limit(alpha, beta + rho * ants * deposit)
        kappa = np.arange(count + 1.0).reshape(-1, *[1] * limit.ndim)
        bounds.append(limit + alpha**kappa * (ranges.positive("tau0", tau0) - limit))
    return bounds[0], bounds[1]


# Convergence of the expected levels, §3.4.7


def level_gap(
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> FloatArray:
    """Delta(E[tau]) of (3.29): how uncertain an expected level stays, >= 0.

    With annealed exploration it is this with 1 / J_min for `expected_deposit`.
    """
    common = n_ants, tau0, local_decay, global_decay, expected_deposit
    return expected_upper_limit(*common) - expected_lower_limit(*common)


def one_ant_limit(
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> FloatArray:
    """To where the expected level goes if M = 1: both bounds meet, (3.29) is 0."""
    rho, gamma = (
        ranges.global_decay_checked(global_decay),
        ranges.local_decay_checked(local_decay),
    )
    deposit = ranges.positive("expected_deposit", expected_deposit)
    added = ranges.positive("tau0", tau0) * gamma * (1.0 - rho) + rho * deposit
    return np.asarray(added / (1.0 - (1.0 - rho) * (1.0 - gamma)))


def level_gap_without_local_update(
    n_ants: ArrayLike, expected_deposit: ArrayLike
) -> FloatArray:
    """(3.29) for gamma = 0, any rho, and for rho = 1, any gamma: (M - 1) J_exp^-1."""
    deposit = ranges.positive("expected_deposit", expected_deposit)
    return (ranges.n_ants_checked(n_ants) - 1.0) * deposit


def level_gap_with_full_local_update(
    n_ants: ArrayLike, global_decay: ArrayLike, expected_deposit: ArrayLike
) -> FloatArray:
    """(3.29) for gamma -> 1: rho (M - 1) J_exp^-1."""
    gap = level_gap_without_local_update(n_ants, expected_deposit)
    return ranges.global_decay_checked(global_decay) * gap


def level_gap_without_global_update(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike
) -> FloatArray:
    """(3.29) for rho -> 0.

    Args:
        n_ants: M, >= 1; infinity gives tau0 (1 - gamma^2) / gamma.
        tau0: see the module.
        local_decay: gamma, in (0, 1); for gamma = 0 as well the limit depends on
            which of the two goes to 0 first.
    """
    gamma = ranges.checked("local_decay", local_decay, above=0, below=1)
    visited = 1.0 - (1.0 - gamma) ** ranges.checked(
        "n_ants", n_ants, at_least=1, finite=False
    )
    tau0 = ranges.positive("tau0", tau0)
    return np.asarray(tau0 / gamma * (visited**2 - gamma**2) / visited)


# Convergence of the policy, §3.4.8


def policy_gap(
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
    expected_deposit_second: ArrayLike,
) -> FloatArray:
    """Delta of (3.31): if it is positive, the policy in q' settles on the optimum."""
    common = n_ants, tau0, local_decay, global_decay
    lower = expected_lower_limit(*common, expected_deposit)
    return lower - expected_upper_limit(*common, expected_deposit_second)


def policy_gap_of_one_ant(
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
    expected_deposit_second: ArrayLike,
) -> FloatArray:
    """(3.31) for M = 1: never negative."""
    rho, gamma = (
        ranges.global_decay_checked(global_decay),
        ranges.local_decay_checked(local_decay),
    )
    first = ranges.positive("expected_deposit", expected_deposit)
    second = ranges.positive("expected_deposit_second", expected_deposit_second)
    return np.asarray(rho * (first - second) / (1.0 - (1.0 - rho) * (1.0 - gamma)))


def policy_gap_without_local_update(
    n_ants: ArrayLike, expected_deposit: ArrayLike, expected_deposit_second: ArrayLike
) -> FloatArray:
    """(3.31) for gamma = 0, any rho, and for rho = 1, any gamma."""
    second = ranges.positive("expected_deposit_second", expected_deposit_second)
    first = ranges.positive("expected_deposit", expected_deposit)
    return np.asarray(first - ranges.n_ants_checked(n_ants) * second)


def policy_gap_with_full_local_update(
    n_ants: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
    expected_deposit_second: ArrayLike,
) -> FloatArray:
    """(3.31) for gamma -> 1: rho times that of gamma = 0."""
    gap = policy_gap_without_local_update(
        n_ants, expected_deposit, expected_deposit_second
    )
    return ranges.global_decay_checked(global_decay) * gap


def policy_gap_without_global_update(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike
) -> FloatArray:
    """(3.31) for rho -> 0: minus (3.29), the deposits play no part."""
    return -level_gap_without_global_update(n_ants, tau0, local_decay)


def most_ants(
    expected_deposit: ArrayLike, expected_deposit_second: ArrayLike
) -> FloatArray:
    """(3.32): with more ants than this the policy gap is negative.

    For gamma = 0, gamma -> 1 and rho = 1; the ratio of the two deposits.
    """
    first = ranges.positive("expected_deposit", expected_deposit)
    return first / ranges.positive("expected_deposit_second", expected_deposit_second)


def _power(local_decay: ArrayLike, count: ArrayLike, name: str) -> FloatArray:
    """(1 - gamma)^count."""
    return (1.0 - ranges.local_decay_checked(local_decay)) ** ranges.checked(
        name, count, at_least=1
    )
