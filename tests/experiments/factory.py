"""A small comparison, made by formula: no training, no environment."""

from __future__ import annotations

import math
from typing import Any

LABELS = {
    "acl-fuzzy": "ACL, fuzzy",
    "acl-crisp": "ACL, crisp",
    "q-fuzzy": "Q-learning, fuzzy",
    "q-crisp": "Q-learning, crisp",
    "dqn": "DQN",
}
# Environment steps and seconds between evaluations, what the cost falls to, and how
# many evaluations that takes to halve what is above.
_COURSE = {
    "acl-fuzzy": (25_000, 0.05, 45.0, 2.0),
    "acl-crisp": (60_000, 0.05, 72.0, 3.0),
    "q-fuzzy": (10_000, 0.03, 39.8, 0.8),
    "q-crisp": (11_000, 0.04, 40.4, 0.9),
    "dqn": (1_000, 2.0, 41.0, 1.5),
}
OPTIMAL_COST = 40.0
TORQUES = [-0.8, 0.0, 0.8]


def make_run(
    agent: str,
    seed: int,
    costs: list[float],
    *,
    every: int = 1000,
    seconds: float = 1.0,
    label: str | None = None,
) -> dict[str, Any]:
    """A run evaluated after each `every` steps and `seconds` with these costs."""
    rows = [
        {
            "env_steps": every * (i + 1),
            "seconds": seconds * (i + 1),
            "policy_cost": cost,
            "success_rate": 1.0 if cost < 60 else 0.5,
        }
        for i, cost in enumerate(costs)
    ]
    return {
        "agent": agent,
        "label": label or LABELS.get(agent, agent),
        "seed": seed,
        "parameters": {"epsilon": 0.1, "net_arch": [64, 64], "seed": seed},
        "rows": rows,
        "best": min(rows, key=lambda row: row["policy_cost"]),
        "policy_map": make_map(shift=seed),
        "trajectory": make_trajectory(steps=20 + seed, reached=agent != "dqn"),
    }


def make_comparison(
    agents: tuple[str, ...] = tuple(LABELS), seeds: int = 3, evaluations: int = 20
) -> dict[str, Any]:
    """All agents over some seeds, with curves as they may be."""
    runs = []
    for agent in agents:
        every, seconds, floor, halving = _COURSE[agent]
        for seed in range(seeds):
            costs = [
                floor + 0.4 * seed + 2000 * 0.5 ** (i / halving) + math.sin(i + seed)
                for i in range(evaluations)
            ]
            run = make_run(agent, seed, costs, every=every, seconds=seconds)
            for i, row in enumerate(run["rows"]):
                row["env_steps"] += 7 * seed * (i + 1)
                row["seconds"] *= 1 + 0.1 * seed
            runs.append(run)
    theta = [2 * math.pi * i / 8 for i in range(8)]
    omega = [-9 + 18 * j / 8 for j in range(9)]
    return {
        "env": "acl_gym/Pendulum-v0",
        "preset": "quick",
        "version": "0.1.0",
        "date": "2026-01-31",
        "command": "python benchmarks/compare_acl_rl.py --preset quick",
        "machine": {"python": "3.11.2", "cpu": "a CPU", "cores": 2, "workers": 2},
        "evaluation": {"states": 100, "max_steps": 300, "text": "mean cost"},
        "reference": {
            "optimal_cost": OPTIMAL_COST,
            "success_rate": 1.0,
            "cells": [400, 401],
            "coarse": {"cells": [40, 41], "policy_cost": 52.3, "success_rate": 0.33},
            "policy_map": make_map(shift=5),
            "trajectory": make_trajectory(steps=18, reached=True),
        },
        "map_axes": {"theta": theta, "omega": omega},
        "torques": TORQUES,
        "runs": runs,
    }


def make_map(shift: int) -> list[list[int]]:
    """Actions over 9 velocities and 8 angles, `[n_omega][n_theta]`."""
    return [[(i * j + shift) % 3 for i in range(8)] for j in range(9)]


def make_trajectory(steps: int, *, reached: bool) -> dict[str, Any]:
    """A swing from 0 to pi; the torque has no value at the last state."""
    phases = [i / steps for i in range(steps + 1)]
    end = math.pi if reached else 0.9 * math.pi
    return {
        "time": [0.1 * i for i in range(steps + 1)],
        "theta": [end * phase for phase in phases],
        "omega": [3 * math.sin(math.pi * phase) for phase in phases],
        "torque": [TORQUES[i % 3] for i in range(steps)],
        "cost": [90 * math.sqrt(phase) for phase in phases],
        "reached": reached,
    }
