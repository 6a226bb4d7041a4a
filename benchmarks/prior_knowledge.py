"""What prior knowledge is worth (§7.3): good, useless and wrong, told in three ways.

On the pendulum the good knowledge is a controller that pumps energy until the pendulum
may be caught and then holds it (it alone costs 45.3, the best policy 38.4); on the
navigation one that thrusts towards the goal and brakes (58.8 alone, 55.6 the best
known). Wrong knowledge does the opposite in every state, useless knowledge prefers an
action of each cell at random. What is preferred counts ten times as much as the rest:

- `heuristic`: as a heuristic with a constant exponent of 1;
- `decaying`: likewise, with an exponent that falls by a tenth with each trial;
- `initial`: as the levels to begin with: in `ACL` ten times tau0; in `ReturningACL` what
  is preferred promises a cost of 0, the rest half of the best policy's.

Where cells become finer, useless knowledge is drawn anew for them.

Prints for `ACL` with the thesis's settings and for `ReturningACL` with its defaults the
interactions until the greedy policy is for the first time within 25% and 10% of the
best, its cost after a tenth of the run, and at the end; medians over the seeds. With
--figure it draws the curves.
"""

from __future__ import annotations

import json
import statistics
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter
from tqdm.auto import tqdm

from acl_gym import (
    ACL,
    Exponential,
    Fuzzy,
    PolicyPrior,
    ReturningACL,
    evaluate_policy_cost,
)
from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.agents.base import TabularAgent
from acl_gym.partitions import Partition
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.plotting.style import BLUE, GREEN, ORANGE, in_style, new_figure
from acl_gym.utils.text import replace_unprintable_letters

# The script beside this one.
from tables import (  # isort: skip
    add_results,
    add_seeds,
    markdown,
    parser_of,
    rows_of,
    some_of,
)

Row = dict[str, Any]
Array = np.ndarray
Rule = Callable[[Array], Array]

STRENGTH = 10.0
WITHIN = (0.25, 0.10)
KNOWLEDGE = ("good", "useless", "wrong")
WAYS = ("heuristic", "decaying", "initial")


def swing_up(states: Array) -> Array:
    """Torque, N m: pump energy, and near the top hold the pendulum by a PD controller."""
    angle = np.remainder(states[:, 0], 2 * np.pi) - np.pi  # from upright
    speed = states[:, 1]
    energy = 0.0025 * speed**2 + 0.0981 * (np.cos(angle) - 1.0)  # J, 0 upright at rest
    pump = np.where((speed >= 0.0) == (energy < 0.0), 0.8, -0.8)
    near = np.abs(angle + 0.2 * speed) < 0.8
    return np.where(near, -(2.5 * angle + 0.3 * speed), pump)


def to_the_goal(states: Array) -> Array:
    """Forces, N: thrust towards the origin, and brake."""
    return -2.0 * (states[:, [0, 2]] + states[:, [1, 3]])


@dataclass(frozen=True)
class Task:
    """A system, what is known of it, and how long the agents learn.

    Attributes:
        env_id: of the environment.
        best: the lowest policy cost that is known.
        rule: the good controller.
        acl: parameters of `ACL`.
        ants: of `ACL`; `ReturningACL` has five.
        partition: of `ACL`.
        steps: interactions of a run, of both agents.
        every: interactions between two evaluations, of both.
    """

    env_id: str
    best: float
    rule: Rule
    acl: Row
    ants: int
    partition: Callable[[Any], Partition]
    steps: Row
    every: Row


TASKS = {
    "pendulum": Task(
        "acl_gym/Pendulum-v0",
        38.4,
        swing_up,
        {"tau0": 1e-4},
        250,
        lambda env: Fuzzy.from_box(env.single_observation_space, (40, 41), [0]),
        {"ACL": 1_000_000, "ReturningACL": 6_000},
        {"ACL": 30_000, "ReturningACL": 300},
    ),
    "navigation": Task(
        "acl_gym/Navigation-v0",
        55.6,
        to_the_goal,
        {"tau0": 1e-3, "selection": "boltzmann", "max_steps": 150},
        200,
        lambda env: thesis_partition(env, "regular"),
        {"ACL": 600_000, "ReturningACL": 6_000},
        {"ACL": 30_000, "ReturningACL": 600},
    ),
}
AGENTS = ("ACL", "ReturningACL")


