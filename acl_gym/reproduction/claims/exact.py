"""What is known exactly of the grids: optimal costs, and what policies cost."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.evaluation import control_env
from acl_gym.planning.model import TabularModel
from acl_gym.planning.value_iteration import policy_value, value_iteration
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Setting
from acl_gym.utils.typing import FloatArray


def solved(setting: Setting) -> tuple[Any, Any, Any]:
    """The model, its optimum, and the states that are no goals."""
    env = setting.make_env(1)
    model = TabularModel.from_env(env)
    optimum = value_iteration(model)
    goals = control_env(env).system.goal_states  # type: ignore[attr-defined]
    return model, optimum, np.setdiff1d(np.arange(len(optimum.values)), goals)


def optimal_grid_cost(setting: Setting) -> float:
    """J* of a grid, the mean over the states that are no goals."""
    _, optimum, free = solved(setting)
    return float(-optimum.values[free].mean())


def policy_costs(evidence: Evidence, setting: Setting) -> FloatArray:
    """What the last policy of each run costs; infinite if it is lost in a state."""
    model, _, free = solved(setting)
    return np.array(
        [
            -policy_value(model, policy.best_actions())[free].mean()
            for policy in evidence.policies(setting)
        ]
    )
