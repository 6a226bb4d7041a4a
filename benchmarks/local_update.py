"""How often does a visited pair decay? Three readings of the local update, measured.

Algorithms 3.1 to 4.2 decay a pair at each visit. The analysis counts the ants that have
visited it, (3.12)-(3.13), so each ant once, however often it came by. A third reading is
once a trial, whoever came by. Claims C15 and C16 hang on which one it is.

    python benchmarks/local_update.py --seeds 10
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from tqdm.auto import tqdm

from acl_gym import ACL, PolicyEvaluation
from acl_gym.agents.pheromone import Pheromone
from acl_gym.reproduction.systems import swing

READINGS = {
    "visit": "at each visit (Algorithm 4.2)",
    "ant": "once for each ant (3.13)",
    "trial": "once a trial",
}
GAMMAS = (0.0, 0.001, 0.01, 0.1, 0.5)


class AtTheEnd(Pheromone):
    """Pheromone that decays at the end of the trial, not on the way.

    Attributes:
        each_ant: once for each ant that has visited a pair, or once.
        gamma: the local decay of the trial.
    """

    each_ant = True
    gamma = 0.0

    def local_update(
        self, index: Any, degree: Any, actions: Any, local_decay: float
    ) -> None:
        """Remember gamma."""
        self.gamma = local_decay

    def global_update(self, solutions: Any, deposits: Any, global_decay: float) -> None:
        """Decay what was visited, with each ant's largest degree; then reinforce."""
        n_pairs = self.levels.size
        kept, most = np.ones(n_pairs), np.zeros(n_pairs)
        for block in solutions.blocks():
            pairs = block.index * self.n_actions + block.action[:, None]
            for start, end in zip(
                np.concatenate([[0], block.ends[:-1]]), block.ends, strict=True
            ):
                own = np.zeros(n_pairs)
                np.maximum.at(
                    own, pairs[start:end].ravel(), block.degree[start:end].ravel()
                )
                kept *= 1.0 - self.gamma * own
                np.maximum(most, own, out=most)
        left = kept if self.each_ant else 1.0 - self.gamma * most
        levels = self.levels.ravel()
        self.set_levels(
            (left * (levels - self.tau0) + self.tau0).reshape(self.levels.shape)
        )
        super().global_update(solutions, deposits, global_decay)


def last_cost(kind: str, gamma: float, reading: str, seed: int) -> float:
    """The mean policy cost of the last ten of 100 trials."""
    setting = swing(kind, local_decay=gamma)
    env = setting.make_env()
    colony = ACL(env, setting.make_partition(), seed=seed, **setting.colony)
    if reading != "visit":
        old = colony.pheromone
        colony.pheromone = AtTheEnd(len(old.levels), old.n_actions, old.tau0, old.alpha)
        colony.pheromone.each_ant = reading == "ant"
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
        for reading in READINGS
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
    for heading in ("partition", "gamma", *READINGS.values()):
        table.add_column(heading)
    for start in range(0, len(found), len(READINGS)):
        line = found[start : start + len(READINGS)]
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
