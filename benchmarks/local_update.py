"""When and how often does a visited pair decay? The readings of the local update.

Algorithms 3.1 to 4.2 decay a pair at each visit, and leave open whether the ants of a
step choose before or after it. The analysis counts the ants that have visited the pair,
(3.12)-(3.13), so each ant once, however often it came by. A last reading is once a
trial, whoever came by. Claims C15 and C16 hang on which one it is.

    python benchmarks/local_update.py --seeds 10
"""

from __future__ import annotations

import argparse
import json

import numpy as np
from rich.console import Console
from rich.table import Table
from tqdm.auto import tqdm

from acl_gym import PolicyEvaluation
from acl_gym.reproduction import orders
from acl_gym.reproduction.systems import swing

GAMMAS = (0.0, 0.001, 0.01, 0.1, 0.5)


def last_cost(kind: str, gamma: float, reading: str, seed: int) -> float:
    """The mean policy cost of the last ten of 100 trials."""
    setting = swing(kind, local_decay=gamma)
    env = setting.make_env()
    colony = orders.colony(
        reading, env, setting.make_partition(), seed=seed, **setting.colony
    )
    colony.learn(trials=90)
    colony.learn(trials=10, callback=PolicyEvaluation(env, max_steps=300))
    return float(np.mean([row["policy_cost"] for row in colony.history[-10:]]))


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10, help="runs (default: 10)")
    parser.add_argument("--gammas", type=float, nargs="+", default=GAMMAS)
    parser.add_argument("--kinds", nargs="+", default=["crisp", "fuzzy"])
    parser.add_argument("--json", action="store_true", help="print JSON, no table")
    options = parser.parse_args()
    cases = [
        (kind, gamma, reading)
        for kind in options.kinds
        for gamma in options.gammas
        for reading in orders.ORDERS
    ]
    found = []
    for kind, gamma, reading in tqdm(cases, disable=options.json):
        costs = [last_cost(kind, gamma, reading, seed) for seed in range(options.seeds)]
        low, middle, high = np.quantile(costs, [0.25, 0.5, 0.75])
        found.append(
            {
                "kind": kind,
                "gamma": gamma,
                "reading": reading,
                "median": middle,
                "middle_half": [low, high],
            }
        )
    if options.json:
        print(json.dumps(found, indent=1))
        return 0
    table = Table(title=f"policy cost, last ten trials, median of {options.seeds} runs")
    for heading in ("partition", "gamma", *orders.ORDERS):
        table.add_column(heading)
    for start in range(0, len(found), len(orders.ORDERS)):
        line = found[start : start + len(orders.ORDERS)]
        table.add_row(
            line[0]["kind"],
            f"{line[0]['gamma']:g}",
            *(
                "{median:.1f} [{0:.1f}, {1:.1f}]".format(
                    *each["middle_half"], median=each["median"]
                )
                for each in line
            ),
        )
    Console(width=110).print(table)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
