"""What is kept of a policy so that it can be drawn: one kind for each kind of system.

All of it JSON and small: actions at some states, a few trajectories. The scene, what
pictures of one system share, is kept once for a whole comparison.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import VectorEnv

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.grid_search.system import GridSearch
from acl_gym.envs.navigation import Navigation
from acl_gym.envs.navigation.painter import goal_outline
from acl_gym.envs.pendulum import Pendulum
from acl_gym.evaluation import Predictor, actions_in, control_env, record_trajectory
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.planning.value_iteration import policy_value, value_iteration
from acl_gym.utils.typing import FloatArray

Make = Callable[[int], VectorEnv[Any, Any, Any]]
"""Makes the environment that a model sees, with so many slots."""

Picture = dict[str, Any]


class Pictures(NamedTuple):
    """How policies on one kind of system are kept.

    Attributes:
        scene: what all pictures share.
        record: what is kept of one policy.
    """

    scene: Callable[[ControlVectorEnv], Picture]
    record: Callable[[Predictor, Make], Picture]


def _pendulum_scene(env: ControlVectorEnv) -> Picture:
    system = env.system
    if not isinstance(system, Pendulum):
        raise TypeError(f"these are pictures of the pendulum, got {env}.")
    theta, omega = _pendulum_axes(env)
    return {
        "theta": theta.tolist(),
        "omega": omega.tolist(),
        "torques": list(system.torques),
    }


def _pendulum_axes(env: ControlVectorEnv) -> tuple[FloatArray, FloatArray]:
    """Angles and velocities of the policy maps, four times finer than the cells."""
    n_theta, n_omega = (len(centres) for centres in thesis_partition(env).centres)  # type: ignore[attr-defined]
    low, high = env.single_observation_space.low, env.single_observation_space.high  # type: ignore[attr-defined]
    return (
        np.linspace(low[0], high[0], 4 * n_theta, endpoint=False),
        np.linspace(low[1], high[1], 4 * (n_omega - 1) + 1),
    )


def _pendulum_record(model: Predictor, make: Make) -> Picture:
    """The policy as a map over the state space, and the trajectory from rest."""
    env = control_env(make(1))
    scene = _pendulum_scene(env)
    grid = np.stack(np.meshgrid(scene["theta"], scene["omega"]), axis=-1)
    states = grid.reshape(-1, 2)
    actions = actions_in(model, make(len(states)), states)
    path = record_trajectory(model, make(1), np.zeros(2))
    theta = np.unwrap(path.states[:, 0], period=2 * math.pi)
    sampling_time: float = env.system.sampling_time  # type: ignore[attr-defined]
    return {
        "policy_map": actions.reshape(grid.shape[:2]).tolist(),
        "trajectory": {
            "time": (sampling_time * np.arange(len(theta))).tolist(),
            "theta": theta.tolist(),
            "omega": path.states[:, 1].tolist(),
            "torque": np.array(scene["torques"])[path.actions].tolist(),
            "cost": np.concatenate([[0.0], np.cumsum(path.costs)]).tolist(),
            "reached": path.success,
        },
    }


_ARROWS = 25  # positions along an axis: three between neighbours of nine centres
_SHADES = 81  # positions along an axis where the damping is kept


def _navigation(env: ControlVectorEnv) -> Navigation:
    if not isinstance(env.system, Navigation):
        raise TypeError(f"these are pictures of the navigation, got {env}.")
    return env.system


def _navigation_scene(env: ControlVectorEnv) -> Picture:
    system = _navigation(env)
    fine = np.linspace(-system.position_max, system.position_max, _SHADES)
    return {
        "positions": _positions(system).tolist(),
        "forces": [list(force) for force in system.forces],
        "position_max": system.position_max,
        "damping": np.round(system.damping(fine[None, :], fine[:, None]), 3).tolist(),
        "goal": goal_outline(system).tolist(),
    }


def _positions(system: Navigation) -> FloatArray:
    return np.linspace(-system.position_max, system.position_max, _ARROWS)


def _navigation_record(model: Predictor, make: Make) -> Picture:
    """Actions at rest over the plane, `[c2][c1]`, and ways from the edge of it."""
    system = _navigation(control_env(make(1)))
    axis = _positions(system)
    c1, c2 = np.meshgrid(axis, axis)
    rest = np.zeros(c1.size)
    states = np.stack([c1.ravel(), rest, c2.ravel(), rest], axis=1)
    actions = actions_in(model, make(len(states)), states)
    ends = (-system.position_max, 0.0, system.position_max)
    paths = []
    for start in ((a, b) for a in ends for b in ends if (a, b) != (0.0, 0.0)):
        path = record_trajectory(model, make(1), np.array([start[0], 0, start[1], 0]))
        places = np.round(path.states[:, [0, 2]], 3)
        paths.append(
            {
                "c1": places[:, 0].tolist(),
                "c2": places[:, 1].tolist(),
                "cost": float(path.costs.sum()),
                "reached": path.success,
            }
        )
    return {"policy_map": actions.reshape(c1.shape).tolist(), "trajectories": paths}


def _grid(env: ControlVectorEnv) -> GridSearch:
    if not isinstance(env.system, GridSearch):
        raise TypeError(f"these are pictures of a grid, got {env}.")
    return env.system


def _grid_scene(env: ControlVectorEnv) -> Picture:
    system = _grid(env)
    exact = value_iteration(env)
    best = exact.action_values.max(axis=1, keepdims=True)
    tied = exact.action_values >= best - 1e-6
    return {
        "rows": list(system.rows),
        "cells": system.cells.tolist(),
        "goals": system.goal_states.tolist(),
        "directions": [list(step) for step in system.directions],
        "optimal_actions": [np.flatnonzero(row).tolist() for row in tied],
    }


def _grid_record(model: Predictor, make: Make) -> Picture:
    """The action in each cell, and what it costs from there on: None if for ever."""
    env = control_env(make(1))
    states = np.arange(_grid(env).n_states, dtype=np.float64)[:, None]
    actions = actions_in(model, make(len(states)), states)
    costs = -policy_value(env, actions)
    return {
        "policy_map": actions.tolist(),
        "cost_to_go": [round(c, 6) + 0.0 if np.isfinite(c) else None for c in costs],
    }


PICTURES = {
    "pendulum": Pictures(_pendulum_scene, _pendulum_record),
    "navigation": Pictures(_navigation_scene, _navigation_record),
    "grid": Pictures(_grid_scene, _grid_record),
}
