"""The thesis's theory as functions: bounds and limits of §2.6 and §3.4.

All functions take numbers or arrays and broadcast them. Costs enter as deposits, 1 / J,
as in the thesis. The special cases of §3.4.7 and §3.4.8 follow from the general gaps of
the levels (3.29) and of the policy (3.31), as the tests show. Where the thesis claims
more than its formulas give, the docstring says so, and docs/theory.md has the algebra.
§2.6 is in `aco`, §3.4.3 to §3.4.6 in `levels`, the rest in `convergence`; import
everything from this package.

Common arguments:
    n_ants: M, >= 1.
    tau0: the initial level tau_0, > 0.
    local_decay: gamma, in [0, 1).
    global_decay: rho, in (0, 1].
    expected_deposit: J_exp^-1, see the function `expected_deposit`, > 0.
    expected_deposit_second: the expected deposit while the ants prefer the second-best
        action, J_exp^-1 with a bar in the thesis, > 0.

An argument that is out of range or NaN raises a ValueError.
"""

from acl_gym.theory.aco import (
    aco_level_limit,
    least_probability,
    trials_to_dominate,
    trials_to_find,
)
from acl_gym.theory.convergence import (
    level_gap,
    level_gap_with_full_local_update,
    level_gap_without_global_update,
    level_gap_without_local_update,
    most_ants,
    one_ant_limit,
    policy_gap,
    policy_gap_of_one_ant,
    policy_gap_with_full_local_update,
    policy_gap_without_global_update,
    policy_gap_without_local_update,
)
from acl_gym.theory.levels import (
    Coefficients,
    action_probability_bound,
    expected_band,
    expected_deposit,
    expected_lower_limit,
    expected_upper_limit,
    level_bound,
    lower_coefficients,
    pair_probability_bound,
    recursion_limit,
    recursion_rises,
    state_probability_bound,
    tau0_bound,
    total_update,
    update_coefficients,
    upper_coefficients,
)

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