def opposite(rule: Rule) -> Rule:
    """Does the opposite of a controller."""
    return lambda states: -rule(states)


def at_random(seed: int, numbers: int) -> Rule:
    """Prefers an action of each state at random."""
    return lambda states: np.random.default_rng(seed).integers(
        numbers, size=len(states)
    )


def told(task: Task, agent: str, knowledge: str, way: str, seed: int, n: int) -> Row:
    """The parameters that tell an agent something; n: how many actions there are."""
    if knowledge == "none":
        return {}
    rules = {
        "good": task.rule,
        "wrong": opposite(task.rule),
        "useless": at_random(seed, n),
    }
    rule = rules[knowledge]
    if way != "initial":
        beta = Exponential(1.0, 0.9) if way == "decaying" else 1.0
        return {"heuristic": PolicyPrior(rule, preferred=STRENGTH), "beta": beta}
    preferred, others = 0.0, -task.best / 2.0
    if agent == "ACL":
        preferred, others = STRENGTH * task.acl["tau0"], task.acl["tau0"]
    return {"initial": PolicyPrior(rule, preferred=preferred, others=others)}


def make(task: Task, agent: str, knowledge: str, way: str, seed: int) -> TabularAgent:
    """An agent that was told something."""
    ants = task.ants if agent == "ACL" else 5
    env = gym.make_vec(task.env_id, num_envs=ants)
    n = int(env.single_action_space.n)
    more = told(task, agent, knowledge, way, seed, n)
    if agent == "ReturningACL":
        return ReturningACL(env, seed=seed, **more)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PheromoneBoundWarning)
        return ACL(env, task.partition(env), seed=seed, **task.acl, **more)


