"""One set of defaults on every task: how soon `ReturningACL` is good, and whether it stays so.

Nothing is tuned for a task: neither cells nor parameters nor the number of ants. Learning
is interrupted at regular intervals, and the greedy policy is followed from many starts.
Prints for each task after how many interactions the policy is good for the first time,
in how many of the runs that happens, and the median return then on and at the end.
What is good is what the task's literature calls solved, or comes within 25% of the best.

Other settings are tried with --param, such as `--param mix=0.5 --param grows=false`.
"""

from __future__ import annotations

import argparse
import ast
import json
import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from tqdm.auto import tqdm

from acl_gym import ReturningACL, WaitingVectorEnv, evaluate_policy_cost
from acl_gym.utils.text import replace_unprintable_letters

# The script beside this one.
from tables import (  # isort: skip
    add_seeds,
    markdown,
    number,
    parser_of,
    some_of,
)

ANTS = 5
Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """An environment, and what is good in it.

    Attributes:
        env_id: of the environment.
        steps: interactions of a run.
        every: interactions between two evaluations.
        good: the return from which on a policy is good.
        starts: how many episodes an evaluation has; a control system of this package has
            its own.
        limit: another time limit than the registered one.
    """

    env_id: str
    steps: int
    every: int
    good: float
    starts: int = 50
    limit: int | None = None

    def make(self, slots: int) -> VectorEnv[Any, Any, Any]:
        """The environment in so many slots."""
        if self.env_id.startswith("acl_gym/"):
            return gym.make_vec(self.env_id, num_envs=slots)
        more = {} if self.limit is None else {"max_episode_steps": self.limit}
        return WaitingVectorEnv([lambda: gym.make(self.env_id, **more)] * slots)


TASKS = {
    "pendulum": Task("acl_gym/Pendulum-v0", 20_000, 500, -48.0),  # the best: -38.4
    "pendulum, 10%": Task("acl_gym/Pendulum-v0", 20_000, 500, -42.2),
    "navigation": Task("acl_gym/Navigation-v0", 250_000, 10_000, -69.5),
    "grid 1-D": Task("acl_gym/GridSearch1D-v0", 2_000, 100, -5.0),
    "grid 2-D": Task("acl_gym/GridSearch2D-v0", 16_000, 500, -10.05),
    "mountain car": Task("MountainCar-v0", 60_000, 5_000, -110.0),
    "cart-pole": Task("CartPole-v1", 30_000, 1_500, 475.0),
    "frozen lake": Task("FrozenLake-v1", 20_000, 1_000, 0.70, starts=200),
    "cliff": Task("CliffWalking-v1", 8_000, 500, -13.0, starts=1, limit=200),
    "taxi": Task("Taxi-v4", 20_000, 1_000, 7.8, starts=100),
    "acrobot": Task("Acrobot-v1", 100_000, 10_000, -100.0),
}


def run(task: Task, seed: int, parameters: dict[str, Any]) -> Row:
    """Learn with interruptions; what the policy returned at each."""
    agent = ReturningACL(task.make(ANTS), seed=seed, **parameters)
    judge = task.make(task.starts)
    steps, returns = [], []
    began = time.process_time()
    seconds = 0.0
    while agent.num_timesteps < task.steps:
        due = (agent.num_timesteps // task.every + 1) * task.every
        agent.learn(total_timesteps=due - agent.num_timesteps)
        seconds += time.process_time() - began
        found = evaluate_policy_cost(
            agent.policy, judge, seed=12_345, max_steps=agent.max_steps
        )
        steps.append(agent.num_timesteps)
        returns.append(found.mean_return)
        began = time.process_time()
    return {
        "seed": seed,
        "steps": steps,
        "returns": returns,
        "seconds": seconds,
        "cells": agent.partition.n_cells,
    }


def summary(name: str, runs: Sequence[Row]) -> Row:
    """Medians over the runs; one that is never good is so later than all others."""
    task, first, since = TASKS[name], [], []
    for one in runs:
        good = [i for i, value in enumerate(one["returns"]) if value >= task.good]
        first.append(one["steps"][good[0]] if good else np.inf)
        if good:
            since.append(statistics.median(one["returns"][good[0] :]))
    middle = statistics.median(first)
    return {
        "task": name,
        "good": task.good,
        "first": None if middle == np.inf else middle,
        "latest": None if max(first) == np.inf else max(first),
        "reached": sum(one < np.inf for one in first),
        "since": statistics.median(since) if since else None,
        "end": statistics.median(one["returns"][-1] for one in runs),
        "worst_end": min(one["returns"][-1] for one in runs),
        "seconds": statistics.median(one["seconds"] for one in runs),
        "cells": statistics.median(one["cells"] for one in runs),
        "runs": list(runs),
    }


def study(tasks: Iterable[str], seeds: range, parameters: dict[str, Any]) -> list[Row]:
    """A row for each task."""
    rows = []
    for name in tasks:
        run(Task(TASKS[name].env_id, 1, 1, 0.0, starts=2), 0, parameters)  # compiles
        runs = [
            run(TASKS[name], seed, parameters)
            for seed in tqdm(seeds, desc=name, leave=False)
        ]
        rows.append(summary(name, runs))
    return rows


def as_markdown(rows: Sequence[Row]) -> str:
    """The table."""
    heads = ["task", "good", "first good after", "latest", "runs", "return since"]
    heads += ["at the end", "worst", "seconds", "cells"]
    lines = [
        [
            row["task"],
            f"{row['good']:g}",
            number(row["first"], ",.0f"),
            number(row["latest"], ",.0f"),
            f"{row['reached']}/{len(row['runs'])}",
            number(row["since"], ".4g"),
            f"{row['end']:.4g}",
            f"{row['worst_end']:.4g}",
            f"{row['seconds']:.2f}",
            f"{row['cells']:,.0f}",
        ]
        for row in rows
    ]
    return markdown(heads, lines)


def _parameter(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"must be NAME=VALUE, got {text!r}")
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        words: dict[str, Any] = {"true": True, "false": False, "none": None}
        return name, words.get(value, value)


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument(
        "--tasks",
        type=some_of(TASKS, ";"),
        default=list(TASKS),
        help=f"some of {'; '.join(TASKS)}, with semicolons (default: all)".replace(
            "%", "%%"
        ),
    )
    add_seeds(parser, 10)
    parser.add_argument(
        "--first-seed", type=int, default=0, help="the first seed (default: 0)"
    )
    parser.add_argument(
        "--param",
        type=_parameter,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a parameter of ReturningACL; may be given several times",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, no table")
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    rows = study(options.tasks, seeds, dict(options.param))
    if options.json:
        print(json.dumps({"parameters": dict(options.param), "rows": rows}))
    else:
        print(as_markdown(rows))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
