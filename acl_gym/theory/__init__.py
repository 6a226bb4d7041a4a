"""The thesis's theory as functions: §2.3.2, §2.6 and §3.4, and simulations beside it.

The functions of §2.6 and §3.4 take numbers or arrays and broadcast them. Costs enter as
deposits, 1 / J, as in the thesis. The special cases of §3.4.7 and §3.4.8 follow from the
general gaps of the levels (3.29) and of the policy (3.31), as the tests show. Where the
thesis claims more than its formulas give, the docstring says so, and docs/theory.md has
the algebra.

The double bridge of §2.3.2 is in `double_bridge` and, simulated, in `crossings`, §2.6 in
`aco` and, simulated, in `limited_ants`, §3.4.3 to §3.4.6 in `levels`, the rest in
`convergence`; import everything from this package.

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
    probability_found,
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
from acl_gym.theory.crossings import simulate_crossings
from acl_gym.theory.double_bridge import (
    choice_probability,
    crossing_law,
    linear_crossing_law,
    majority_probability,
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
from acl_gym.theory.limited_ants import LimitedAnts, simulate_limited_ants

__all__ = [
    "Coefficients",
    "LimitedAnts",
    "aco_level_limit",
    "action_probability_bound",
    "choice_probability",
    "crossing_law",
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
    "linear_crossing_law",
    "lower_coefficients",
    "majority_probability",
    "most_ants",
    "one_ant_limit",
    "pair_probability_bound",
    "policy_gap",
    "policy_gap_of_one_ant",
    "policy_gap_with_full_local_update",
    "policy_gap_without_global_update",
    "policy_gap_without_local_update",
    "probability_found",
    "recursion_limit",
    "recursion_rises",
    "simulate_crossings",
    "simulate_limited_ants",
    "state_probability_bound",
    "tau0_bound",
    "total_update",
    "trials_to_dominate",
    "trials_to_find",
    "update_coefficients",
    "upper_coefficients",
]
