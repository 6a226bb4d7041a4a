"""Running a policy and measuring its cost, eq. (3.47)."""

from acl_gym.evaluation.policy_cost import (
    PolicyCost,
    evaluate_policy_cost,
    policy_measures,
    reports_returns,
)
from acl_gym.evaluation.predictions import require_predictor
from acl_gym.evaluation.robustness import Robustness, evaluate_over_range
from acl_gym.evaluation.slots import control_env, with_slots_for
from acl_gym.evaluation.trajectory import Trajectory, actions_in, record_trajectory
from acl_gym.utils.typing import Predictor

__all__ = [
    "PolicyCost",
    "Predictor",
    "Robustness",
    "Trajectory",
    "actions_in",
    "control_env",
    "evaluate_over_range",
    "evaluate_policy_cost",
    "policy_measures",
    "record_trajectory",
    "reports_returns",
    "require_predictor",
    "with_slots_for",
]
