"""The thesis's systems with the parameters of its tables, ready to be varied.

What the thesis leaves open is decided here, and said in the text of the experiment.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from acl_gym.reproduction.settings import (
    GRID_1D,
    GRID_2D,
    NAVIGATION,
    PENDULUM,
    TWO_STATE,
    Setting,
)

# Chapter 3 names no alpha, epsilon, tau_0, T, K: decided in docs/reproduction.md.
_GRID = {
    "tau0": 1e-3,
    "alpha": 3.0,
    "selection": "boltzmann",
    "global_decay": 0.1,
    "local_decay": 0.0,
}
_ROW = Setting(GRID_1D, 9, 100, {**_GRID, "max_steps": 50})
_GRID_STEPS = {"11x11": 435, "21x21": 1395, "31x31": 3205}
"""T = 5 n_states, for p = 1: a random walk finds the goal half of the time."""

# Table 4.1.
_VEHICLE = Setting(
    NAVIGATION,
    200,
    200,
    {
        "tau0": 1e-3,
        "local_decay": 0.01,
        "global_decay": 0.1,
        "alpha": 3.0,
        "selection": "boltzmann",
        "max_steps": 150,
    },
)

# Table 5.2.
_SWING = Setting(
    PENDULUM,
    250,
    100,
    {
        "tau0": 1e-4,
        "epsilon": 0.1,
        "alpha": 3.0,
        "selection": "max_boltzmann",
        "max_steps": 300,
        "global_decay": 0.1,
        "local_decay": 0.01,
    },
    kind="fuzzy",
    cells=(40, 41),
)


def changed(setting: Setting, **colony: Any) -> Setting:
    """A setting with other parameters of the colony."""
    return replace(setting, colony={**setting.colony, **colony})


def row(**colony: Any) -> Setting:
    """The 1-D grid of §3.6.2 with 9 ants."""
    return changed(_ROW, **colony)


def world(
    size: str = "11x11", ants: int = 86, p: float = 1.0, **colony: Any
) -> Setting:
    """The 2-D grids of §3.6.6."""
    steps = round(_GRID_STEPS[size] / p)
    return Setting(
        GRID_2D,
        ants,
        200,
        {**_GRID, "max_steps": steps, **colony},
        {"map_name": size, "transition_probability": p},
        evaluation_steps=min(steps, 400),
    )


def vehicle(cost: str, kind: str, rule: str = "bounds", **colony: Any) -> Setting:
    """The navigation of §4.5: quadratic cost on the regular cells, or time-spent."""
    cells, spacing = ("regular", 0.1) if cost == "quadratic" else ("damping", 0.3)
    env = {"cost": cost, "goal_rule": rule, "goal_spacing": (spacing, 2.0)}
    return replace(changed(_VEHICLE, **colony), env=env, kind=kind, cells=cells)


def swing(
    kind: str, ants: int = 250, cells: tuple[int, int] = (40, 41), **colony: Any
) -> Setting:
    """The pendulum of §5.3."""
    return replace(changed(_SWING, **colony), kind=kind, ants=ants, cells=cells)


def two_state(ants: int, **colony: Any) -> Setting:
    """The system of Figure 3.2 with costs 1, 2 and 4."""
    parameters = {
        "tau0": 0.01,
        "selection": "epsilon_greedy",
        "epsilon": 0.1,
        "local_decay": 0.1,
        "global_decay": 0.1,
        "max_steps": 2,
    }
    return Setting(TWO_STATE, ants, 2_000, {**parameters, **colony})
