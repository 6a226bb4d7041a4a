"""The thesis's systems with the parameters of its tables, as studies to be varied.

What the thesis leaves open is decided here; docs/reproduction.md says how.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from acl_gym.experiments.study import (
    GRID_1D,
    GRID_2D,
    NAVIGATION,
    PENDULUM,
    TWO_STATE,
    Study,
    Task,
)
from acl_gym.planning.value_iteration import value_iteration
from acl_gym.utils.typing import IntArray

# Chapter 3 names no alpha, epsilon, tau_0, T, K.
_GRID = {
    "tau0": 1e-3,
    "alpha": 3.0,
    "selection": "boltzmann",
    "global_decay": 0.1,
    "local_decay": 0.0,
}
GRID_STATES = {"11x11": 86, "21x21": 278, "31x31": 640}
"""States of each 2-D grid, without the goal."""

_GRID_STEPS = {"11x11": 435, "21x21": 1395, "31x31": 3205}
"""T = 5 n_states, for p = 1: a random walk finds the goal half of the time."""

# Table 4.1.
_NAVIGATION = {
    "tau0": 1e-3,
    "local_decay": 0.01,
    "global_decay": 0.1,
    "alpha": 3.0,
    "selection": "boltzmann",
    "max_steps": 150,
}

# Table 5.2 and the base case of §5.3.
_PENDULUM = {
    "tau0": 1e-4,
    "epsilon": 0.1,
    "alpha": 3.0,
    "selection": "max_boltzmann",
    "max_steps": 300,
    "global_decay": 0.1,
    "local_decay": 0.01,
}


def grid_1d(ants: int = 9, **settings: Any) -> Study:
    """The 1-D grid of §3.6.2."""
    return Study(
        task=Task(env_id=GRID_1D, evaluation_steps=50),
        method="acl",
        settings={**_GRID, "max_steps": 50, **settings},
        slots=ants,
        trials=100,
    )


def grid_2d(
    size: str = "11x11", ants: int = 86, p: float = 1.0, **settings: Any
) -> Study:
    """The 2-D grids of §3.6.6; a move fails with probability 1 - p."""
    steps = round(_GRID_STEPS[size] / p)
    return Study(
        task=Task(
            env_id=GRID_2D,
            env={"map_name": size, "transition_probability": p},
            evaluation_steps=min(steps, 400),
        ),
        method="acl",
        settings={**_GRID, "max_steps": steps, **settings},
        slots=ants,
        trials=200,
    )


def navigation(
    cost: str, kind: str, goal_rule: str = "bounds", **settings: Any
) -> Study:
    """The navigation of §4.5: quadratic cost on the regular cells, or time-spent."""
    cells, spacing = ("regular", 0.1) if cost == "quadratic" else ("damping", 0.3)
    env = {"cost": cost, "goal_rule": goal_rule, "goal_spacing": (spacing, 2.0)}
    return Study(
        task=Task(env_id=NAVIGATION, env=env, evaluation_steps=150),
        method="acl",
        settings={**_NAVIGATION, **settings},
        slots=200,
        kind=kind,
        cells=cells,
        trials=200,
    )


def pendulum(
    kind: str, ants: int = 250, cells: tuple[int, int] = (40, 41), **settings: Any
) -> Study:
    """The pendulum of §5.3."""
    return Study(
        task=Task(env_id=PENDULUM, evaluation_steps=300),
        method="acl",
        settings={**_PENDULUM, **settings},
        slots=ants,
        kind=kind,
        cells=cells,
        trials=100,
    )


def two_state(ants: int, **settings: Any) -> Study:
    """The system of Figure 3.2 with costs 1, 2 and 4."""
    parameters = {
        "tau0": 0.01,
        "selection": "epsilon_greedy",
        "epsilon": 0.1,
        "local_decay": 0.1,
        "global_decay": 0.1,
        "max_steps": 2,
    }
    return Study(
        task=Task(env_id=TWO_STATE, evaluation_steps=2),
        method="acl",
        settings={**parameters, **settings},
        slots=ants,
        trials=2_000,
        watched={"level_q": (0, 0), "level_best": (1, 0), "level_second": (1, 1)},
    )


def planned(study: Study) -> Study:
    """Fuzzy Q-iteration on the cells of a study, which knows the model.

    The cheapest policy of the discounts 1, 0.98 and 0.95.
    """
    return replace(
        study,
        method="planning",
        settings={"discounts": [1.0, 0.98, 0.95], "max_iterations": 500},
        slots=1,
        trials=None,
        most_runs=1,
    )


PENDULUM_OPTIMUM = 38.5
"""J* of the pendulum, by value iteration on fine cells (docs/comparison.md)."""


def optimal_cost(study: Study) -> float | None:
    """J* on the evaluation states of a study's system; None where it is not known."""
    task = study.task
    if task.env_id == PENDULUM:  # known for omega_max = 9 rad/s
        return None if "omega_max" in task.env else PENDULUM_OPTIMUM
    return grid_optimum(study) if task.env_id in (GRID_1D, GRID_2D) else None


def grid_optimum(study: Study) -> float:
    """J* of a grid, the mean over the states that are not goals."""
    values = value_iteration(study.task.make_system_env(1)).values
    return float(-values[free_states(study)].mean())


def free_states(study: Study) -> IntArray:
    """The states of a grid that are not goals, where evaluations start."""
    return study.task.evaluation_states()[:, 0].astype(np.int64)