def run(task: Task, agent: str, knowledge: str, way: str, seed: int) -> Row:
    """Learn, and evaluate the greedy policy at regular intervals and before."""
    learner = make(task, agent, knowledge, way, seed)
    judge = gym.make_vec(task.env_id, num_envs=1)
    interactions, costs = [0], [evaluate_policy_cost(learner, judge, seed=1).cost]
    began = time.process_time()
    while learner.num_timesteps < task.steps[agent]:
        due = (learner.num_timesteps // task.every[agent] + 1) * task.every[agent]
        learner.learn(total_timesteps=due - learner.num_timesteps)
        interactions.append(learner.num_timesteps)
        costs.append(evaluate_policy_cost(learner, judge, seed=1).cost)
    return {
        "seed": seed,
        "interactions": interactions,
        "costs": costs,
        "seconds": time.process_time() - began,
    }


def summary(
    name: str, agent: str, knowledge: str, way: str, runs: Sequence[Row]
) -> Row:
    """Medians over the runs; one that is never near is so later than all others."""
    task, near = TASKS[name], []
    for share in WITHIN:
        limit = (1.0 + share) * task.best
        first = [
            next(
                (
                    when
                    for when, cost in zip(
                        one["interactions"], one["costs"], strict=True
                    )
                    if cost <= limit
                ),
                np.inf,
            )
            for one in runs
        ]
        middle = statistics.median(first)
        near.append(
            {
                "within": share,
                "interactions": None if middle == np.inf else middle,
                "runs": sum(one < np.inf for one in first),
            }
        )
    tenth = [
        float(np.interp(task.steps[agent] / 10, one["interactions"], one["costs"]))
        for one in runs
    ]
    return {
        "task": name,
        "agent": agent,
        "knowledge": knowledge,
        "way": way,
        "near": near,
        "before": statistics.median(one["costs"][0] for one in runs),
        "tenth": statistics.median(tenth),
        "last": statistics.median(one["costs"][-1] for one in runs),
        "worst": max(one["costs"][-1] for one in runs),
        "seconds": statistics.median(one["seconds"] for one in runs),
        "runs": list(runs),
    }


def study(
    tasks: Iterable[str], agents: Sequence[str], ways: Sequence[str], seeds: range
) -> list[Row]:
    """A row for each task, agent, kind of knowledge and way to tell it."""
    cases = [("none", "-"), *((k, w) for k in KNOWLEDGE for w in ways)]
    rows = []
    for name in tasks:
        for agent in agents:
            for knowledge, way in tqdm(cases, desc=f"{name}, {agent}", leave=False):
                runs = [run(TASKS[name], agent, knowledge, way, s) for s in seeds]
                rows.append(summary(name, agent, knowledge, way, runs))
    return rows


def as_markdown(rows: Sequence[Row]) -> str:
    """The table."""
    heads = ["task", "agent", "knowledge", "told as"]
    heads += ["within 25% after", "runs", "within 10% after", "runs"]
    heads += ["cost before", "after a tenth", "at the end", "worst"]
    lines = []
    for row in rows:
        near = []
        for each in row["near"]:
            when = each["interactions"]
            near.append("never" if when is None else f"{when:,.0f}")
            near.append(f"{each['runs']}/{len(row['runs'])}")
        costs = [f"{row[n]:.1f}" for n in ("before", "tenth", "last", "worst")]
        names = [row["task"], row["agent"], row["knowledge"], row["way"]]
        lines.append([*names, *near, *costs])
    return markdown(heads, lines, names=range(4))


COLOURS = {"none": "0.35", "good": GREEN, "useless": BLUE, "wrong": ORANGE}
BEST: Row = {"color": "0.2", "linewidth": 0.8, "linestyle": ":"}
TITLES = {
    "heuristic": "heuristic, constant exponent",
    "decaying": "heuristic, exponent that decays",
    "initial": "first levels",
}


@in_style()
def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the median cost over interactions, a row of panels for each task and agent."""
    pairs = list(dict.fromkeys((row["task"], row["agent"]) for row in rows))
    ways = [way for way in WAYS if any(row["way"] == way for row in rows)]
    figure = new_figure(1.75 * len(pairs) + 0.4, dpi=150)
    grid = figure.subplots(
        len(pairs), len(ways), sharex="row", sharey="row", squeeze=False
    )
    for line, (name, agent) in zip(grid, pairs, strict=True):
        task = TASKS[name]
        for ax, way in zip(line, ways, strict=True):
            for row in rows:
                if (row["task"], row["agent"]) == (name, agent) and (
                    row["way"] in (way, "-")
                ):
                    when, cost = _median_curve(row["runs"], task.steps[agent])
                    ax.plot(when, cost, color=COLOURS[row["knowledge"]])
            ax.axhline(task.best, **BEST)
            ax.set(yscale="log", xlim=(0, task.steps[agent]))
            ax.xaxis.set_major_formatter(EngFormatter(sep=""))
            if ax in grid[0]:
                ax.set_title(TITLES[way])
        line[0].set_ylabel(f"{name}\n{agent}\npolicy cost")
    for ax in grid[-1]:
        ax.set_xlabel("interactions")
    handles = [Line2D([], [], color=colour) for colour in COLOURS.values()]
    handles.append(Line2D([], [], **BEST))
    labels = [*COLOURS, "the best known policy"]
    figure.legend(handles, labels, ncols=len(labels), loc="outside upper center")
    figure.savefig(path)


def _median_curve(runs: Sequence[Row], steps: int) -> tuple[Array, Array]:
    """The median over the runs, at fixed numbers of interactions."""
    when = np.linspace(0, steps, 60)
    costs = [np.interp(when, one["interactions"], one["costs"]) for one in runs]
    return when, np.median(costs, axis=0)


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = parser_of(__doc__)
    for option, allowed in (
        ("--tasks", list(TASKS)),
        ("--agents", list(AGENTS)),
        ("--ways", list(WAYS)),
    ):
        parser.add_argument(
            option,
            type=some_of(allowed),
            default=allowed,
            help=f"some of {', '.join(allowed)} (default: all)",
        )
    add_seeds(parser)
    add_results(parser, "the curves")
    options = parser.parse_args(arguments)
    if options.from_json is not None:
        rows = rows_of(options.from_json)
    else:
        seeds = range(options.seeds)
        rows = study(options.tasks, options.agents, options.ways, seeds)
    if options.figure is not None:
        draw(rows, options.figure)
    if options.json:
        print(json.dumps({"rows": rows}))
    else:
        print(as_markdown(rows))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
