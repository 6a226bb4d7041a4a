"""What §3.4.7 and §3.4.8 say of the convergence of the levels and of the policy.

Part of `acl_gym.theory`, which explains the arguments that all have in common.
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
        tau0: see `acl_gym.theory`.
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
    """Delta of (3.31), of which §3.4.8 says: if positive, the policy in q' settles.

    That does not follow from it (docs/theory.md); claim C23 tries it out.

    With annealed exploration it is this with 1 / J_min and 1 / J_second for the two
    expected deposits.
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
    """(3.31) for M = 1: never negative, as the first deposit is the larger one."""
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

    For gamma = 0, gamma -> 1 and rho = 1; the ratio of the two deposits. In between the
    gap is negative with fewer ants already (docs/theory.md), but not always, as the end
    of §3.4.8 may be read.
    """
    first = ranges.positive("expected_deposit", expected_deposit)
    return first / ranges.positive("expected_deposit_second", expected_deposit_second)
