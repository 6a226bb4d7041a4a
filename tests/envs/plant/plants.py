"""Plants that the tests share; functions at the top of a module can be pickled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

import acl_gym

# The pendulum of acl_gym, Table 5.1: K_m / J = 20, m g l / J = 19.62, b / J = 2.


def pendulum(x: Any, u: Any) -> Any:
    return [x[1], 20 * u[0] - 19.62 * np.sin(x[0]) - 2 * x[1]]


@njit
def compiled_pendulum(x, u):  # type: ignore[no-untyped-def]
    return x[1], 20 * u[0] - 19.62 * math.sin(x[0]) - 2 * x[1]


PENDULUM = {
    "low": [0.0, -9.0],
    "high": [2 * np.pi, 9.0],
    "circular": [0],
    "inputs": [-0.8, 0.0, 0.8],
    "sampling_time": 0.1,
    "goal": [np.pi, 0.0],
    "tolerance": 0.1,
    "cost": ([1.0, 0.1], 0.05),
    "max_episode_steps": 300,
}


def mass(x: Any, u: Any) -> Any:
    return [x[1], u[0]]


@njit
def compiled_mass(x, u):  # type: ignore[no-untyped-def]
    return np.array([x[1], u[0]])


MASS = {
    "low": [-1.0, -1.0],
    "high": [1.0, 1.0],
    "inputs": [-1.0, 0.0, 1.0],
    "sampling_time": 0.1,
    "goal": [0.0, 0.0],
    "tolerance": 0.15,
    "cost": "time",
    "max_episode_steps": 60,
}


def make_mass(**changes: Any) -> Any:
    return acl_gym.plant(changes.pop("dynamics", mass), **{**MASS, **changes})


def explosion(x: Any, u: Any) -> Any:
    """Infinite for states beyond 0.9; they are sampled below."""
    return [np.where(x[0] > 0.9, np.inf, u[0])]


@njit
def compiled_explosion(x, u):  # type: ignore[no-untyped-def]
    return (np.inf if x[0] > 0.9 else u[0],)


# The same pendulum with parameters: K_m 0.1, m 0.1 kg, D 0.01; J = 0.005, g l = 0.981.


def pendulum_with(x: Any, u: Any, p: Any) -> Any:
    push = p.gain * u[0] - 0.981 * p.mass * np.sin(x[0]) - p.damping * x[1]
    return [x[1], push / 0.005]


@njit
def compiled_pendulum_with(x, u, p):  # type: ignore[no-untyped-def]
    push = p.gain * u[0] - 0.981 * p.mass * math.sin(x[0]) - p.damping * x[1]
    return x[1], push / 0.005


KNOWN = {"gain": 0.1, "damping": 0.01}
UNCERTAIN = {"mass": (0.08, 0.14), "damping": (0.008, 0.012)}


def make_uncertain(**changes: Any) -> Any:
    """Mass and damping are uncertain; nominally they are 0.11 and 0.01."""
    settings = {**PENDULUM, "parameters": KNOWN, "uncertain": UNCERTAIN}
    dynamics = changes.pop("dynamics", pendulum_with)
    return acl_gym.plant(dynamics, **{**settings, **changes})
