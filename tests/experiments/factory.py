"""A small comparison, made by formula: no training, no environment."""

from __future__ import annotations

import math
from typing import Any

LABELS = {
    "acl-fuzzy": "ACL, fuzzy",
    "acl-crisp": "ACL, crisp",
    "q-fuzzy": "Q-learning, fuzzy",
    "q-crisp": "Q-learning, crisp",
    "q-lambda-fuzzy": "Q(λ), fuzzy",
    "q-lambda-crisp": "Q(λ), crisp",
    "dqn": "DQN",
}
# Environment steps and seconds between evaluations, what the cost falls to, and how
# many evaluations that takes to halve what is above.
_COURSE = {
    "acl-fuzzy": (25_000, 0.05, 45.0, 2.0),
    "acl-crisp": (60_000, 0.05, 72.0, 3.0),
    "q-fuzzy": (10_000, 0.03, 39.8, 0.8),
    "q-crisp": (11_000, 0.04, 40.4, 0.9),
    "q-lambda-fuzzy": (9_000, 0.04, 39.9, 0.7),
    "q-lambda-crisp": (9_500, 0.05, 40.6, 0.8),
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
        "picture": {
            "policy_map": make_map(shift=seed),
            "trajectory": make_trajectory(steps=20 + seed, reached=agent != "dqn"),
        },
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
        "command": "python benchmarks/compare_acl_rl.py --preset quick",
        "made": {
            "date": "2026-01-31",
            "python": "3.11.2",
            "cpu": "a CPU",
            "cores": "2",
            "processes": "2",
        },
        "evaluation": {"states": 100, "max_steps": 300, "text": "mean cost"},
        "reference": {
            "optimal_cost": OPTIMAL_COST,
            "success_rate": 1.0,
            "method": "fuzzy Q-iteration",
            "cells": [400, 401],
            "coarse": {"cells": [40, 41], "policy_cost": 52.3, "success_rate": 0.33},
            "picture": {
                "policy_map": make_map(shift=5),
                "trajectory": make_trajectory(steps=18, reached=True),
            },
        },
        "pictures": "pendulum",
        "scene": {"theta": theta, "omega": omega, "torques": TORQUES},
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


def make_grid(strip: bool = False) -> dict[str, Any]:
    """A comparison on a world of 3 x 4 with two obstacles, or on a row of four."""
    rows = ["...G"] if strip else ["..#.", ".#.G", "...."]
    cells = [
        [i, j] for i, row in enumerate(rows) for j, c in enumerate(row) if c != "#"
    ]
    goals = [i for i, (row, column) in enumerate(cells) if rows[row][column] == "G"]
    count = len(cells)
    comparison = make_comparison(("acl-crisp", "q-lambda-crisp", "dqn"), seeds=1)

    def picture(shift: int, lost: int) -> dict[str, Any]:
        """The first `lost` cells never arrive."""
        costs: list[float | None] = [float(count - i) for i in range(count)]
        costs[:lost] = [None] * lost
        for goal in goals:
            costs[goal] = 0.0
        return {
            "policy_map": [(i + shift) % 4 for i in range(count)],
            "cost_to_go": costs,
        }

    for shift, run in enumerate(comparison["runs"]):
        run["picture"] = picture(shift, lost=2 * shift)
        run["label"] = run["label"].removesuffix(", crisp")
    return {
        **comparison,
        "env": "acl_gym/GridSearch2D-v0",
        "pictures": "grid",
        "scene": {
            "rows": rows,
            "cells": cells,
            "goals": goals,
            "directions": [[-1, 0], [1, 0], [0, 1], [0, -1]],
            "optimal_actions": [[i % 4] for i in range(count)],
        },
        "reference": {
            "optimal_cost": OPTIMAL_COST,
            "success_rate": 1.0,
            "method": "value iteration",
            "picture": picture(0, lost=0),
        },
    }


def make_navigation() -> dict[str, Any]:
    """A comparison on a plane of 5 x 5 positions."""
    comparison = make_comparison(("acl-fuzzy", "q-crisp", "dqn"), seeds=1)
    axis = [-5.0, -2.5, 0.0, 2.5, 5.0]
    forces = [[u, v] for u in (-1.0, 0.0, 1.0) for v in (-1.0, 0.0, 1.0)]

    def picture(shift: int) -> dict[str, Any]:
        ways = [
            {"c1": [5.0, 2.0, 0.1], "c2": [b, b / 2, 0.0], "cost": 50.0, "reached": yes}
            for b, yes in ((-5.0, True), (0.0, shift == 0), (5.0, shift < 2))
        ]
        actions = [[(i * j + shift) % 9 for i in range(5)] for j in range(5)]
        return {"policy_map": actions, "trajectories": ways}

    for shift, run in enumerate(comparison["runs"]):
        run["picture"] = picture(shift)
    return {
        **comparison,
        "env": "acl_gym/Navigation-v0",
        "pictures": "navigation",
        "scene": {
            "positions": axis,
            "forces": forces,
            "position_max": 5.0,
            "damping": [[0.5 + i * j for i in range(9)] for j in range(9)],
            "goal": [[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]],
        },
        "reference": {
            "best_known_cost": OPTIMAL_COST,
            "success_rate": 1.0,
            "method": "fuzzy Q-iteration",
            "cells": [19, 11, 19, 11],
            "coarse": {"cells": [9, 3, 9, 3], "policy_cost": 73.3, "success_rate": 0.2},
            "picture": picture(0),
        },
    }
