"""The update of the pheromone levels and bounds on them, §3.4.3 to §3.4.6.

Part of `acl_gym.theory`, which explains the common arguments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.theory import ranges
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


class Coefficients(NamedTuple):
    """Coefficients alpha, beta of the recursion (3.25), or bounds on them (Table 3.3).

    Attributes:
        alpha: the fraction of the level that remains, in [0, 1).
        beta: the amount that the local update adds, >= 0.
    """

    alpha: FloatArray
    beta: FloatArray


# Total update of the levels, §3.4.3


def update_coefficients(
    visits: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike, global_decay: ArrayLike
) -> Coefficients:
    """Coefficients of the level recursion (3.25): tau <- alpha tau + beta + deposits.

    Args:
        visits: M_qu, the number of ants that visit the pair, >= 1.
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
    """A level after a trial: total update, eqs. (3.16) to (3.18).

    Args:
        level: tau(k), > 0.
        visits: M_qu(k), the number of ants that visited the pair, >= 0; with 0 the
            level does not change.
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
    """epsilon / N: least probability that an ant takes an action (Proposition 3.1).

    Args:
        epsilon: exploration probability, in [0, 1].
        n_actions: N, >= 1.
    """
    return ranges.epsilon_checked(epsilon) / ranges.checked(
        "n_actions", n_actions, at_least=1
    )


def state_probability_bound(n_states: ArrayLike) -> FloatArray:
    """1 / |Q|: least probability that a trial visits a state (Proposition 3.2).

    Args:
        n_states: |Q|, the number of possible initial states, >= 1.
    """
    return 1.0 / ranges.checked("n_states", n_states, at_least=1)


def pair_probability_bound(
    epsilon: ArrayLike, n_actions: ArrayLike, n_states: ArrayLike
) -> FloatArray:
    """epsilon / (N |Q|): the same for a pair of state and action (Corollary 3.3).

    Args:
        epsilon: see `action_probability_bound`.
        n_actions: see `action_probability_bound`.
        n_states: see `state_probability_bound`.
    """
    bound = action_probability_bound(epsilon, n_actions)
    return bound * state_probability_bound(n_states)


# Bounds on the levels, §3.4.5


def tau0_bound(max_cost: ArrayLike, global_decay: ArrayLike) -> FloatArray:
    """rho / J_max: the largest tau0 that no level falls below (Proposition 3.4).

    The proof needs less: the level after an update is at least
    (1 - rho) tau0 + rho / J_max, so that tau0 <= 1 / J_max suffices.

    Args:
        max_cost: J_max, > 0.
        global_decay: see `acl_gym.theory`.
    """
    return ranges.global_decay_checked(global_decay) / ranges.positive(
        "max_cost", max_cost
    )


def recursion_limit(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """b / (1 - a): limit of y <- a y + b from any start (Lemma 3.5).

    Args:
        a: in (-1, 1).
        b: any number.
    """
    a = ranges.checked("a", a, above=-1, below=1)
    return ranges.checked("b", b) / (1.0 - a)


def recursion_rises(a: ArrayLike, b: ArrayLike, start: ArrayLike) -> NDArray[np.bool_]:
    """Whether y <- a y + b never decreases from y(0) = `start` (Lemma 3.6).

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
    """Upper bounds on alpha and beta, Table 3.3."""
    one = update_coefficients(1, tau0, local_decay, global_decay)
    all_ants = update_coefficients(
        ranges.n_ants_checked(n_ants), tau0, local_decay, global_decay
    )
    return Coefficients(one.alpha, all_ants.beta)


def lower_coefficients(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike, global_decay: ArrayLike
) -> Coefficients:
    """Lower bounds on alpha and beta, Table 3.3."""
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
    """Upper bound on every level, eq. (3.23), Proposition 3.7.

    It is the limit of the recursion (3.26) and holds if tau0 does not exceed it, as
    with the tau0 of Proposition 3.4: 1 / J_min >= 1 / J_max >= tau0 / rho.

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

    The mean deposit of an epsilon-greedy ant that prefers the first action. J_avg^-1 is
    the mean of the deposits. (The thesis calls it the inverse of the mean cost, but its
    derivation averages deposits.)

    Args:
        epsilon: exploration probability, in [0, 1].
        deposits: 1 / J of each action along the last axis, > 0, the preferred action
            first.
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
    """Upper bound on the expected level, eq. (3.27), Proposition 3.8."""
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
    """Lower bound on the expected level in the limit, eq. (3.28), Proposition 3.9."""
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
    """Bounds on the expected level after each update (Propositions 3.8 and 3.9).

    Args:
        n_updates: number of updates, >= 0.
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
        ranges.positive("expected_deposit", expected_deposit),
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
