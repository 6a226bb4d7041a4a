"""How many ants does the returning colony need on the thesis's pendulum?

Colonies with their defaults and 1 to 50 ants learn from the same number of interactions.
The policy is evaluated after each trial, which takes up to 60 steps of every ant: so the
number of interactions until a good policy is known to within one trial.

    python benchmarks/how_many_ants.py
    python benchmarks/how_many_ants.py --ants 5 50 --seeds 3 --json
"""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
from tables import Row, add_json, add_seeds, at_least_one, markdown, number, parser_of

from acl_gym import ReturningACL, evaluate_policy_cost

GOOD = 1.25 * 38.4
"""A cost that counts as good: within 25% of the best possible one."""


def learn(ants: int, interactions: int, seed: int) -> Row:
    """Learn once.

    Args:
        ants: how many.
        interactions: steps of all ants together, after which learning ends.
        seed: of the colony.
    """
    env: Any = gym.make_vec("acl_gym/Pendulum-v0", num_envs=ants)
    colony = ReturningACL(env, seed=seed)
    first, seconds = math.inf, 0.0
    while colony.num_timesteps < interactions:
        begun = time.process_time()
        colony.learn(trials=1)
        seconds += time.process_time() - begun
        cost = evaluate_policy_cost(colony, env).cost
        if cost <= GOOD:
            first = min(first, colony.num_timesteps)
    return {"first": first, "cost": cost, "seconds": seconds}


def study(numbers: Sequence[int], interactions: int, seeds: int) -> list[Row]:
    """Medians over the seeds for each number of ants, and the worst."""
    learn(1, 1, 0)  # compiles
    rows = []
    for ants in numbers:
        runs = [learn(ants, interactions, seed) for seed in range(seeds)]
        firsts, costs = ([run[key] for run in runs] for key in ("first", "cost"))
        rows.append(
            {
                "ants": ants,
                "good after": _finite(statistics.median(firsts)),
                "slowest": _finite(max(firsts)),
                "last cost": statistics.median(costs),
                "highest": max(costs),
                "seconds": statistics.median(run["seconds"] for run in runs),
            }
        )
    return rows


def _finite(value: float) -> float | None:
    """None in place of infinity, for runs that find no good policy."""
    return value if math.isfinite(value) else None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and print it."""
    parser = parser_of(__doc__)
    add_seeds(parser, 10)
    add_json(parser)
    parser.add_argument(
        "--ants", type=at_least_one, nargs="+", default=[1, 2, 5, 10, 20, 50]
    )
    parser.add_argument("--interactions", type=at_least_one, default=10_000)
    options = parser.parse_args(arguments)
    rows = study(options.ants, options.interactions, options.seeds)
    if options.json:
        print(json.dumps({"rows": rows}, indent=1))
        return
    heads = list(rows[0])
    forms = ["d", ",.0f", ",.0f", ".1f", ".1f", ".2f"]
    shown = [
        [number(value, form) for value, form in zip(row.values(), forms, strict=True)]
        for row in rows
    ]
    print(markdown(heads, shown, names=()))


if __name__ == "__main__":
    main()
