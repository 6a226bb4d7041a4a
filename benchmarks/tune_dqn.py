"""Measure settings of DQN, PPO or A2C on the pendulum; docs/dqn-tuning.md has DQN's.

Each candidate is a number of changes to where the search began. Those of DQN were chosen
by hand, one after the other. PPO and A2C get as many: their defaults, and settings that are
drawn evenly from the ranges that benchmarks/tune.py searches. Every run is one line of a
JSON Lines file; runs that are already in it are not made again, so the search can be
stopped and resumed. The table at the end is Markdown.

examples:
  python benchmarks/tune_dqn.py                                 DQN
  python benchmarks/tune_dqn.py --agent ppo --steps 100000      PPO, which takes a fifth
                                                                of the time for a step
  python benchmarks/tune_dqn.py --agent a2c --only defaults "drawn 3" --seeds 5
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from acl_gym.experiments.comparison.tasks import TASKS
from acl_gym.experiments.names import NETWORKS
from acl_gym.sb3.callback import PolicyCostCallback
from acl_gym.sb3.dqn import scaled_env
from acl_gym.sb3.models import MODELS
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

OF_DQN: dict[str, Changes] = {
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


def candidates_of(agent: str) -> dict[str, Changes]:
    """The settings that are tried, by name: what differs from the defaults."""
    if agent == "dqn":
        return {name: {**START, **changes} for name, changes in OF_DQN.items()}
    import optuna
    from tune import space_of

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    space, found = space_of(TASKS["pendulum"], agent), {"defaults": {}}
    for number in range(1, len(OF_DQN)):
        drawn = study.ask(space).params
        drawn["final_learning_rate"] = drawn["learning_rate"]
        found[f"drawn {number}"] = drawn
    return found


def measure(
    agent: str, name: str, changes: Changes, seed: int, steps: int, evaluations: int
) -> Run:
    """Train once, and evaluate the policy so many times on the way."""
    kind = MODELS[agent]
    model = kind.make(ENV_ID, kind.settings(**changes), seed)
    every = max(1, steps // evaluations)
    costs = PolicyCostCallback(scaled_env(ENV_ID), every=every)
    cpu = time.process_time()
    model.learn(steps, callback=costs, log_interval=steps)
    return {
        "agent": agent,
        "name": name,
        "settings": changes,
        "steps": steps,
        "seed": seed,
        "cpu_seconds": time.process_time() - cpu,
        "rows": costs.history,
    }


def key(run: Run) -> tuple[str, str, int, int]:
    # The files that there were before PPO and A2C do not name the agent.
    return run.get("agent", "dqn"), run["name"], run["steps"], run["seed"]


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


def words(name: str, changes: Changes) -> str:
    """A candidate's name, with its settings where these say more."""
    if not name.startswith("drawn"):
        return name
    shown = (
        f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in changes.items()
        if key != "final_learning_rate"
    )
    return f"{name}: {', '.join(shown)}"


def table(runs: list[Run], candidates: dict[str, Changes]) -> str:
    lines = [
        "| setting | best | median of the second half | last "
        f"| thousand steps to {NEAR_OPTIMUM:.1f} | seconds |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, changes in candidates.items():
        mine = sorted((r for r in runs if r["name"] == name), key=key)
        if mine:
            lines.append(f"| {words(name, changes)} | {summary(mine)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--agent", choices=NETWORKS, default="dqn", help="default: %(default)s"
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
        help="some candidates; of PPO and A2C 'defaults', 'drawn 1' and so on; of DQN "
        + "; ".join(map(repr, OF_DQN)),
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="file of the runs, added to (default: results/AGENT-tuning.jsonl)",
    )
    args = parser.parse_args()
    candidates = candidates_of(args.agent)
    for name in args.only or ():
        if name not in candidates:
            parser.error(
                f"--only must be among {', '.join(map(repr, candidates))}, got {name!r}."
            )
    candidates = {name: candidates[name] for name in args.only or candidates}
    args.out = args.out or Path(f"results/{args.agent}-tuning.jsonl")
    torch.set_num_threads(1)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    lines = args.out.read_text().splitlines() if args.out.exists() else []
    runs: list[Run] = [json.loads(line) for line in lines]
    done = {key(run) for run in runs}
    wanted = [
        (args.agent, name, args.steps, seed)
        for name in candidates
        for seed in range(args.seeds)
    ]
    with args.out.open("a") as file:
        for each in tqdm([w for w in wanted if w not in done], unit="run"):
            agent, name, steps, seed = each
            run = measure(agent, name, candidates[name], seed, steps, args.evaluations)
            runs.append(run)
            file.write(json.dumps(run) + "\n")
            file.flush()
    print(table([run for run in runs if key(run) in set(wanted)], candidates))


if __name__ == "__main__":
    replace_unprintable_letters()
    main()
