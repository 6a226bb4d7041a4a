"""What the returning colony owes to its ants, to its memory and to growth.

Each is taken away from `ReturningACL` with its defaults, and nothing else is changed:

- no memory: the ants walk only the newest paths back, as often as before, and levels follow
  these alone (trust = 0); older ones are kept only to say where cells are to be finer;
- one walk back: they remember, but walk back once in place of thirty times;
- neither: they walk the newest paths back, once;
- no growth: cells of a fixed grid that is about as fine as the grown one becomes;
- doubling: all cells are halved at a time, and none sooner where much was tried;
- varied: cells are halved sooner where the policy varies (§7.3), not where much was tried;
- no ants: Q-learning with the same memory, as many replays, the same growth, the same
  optimism and as much exploration. It learns from one remembered step after the other, each on the values
  as they then are, where ants all lay on the same levels and are merged;
- none: Q-learning alone, on the fixed grid.

Where a state is a cell there is nothing to grow. Prints for each the interactions and
the seconds of learning until the greedy policy is for the first time within 25% and 10%
of the best that there is, and its last and best return; medians over the seeds.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from tqdm.auto import tqdm

from acl_gym import (
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    ReturningACL,
    WaitingVectorEnv,
    evaluate_policy_cost,
    value_iteration,
)
from acl_gym.agents.base import TabularAgent
from acl_gym.partitions import Partition
from acl_gym.utils.text import replace_unprintable_letters

# The script beside this one.
from tables import (  # isort: skip
    add_seeds,
    at_least_one,
    markdown,
    number,
    parser_of,
    some_of,
)

SLOTS = 5
WITHIN = (0.25, 0.10)
Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """An environment and what is known of it.

    Attributes:
        env_id: of the environment.
        steps: interactions of a run.
        starts: how many episodes an evaluation has; an environment of this package has
            its own.
        every: how many trials lie between two evaluations.
        fixed: makes a grid as fine as is sensible; None where a state is a cell.
        best: the return of the best policy; None where a model gives it.
        price: what the best policy pays, of which `WITHIN` are shares; None: minus its
            return.
    """

    env_id: str
    steps: int
    starts: int = 1
    every: int = 1
    fixed: Callable[[Any], Partition] | None = None
    best: float | None = None
    price: float | None = None

    def make(self, slots: int) -> VectorEnv[Any, Any, Any]:
        """The environment in so many slots."""
        if self.env_id.startswith("acl_gym/"):
            return gym.make_vec(self.env_id, num_envs=slots)
        return WaitingVectorEnv([lambda: gym.make(self.env_id)] * slots)

    def evaluation(self) -> PolicyEvaluation:
        """Follows the greedy policy between trials, always from the same starts."""
        return PolicyEvaluation(self.make(self.starts), every=self.every)

    def lowest(self, share: float) -> float:
        """The return of a policy that is worse by this share."""
        best = self.best
        if best is None:
            # A discount just below 1 tells short ways from endless ones.
            policy = value_iteration(gym.make(self.env_id), discount=0.999).policy
            best = evaluate_policy_cost(
                policy, self.make(self.starts), seed=0
            ).mean_return
        return best - share * (-best if self.price is None else self.price)


TASKS = {
    "pendulum": Task(
        "acl_gym/Pendulum-v0",
        30_000,
        fixed=lambda space: Fuzzy.from_box(space, (64, 65), circular=[0]),
        best=-38.4,  # by value iteration on a fine grid
    ),
    "mountain car": Task(
        "MountainCar-v0",
        50_000,
        starts=20,
        fixed=lambda space: Fuzzy.from_box(space, (41, 41)),
        best=-100.0,  # the best policies that were ever seen have -98 to -102
    ),
    # From the starts of the evaluation the best way has 13 steps.
    "taxi": Task("Taxi-v4", 20_000, starts=30, every=3, price=13.0),
    "grid": Task("acl_gym/GridSearch2D-v0", 10_000),
}


def colony(task: Task, seed: int, **changed: Any) -> ReturningACL:
    """The returning colony with its defaults, but for what is changed."""
    return ReturningACL(task.make(SLOTS), seed=seed, **changed)


def on_fixed_cells(task: Task, seed: int) -> ReturningACL | None:
    """Without growth; None where there is none."""
    if task.fixed is None:
        return None
    env = task.make(SLOTS)
    grid = task.fixed(env.single_observation_space)
    return ReturningACL(env, grid, grows=False, seed=seed)


def growing(task: Task, seed: int, where: str) -> ReturningACL | None:
    """With growth in other places first; None where there is none."""
    return None if task.fixed is None else colony(task, seed, grows_where=where)


SEQUENTIAL = {
    "discount": 0.99,
    "epsilon": 0.2,
    "learning_rate": 0.3,
    "trace_decay": 0.6,
}
"""Discount and exploration are the colony's. Rate and lambda, of 0.05 to 0.9 and 0 to 0.9, are good on
the pendulum and the grid alike: one setting for all tasks, as the colony has. On the
pendulum alone a rate of 0.1 is better towards the end."""


def without_ants(task: Task, seed: int) -> QLearning:
    """Sequential Q-learning with the memory, the replays and the growth of the colony."""
    return QLearning(
        task.make(SLOTS),
        replay=ReturningACL.walks_back.default,
        grows=True,
        optimism=ReturningACL.optimism.default,
        seed=seed,
        **SEQUENTIAL,
    )


def alone(task: Task, seed: int) -> QLearning:
    """Q(lambda) on fixed cells that forgets what it has learned from."""
    env = task.make(SLOTS)
    grid = None if task.fixed is None else task.fixed(env.single_observation_space)
    return QLearning(env, grid, seed=seed, **SEQUENTIAL)


VARIANTS: dict[str, Callable[[Task, int], TabularAgent | None]] = {
    "returning": colony,
    "no memory": lambda task, seed: colony(task, seed, older_steps=0, trust=0.0),
    "one walk back": lambda task, seed: colony(task, seed, walks_back=1),
    "neither": lambda task, seed: colony(
        task, seed, older_steps=0, trust=0.0, walks_back=1
    ),
    "no growth": on_fixed_cells,
    "doubling": lambda task, seed: growing(task, seed, "everywhere"),
    "varied": lambda task, seed: growing(task, seed, "varied"),
    "no ants": without_ants,
    "none": alone,
}


def run(agent: TabularAgent, task: Task, bounds: Sequence[float], steps: int) -> Row:
    """Learn, and say when the policy was good enough for the first time."""
    agent.learn(total_timesteps=steps, callback=task.evaluation())
    rows = [row for row in agent.history if "policy_cost" in row]
    returns = [row.get("policy_return", -row["policy_cost"]) for row in rows]
    found: Row = {"last": returns[-1], "best": max(returns)}
    for share, bound in zip(WITHIN, bounds, strict=True):
        good = (row for row, value in zip(rows, returns, strict=True) if value >= bound)
        first = next(good, None)
        name = f"{100 * share:.0f}"
        found[f"steps_{name}"] = None if first is None else first["env_steps"]
        found[f"seconds_{name}"] = None if first is None else first["seconds"]
    found["steps"], found["seconds"] = agent.num_timesteps, agent.seconds
    return found


def summary(runs: Sequence[Row]) -> Row:
    """Medians; of what was not always reached, None counts as later than all others."""
    row: Row = {}
    for name in runs[0]:
        values = [np.inf if one[name] is None else one[name] for one in runs]
        middle = statistics.median(values)
        row[name] = None if middle == np.inf else middle
    for share in WITHIN:
        name = f"{100 * share:.0f}"
        row[f"reached_{name}"] = sum(one[f"steps_{name}"] is not None for one in runs)
    return row


def ablation(
    tasks: Iterable[str], variants: Iterable[str], seeds: int, steps: int | None
) -> list[Row]:
    """One row for each task and variant, with its runs."""
    rows, variants = [], list(variants)
    for name in tasks:
        task = TASKS[name]
        bounds = [task.lowest(share) for share in WITHIN]
        for variant in variants:
            make = VARIANTS[variant]
            warm = make(task, 0)
            if warm is None:
                continue
            warm.learn(trials=2, callback=task.evaluation())  # Numba compiles
            runs = []
            for seed in tqdm(range(seeds), desc=f"{name}, {variant}", leave=False):
                agent = make(task, seed)
                if agent is not None:
                    runs.append(run(agent, task, bounds, steps or task.steps))
            rows.append(
                {"task": name, "variant": variant, **summary(runs), "runs": runs}
            )
    return rows


def as_markdown(rows: Sequence[Row], seeds: int) -> str:
    """The table."""
    heads = ["task", "variant"]
    heads += ["steps to 25%", "seconds", "steps to 10%", "seconds"]
    heads += ["last return", "best"]
    lines = []
    for row in rows:
        cells = [row["task"], row["variant"]]
        for name in ("25", "10"):
            reached = row[f"reached_{name}"]
            some = f" ({reached} of {seeds})" if reached < seeds else ""
            cells.append(number(row[f"steps_{name}"], ",.0f") + some)
            cells.append(number(row[f"seconds_{name}"], ".2f"))
        cells += [f"{row['last']:.2f}", f"{row['best']:.2f}"]
        lines.append(cells)
    return markdown(heads, lines, names=(0, 1))


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument(
        "--tasks",
        type=some_of(TASKS),
        default=list(TASKS),
        help=f"some of {', '.join(TASKS)}, with commas (default: all)",
    )
    parser.add_argument(
        "--variants",
        type=some_of(VARIANTS),
        default=list(VARIANTS),
        help=f"some of {', '.join(VARIANTS)}, with commas (default: all)",
    )
    add_seeds(parser, 10)
    parser.add_argument(
        "--steps",
        type=at_least_one,
        help="interactions of each run (default: those of the task)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, no table")
    options = parser.parse_args(arguments)
    rows = ablation(options.tasks, options.variants, options.seeds, options.steps)
    if options.json:
        print(json.dumps({"seeds": options.seeds, "rows": rows}))
    else:
        print(as_markdown(rows, options.seeds))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
