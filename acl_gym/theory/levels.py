"""What §3.4.3 to §3.4.6 say of the levels: their update, and bounds on them.

Part of `acl_gym.theory`, which explains the arguments that all have in common.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.theory import ranges
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


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
        tau0: see `acl_gym.theory`.
        local_decay: see `acl_gym.theory`.
        global_decay: see `acl_gym.theory`.
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
        tau0: see `acl_gym.theory`.
        local_decay: see `acl_gym.theory`.
        global_decay: see `acl_gym.theory`.
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
        global_decay: see `acl_gym.theory`.
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
        n_ants: see `acl_gym.theory`.
        tau0: see `acl_gym.theory`.
        local_decay: see `acl_gym.theory`.
        global_decay: see `acl_gym.theory`.
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
        n_ants: see `acl_gym.theory`.
        tau0: see `acl_gym.theory`.
        local_decay: see `acl_gym.theory`.
        global_decay: see `acl_gym.theory`.
        expected_deposit: see `acl_gym.theory`.

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


def _power(local_decay: ArrayLike, count: ArrayLike, name: str) -> FloatArray:
    """(1 - gamma)^count."""
    return (1.0 - ranges.local_decay_checked(local_decay)) ** ranges.checked(
        name, count, at_least=1
    )
