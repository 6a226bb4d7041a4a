"""The speed of a plant of one's own, beside loops around SciPy and our own kernel.

The same pendulum in four ways: a loop around `scipy.integrate.solve_ivp` for each step of
each slot, as one writes it at first; `acl_gym.plant` with a function of NumPy arrays; with
the same function compiled by Numba; and `acl_gym/Pendulum-v0`, whose kernel is written by
hand. Every value is the median of several repetitions, which go through all cases in turn.
Only ratios can be compared between machines.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numba import njit
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

import acl_gym

Work = Callable[[], int]

SETTINGS = {
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
REFERENCE = "solve_ivp, a loop"


def with_numpy(x: Any, u: Any) -> Any:
    return [x[1], 20 * u[0] - 19.62 * np.sin(x[0]) - 2 * x[1]]


@njit
def with_numba(x, u):  # type: ignore[no-untyped-def]
    return x[1], 20 * u[0] - 19.62 * math.sin(x[0]) - 2 * x[1]


def loop_of_solve_ivp(steps: int) -> Work:
    """One slot after the other, with the tolerances of SciPy."""
    inputs = np.random.default_rng(0).choice([-0.8, 0.0, 0.8], steps)

    def work() -> int:
        state = np.array([1.0, 0.0])
        for u in inputs:
            solution = solve_ivp(
                lambda t, x, u=u: [x[1], 20 * u - 19.62 * math.sin(x[0]) - 2 * x[1]],
                (0.0, 0.1),
                state,
            )
            state = solution.y[:, -1]
            state[0] %= 2 * math.pi
            state[1] = min(max(state[1], -9.0), 9.0)
        return steps

    return work


def steps_of(env: Any, steps: int) -> Work:
    """Steps of a vector environment with actions drawn in advance."""
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 3, (steps, env.num_envs))

    def work() -> int:
        for row in actions:
            env.step(row)
        return steps * int(env.num_envs)

    return work


def cases(n_slots: int) -> dict[str, Work]:
    """Name -> work."""
    steps = min(2_000, max(50, 200_000 // n_slots))
    return {
        REFERENCE: loop_of_solve_ivp(300),
        "plant, NumPy": steps_of(
            acl_gym.plant(with_numpy, num_envs=n_slots, **SETTINGS), steps
        ),
        "plant, Numba": steps_of(
            acl_gym.plant(with_numba, num_envs=n_slots, **SETTINGS), steps
        ),
        "acl_gym/Pendulum-v0": steps_of(
            gym.make_vec("acl_gym/Pendulum-v0", num_envs=n_slots), steps
        ),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slots", type=int, nargs="+", default=[1, 100, 2000])
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()

    rows = []
    for n_slots in arguments.slots:
        works = cases(n_slots)
        for work in works.values():
            work()  # compile, fill caches
        rates = defaultdict(list)
        for _ in range(arguments.repetitions):
            for name, work in works.items():
                start = time.process_time()
                steps = work()
                rates[name].append(steps / (time.process_time() - start))
        base = statistics.median(rates[REFERENCE])
        for name, measured in rates.items():
            rate = statistics.median(measured)
            rows.append(
                {
                    "name": name,
                    "slots": 1 if name == REFERENCE else n_slots,
                    "steps_per_second": rate,
                    "slowest": min(measured),
                    "fastest": max(measured),
                    "ratio_to_reference": rate / base,
                }
            )
    if arguments.json:
        print(json.dumps({"reference": REFERENCE, "cases": rows}, indent=2))
        return
    table = Table("case", "slots", "steps per second", f"times {REFERENCE}")
    for row in rows:
        table.add_row(
            row["name"],
            str(row["slots"]),
            f"{row['steps_per_second']:,.0f}",
            f"{row['ratio_to_reference']:,.1f}",
        )
    Console().print(table)


if __name__ == "__main__":
    main()
