"""Convergence of the levels, §3.4.7, and of the policy, §3.4.8.

Part of `acl_gym.theory`, which explains the common arguments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.theory import ranges
from acl_gym.theory.levels import expected_lower_limit, expected_upper_limit
from acl_gym.utils.typing import FloatArray

# Convergence of the expected levels, §3.4.7


def level_gap(
    n_ants: ArrayLike,
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> FloatArray:
    """Gap between the bounds on an expected level, Delta(E[tau]) of eq. (3.29), >= 0.

    With annealed exploration, pass 1 / J_min as `expected_deposit`.
    """
    common = n_ants, tau0, local_decay, global_decay, expected_deposit
    return expected_upper_limit(*common) - expected_lower_limit(*common)


def one_ant_limit(
    tau0: ArrayLike,
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
) -> FloatArray:
    """Limit of the expected level for M = 1, where the gap (3.29) is 0."""
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
    """The gap (3.29) for gamma = 0, or for rho = 1: (M - 1) J_exp^-1."""
    deposit = ranges.positive("expected_deposit", expected_deposit)
    return (ranges.n_ants_checked(n_ants) - 1.0) * deposit


def level_gap_with_full_local_update(
    n_ants: ArrayLike, global_decay: ArrayLike, expected_deposit: ArrayLike
) -> FloatArray:
    """The gap (3.29) for gamma -> 1: rho (M - 1) J_exp^-1."""
    gap = level_gap_without_local_update(n_ants, expected_deposit)
    return ranges.global_decay_checked(global_decay) * gap


def level_gap_without_global_update(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike
) -> FloatArray:
    """The gap (3.29) for rho -> 0.

    Args:
        n_ants: M, >= 1; infinity gives tau0 (1 - gamma^2) / gamma.
        tau0: see `acl_gym.theory`.
        local_decay: gamma, in (0, 1). With gamma -> 0 too, the limit depends on
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
    """Gap between the levels of the two best actions, Delta of eq. (3.31).

    According to §3.4.8 the policy in q' settles if the gap is positive. That does not
    follow from the formula (docs/theory.md); claim C23 tests it by experiment.

    With annealed exploration, pass 1 / J_min and 1 / J_second as the two expected
    deposits.
    """
    common = n_ants, tau0, local_decay, global_decay
    lower = expected_lower_limit(*common, expected_deposit)
    return lower - expected_upper_limit(*common, expected_deposit_second)


def policy_gap_of_one_ant(
    local_decay: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
    expected_deposit_second: ArrayLike,
) -> FloatArray:
    """The gap (3.31) for M = 1: never negative, as the first deposit is the larger."""
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
    """The gap (3.31) for gamma = 0, or for rho = 1."""
    second = ranges.positive("expected_deposit_second", expected_deposit_second)
    first = ranges.positive("expected_deposit", expected_deposit)
    return np.asarray(first - ranges.n_ants_checked(n_ants) * second)


def policy_gap_with_full_local_update(
    n_ants: ArrayLike,
    global_decay: ArrayLike,
    expected_deposit: ArrayLike,
    expected_deposit_second: ArrayLike,
) -> FloatArray:
    """The gap (3.31) for gamma -> 1: rho times the gap for gamma = 0."""
    gap = policy_gap_without_local_update(
        n_ants, expected_deposit, expected_deposit_second
    )
    return ranges.global_decay_checked(global_decay) * gap


def policy_gap_without_global_update(
    n_ants: ArrayLike, tau0: ArrayLike, local_decay: ArrayLike
) -> FloatArray:
    """The gap (3.31) for rho -> 0: minus the gap (3.29), whatever the deposits."""
    return -level_gap_without_global_update(n_ants, tau0, local_decay)


def most_ants(
    expected_deposit: ArrayLike, expected_deposit_second: ArrayLike
) -> FloatArray:
    """Number of ants above which the policy gap is negative, eq. (3.32).

    It is the ratio of the two deposits and holds for gamma = 0, gamma -> 1 and rho = 1.
    In between the gap becomes negative with fewer ants (docs/theory.md), though not for
    every number, as the end of §3.4.8 might suggest.
    """
    first = ranges.positive("expected_deposit", expected_deposit)
    return first / ranges.positive("expected_deposit_second", expected_deposit_second)
