"""Measure settings of DQN on the pendulum: what docs/dqn-tuning.md was made with.

Each candidate is a number of changes to where the search began. Every run is one line
of a JSON Lines file; runs that are already in it are not made again, so the search can
be stopped and resumed. The table at the end is Markdown.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from acl_gym.sb3.callback import PolicyCostCallback
from acl_gym.sb3.dqn import DQNSettings, make_dqn, scaled_env
from acl_gym.utils.text import replace_unprintable_letters

ENV_ID = "acl_gym/Pendulum-v0"
NEAR_OPTIMUM = 1.1 * 38.4
"""Within 10% of J*, the cost of value iteration on a fine grid."""

Changes = dict[str, Any]
Run = dict[str, Any]

# What is not named here has its default.
START: Changes = {"num_envs": 8, "reward_scale": 1.0, "max_episode_steps": 300}
SHORT: Changes = {"num_envs": 4, "reward_scale": 0.5, "max_episode_steps": 100}
LONG: Changes = {**SHORT, "exploration_fraction": 0.02, "final_learning_rate": 1e-5}

CANDIDATES: dict[str, Changes] = {
    "start": {},
    "discount 0.98": {"discount": 0.98},
    "discount 0.995": {"discount": 0.995},
    "discount 0.98, reward_scale 0.1": {"discount": 0.98, "reward_scale": 0.1},
    "discount 0.98, net 128, 128": {"discount": 0.98, "net_arch": (128, 128)},
    "discount 0.98, max_episode_steps 100": {
        "discount": 0.98,
        "max_episode_steps": 100,
    },
    "reward_scale 0.5": {"reward_scale": 0.5},
    "reward_scale 0.5, net 128, 128": {"reward_scale": 0.5, "net_arch": (128, 128)},
    "net 128, 128": {"net_arch": (128, 128)},
    "net 128, 128, learning_rate to 1e-4": {
        "net_arch": (128, 128),
        "final_learning_rate": 1e-4,
    },
    "learning_rate 5e-4": {"learning_rate": 5e-4, "final_learning_rate": 5e-4},
    "learning_rate 1e-3 to 1e-4": {"final_learning_rate": 1e-4},
    "learning_rate 1e-3 to 1e-4, batch_size 128": {
        "final_learning_rate": 1e-4,
        "batch_size": 128,
    },
    "learning_rate 2e-3 to 2e-4": {
        "learning_rate": 2e-3,
        "final_learning_rate": 2e-4,
    },
    "learning_rate 2e-3 to 2e-4, reward_scale 0.3": {
        "learning_rate": 2e-3,
        "final_learning_rate": 2e-4,
        "reward_scale": 0.3,
    },
    "batch_size 128": {"batch_size": 128},
    "n_steps 3": {"n_steps": 3},
    "updates_per_step 0.5": {"updates_per_step": 0.5},
    "target_update_interval 104": {"target_update_interval": 104},
    "target_update_interval 400": {"target_update_interval": 400},
    "target_update_interval 8, rate 0.05": {
        "target_update_interval": 8,
        "target_update_rate": 0.05,
    },
    "exploration over a tenth, to 0.1, learning_starts 500": {
        "exploration_fraction": 0.1,
        "exploration_final": 0.1,
        "learning_starts": 500,
    },
    "max_episode_steps 100": {"max_episode_steps": 100},
    "num_envs 16": {"num_envs": 16},
    "num_envs 4": {"num_envs": 4},
    "num_envs 4, updates_per_step 2": {"num_envs": 4, "updates_per_step": 2.0},
    "num_envs 4, max_episode_steps 100": {"num_envs": 4, "max_episode_steps": 100},
    "num_envs 4, reward_scale 0.5": {"num_envs": 4, "reward_scale": 0.5},
    "short": SHORT,
    "short, learning_rate to 2e-4": {**SHORT, "final_learning_rate": 2e-4},
    "short, batch_size 128": {**SHORT, "batch_size": 128},
    "long": LONG,
}


def measure(name: str, seed: int, steps: int, evaluations: int) -> Run:
    """Train once, and evaluate the policy so many times on the way."""
    settings = replace(DQNSettings(), **{**START, **CANDIDATES[name]})
    model = make_dqn(ENV_ID, settings, seed)
    every = max(1, steps // evaluations)
    costs = PolicyCostCallback(scaled_env(ENV_ID), every=every)
    cpu = time.process_time()
    model.learn(steps, callback=costs, log_interval=steps)
    return {
        "name": name,
        "steps": steps,
        "seed": seed,
        "cpu_seconds": time.process_time() - cpu,
        "rows": costs.history,
    }


def key(run: Run) -> tuple[str, int, int]:
    return run["name"], run["steps"], run["seed"]


def summary(runs: Iterable[Run]) -> str:
    """One line of the table for the runs of one candidate."""
    best, late, last, near, seconds = [], [], [], [], []
    for run in runs:
        costs = [row["policy_cost"] for row in run["rows"]]
        best.append(f"{min(costs):.1f}")
        late.append(f"{statistics.median(costs[len(costs) // 2 :]):.1f}")
        last.append(f"{costs[-1]:.1f}")
        reached = (r for r in run["rows"] if r["policy_cost"] <= NEAR_OPTIMUM)
        first = next(reached, None)
        near.append("-" if first is None else f"{first['env_steps'] / 1000:g}")
        seconds.append(f"{run['rows'][-1]['seconds']:.0f}")
    return " | ".join(", ".join(column) for column in (best, late, last, near, seconds))


def table(runs: list[Run], names: Iterable[str]) -> str:
    lines = [
        "| setting | best | median of the second half | last "
        f"| thousand steps to {NEAR_OPTIMUM:.1f} | seconds |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in names:
        mine = sorted((r for r in runs if r["name"] == name), key=key)
        if mine:
            lines.append(f"| {name} | {summary(mine)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=20_000, help="of each run")
    parser.add_argument("--seeds", type=int, default=2, help="runs of each candidate")
    parser.add_argument(
        "--evaluations", type=int, default=20, help="of the policy in each run"
    )
    parser.add_argument(
        "--only",
        nargs="+",
        metavar="NAME",
        choices=list(CANDIDATES),
        default=list(CANDIDATES),
        help="some candidates: " + "; ".join(map(repr, CANDIDATES)),
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/dqn-tuning.jsonl"),
        help="file of the runs, added to (default: results/dqn-tuning.jsonl)",
    )
    args = parser.parse_args()
    torch.set_num_threads(1)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    lines = args.out.read_text().splitlines() if args.out.exists() else []
    runs: list[Run] = [json.loads(line) for line in lines]
    done = {key(run) for run in runs}
    wanted = [
        (name, args.steps, seed) for name in args.only for seed in range(args.seeds)
    ]
    with args.out.open("a") as file:
        for name, steps, seed in tqdm([w for w in wanted if w not in done], unit="run"):
            run = measure(name, seed, steps, args.evaluations)
            runs.append(run)
            file.write(json.dumps(run) + "\n")
            file.flush()
    print(table([run for run in runs if key(run) in set(wanted)], args.only))


if __name__ == "__main__":
    replace_unprintable_letters()
    main()
