"""One run of a setting: the colony learns, its policy is evaluated after each trial."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.callbacks import PolicyEvaluation
from acl_gym.reproduction import orders
from acl_gym.reproduction.settings import TWO_STATE, Setting

MEASURES = (
    "policy_cost",
    "success_rate",
    "ants_cost",
    "policy_variation",
    "sensitivity",
    "env_steps",
)
"""The measures of §3.6.1, one value a trial."""


def learn(
    setting: Setting, seed: int, report: Callable[[float], None]
) -> dict[str, Any]:
    """Run a setting once.

    Args:
        setting: what to run.
        seed: of the colony, and through it of its environment.
        report: told the fraction that is done.

    Returns:
        `rows`, the value of each measure after each trial; `levels`, the pheromone at
        the end, flat; `seconds`, without evaluation.
    """
    env = setting.make_env()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PheromoneBoundWarning)  # the thesis's tau0
        colony = orders.colony(
            setting.order, env, setting.make_partition(), seed=seed, **setting.colony
        )
    evaluation = PolicyEvaluation(
        env, max_steps=setting.evaluation_steps or colony.max_steps
    )
    watched: dict[str, list[float]] = {"lowest_level": [], "highest_level": []}
    if setting.env_id == TWO_STATE:
        watched |= {"level_q": [], "level_best": [], "level_second": []}

    def watch(agent: Any, row: Any) -> None:
        levels = agent.pheromone.levels
        watched["lowest_level"].append(float(levels.min()))
        watched["highest_level"].append(float(levels.max()))
        if setting.env_id == TWO_STATE:
            watched["level_q"].append(float(levels[0, 0]))
            watched["level_best"].append(float(levels[1, 0]))
            watched["level_second"].append(float(levels[1, 1]))
        report(agent.trials / setting.trials)

    colony.learn(trials=setting.trials, callback=[evaluation, watch])
    rows = {
        name: [float(row[name]) for row in colony.history]
        for name in MEASURES
        if name in colony.history[0]
    }
    return {
        "rows": {**rows, **watched},
        "levels": np.asarray(colony.pheromone.levels).ravel(),
        "seconds": colony.seconds,
    }
