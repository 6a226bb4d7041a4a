"""What it costs to learn, with and without an inner loop and a shield (§7.3).

Two tasks, in each of which a simple controller is known that does the job, but poorly:

- hold: a pendulum is to be held upright from small deviations; more than 0.5 rad from
  upright is a violation;
- navigation: the vehicle of §4.5 is to stay out of the regions in which the damping exceeds
  3 kg/s on its way; the controller knows a way around them and follows it slowly. It starts
  where that controller stays out.

`ReturningACL` with its defaults and five ants learns with each of these arrangements:

- free: it chooses the inputs, and nothing watches over it;
- shield: the controller takes over where the state leaves a set with a margin, without a
  model;
- shield, model: where the model says that the learner's action, and the controller after
  it, would not stay in the safe set;
- shield, model, masks: the same, and the actions that would be replaced are forbidden;
- inner loop: it chooses the parameters of the controller;
- inner loop, shield, model: likewise, among more daring ones, under the shield.

Prints for each the violations on the way (steps outside the safe set in 1,000, and in how
many of 1,000 episodes there was one), the cost of a step on the way in the first tenth of the
interactions and in all, how often the shield stepped in, and at the end the cost of the
greedy policy, with its violations, under the same arrangement and without the shield: medians
over the seeds.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import VectorWrapper
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter
from tqdm.auto import tqdm

from acl_gym import InnerLoop, ReturningACL, Shield, evaluate_policy_cost
from acl_gym.envs.control.actuator import nearest_actions
from acl_gym.plotting.style import BLACK, BLUE, GREEN, ORANGE, in_style, new_figure
from acl_gym.utils.text import replace_unprintable_letters

# The scripts beside this one.
from safe_tasks import STARTS, TASKS, Array, Task  # isort: skip
from tables import (  # isort: skip
    add_results,
    add_seeds,
    at_least_one,
    markdown,
    parser_of,
    rows_of,
    some_of,
)

Row = dict[str, Any]
SLOTS = 5


class Watch(VectorWrapper):
    """Notes what happens in each step, outside all other wrappers.

    Args:
        env: whose finished slots wait.
        safe: which of its states are safe.
    """

    def __init__(self, env: Any, safe: Callable[[Array], Array]) -> None:
        super().__init__(env)
        self.safe = safe
        self.costs: list[Array] = []
        self.violations: list[Array] = []
        self.episodes: list[Array] = []  # whether there was a violation in each
        self._idle = np.zeros(self.num_envs, dtype=bool)
        self._seen = np.zeros(self.num_envs, dtype=bool)
        self._length = np.zeros(self.num_envs, dtype=int)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        begun = self._length > 0
        self.episodes.append(self._seen[begun])
        self._idle[:], self._seen[:], self._length[:] = False, False, 0
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: Any) -> Any:
        result = self.env.step(actions)
        walks = ~self._idle
        outside = ~self.safe(result[0])
        self.costs.append(-result[1][walks])
        self.violations.append(outside[walks])
        self._seen |= outside & walks
        self._length += walks
        self._idle |= result[2] | result[3]
        return result

    def summary(self) -> Row:
        """Costs and violations of all steps so far."""
        self.episodes.append(self._seen[self._length > 0])
        costs = np.concatenate(self.costs)
        tenth = max(costs.size // 10, 1)
        return {
            "steps": int(costs.size),
            "cost_first_tenth": float(costs[:tenth].mean()),
            "cost": float(costs.mean()),
            "violations": 1_000 * float(np.concatenate(self.violations).mean()),
            "episodes": 1_000 * float(np.concatenate(self.episodes).mean()),
        }


def arranged(task: Task, kind: str, plants: Any) -> Any:
    """The plants in one of the arrangements."""
    if kind == "free":
        return plants
    model: Row = {"predict": True, "look_ahead": task.look_ahead}
    if kind == "inner loop":
        return InnerLoop(plants, task.controller, task.cautious)
    if kind == "shield":
        return Shield(plants, task.baseline, task.margin)
    if kind == "inner loop, shield, model":
        plants = _shielded(task, plants, **model)
        return InnerLoop(plants, task.controller, task.daring)
    return _shielded(task, plants, **model, mask_actions=kind.endswith("masks"))


def _shielded(task: Task, plants: Any, **keywords: Any) -> Any:
    return Shield(plants, task.baseline, task.safe, **keywords)


def run(task: Task, kind: str, seed: int) -> Row:
    """Learn in one arrangement; evaluate the greedy policy in the same one."""
    plants = task.make(SLOTS)
    shielded = arranged(task, kind, plants)
    watch = Watch(shielded, task.safe)
    began = time.process_time()
    colony = ReturningACL(watch, seed=seed).learn(total_timesteps=task.steps)
    seconds = time.process_time() - began
    found = watch.summary()
    interventions = _interventions(shielded)
    return {
        "seed": seed,
        **found,
        "interventions": None
        if interventions is None
        else 1_000 * interventions / found["steps"],
        "seconds": seconds,
        **judged(task, kind, colony, seed),
        **without_shield(task, kind, colony, seed),
        "exploring": found_costs(watch),
    }


def found_costs(watch: Watch) -> Row:
    """Violations and cost of each hundredth of the interactions."""
    costs, outside = (np.concatenate(a) for a in (watch.costs, watch.violations))
    parts = np.array_split(np.arange(costs.size), 100)
    return {
        "costs": [float(costs[part].mean()) for part in parts],
        "violations": [int(outside[part].sum()) for part in parts],
    }


def _interventions(env: Any) -> int | None:
    """How often shields have stepped in; None where there is none."""
    while isinstance(env, VectorWrapper):
        if isinstance(env, Shield):
            return int(env.interventions.sum())
        env = env.env
    return None


def judged(task: Task, kind: str, policy: Any, seed: int) -> Row:
    """Cost and violations of a policy from the evaluation states."""
    watch = Watch(arranged(task, kind, task.make(STARTS)), task.safe)
    states = watch.unwrapped.system.evaluation_states()
    result = evaluate_policy_cost(policy, watch, states, seed=seed)
    found = watch.summary()
    return {
        "final_cost": result.cost,
        "final_success": result.success_rate,
        "final_violations": found["violations"],
        "final_episodes": found["episodes"],
    }


def without_shield(task: Task, kind: str, policy: Any, seed: int) -> Row:
    """What becomes of a policy that learned under a shield once it is taken away."""
    if not kind.startswith("shield"):
        return {"bare_cost": None, "bare_episodes": None}
    found = judged(task, "free", policy, seed)
    return {"bare_cost": found["final_cost"], "bare_episodes": found["final_episodes"]}


class Follow:
    """The baseline as a policy of the plant itself."""

    def __init__(self, task: Task) -> None:
        self._wants = task.baseline
        self._inputs = np.array(task.make(1).system.signals.values)

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        wanted = np.reshape(self._wants(observation), (len(observation), -1))
        return nearest_actions(wanted, self._inputs), None


def study(
    tasks: Iterable[str], kinds: Sequence[str], seeds: range, steps: int | None = None
) -> list[Row]:
    """A row for each task and arrangement, and one for the baseline alone."""
    rows = []
    for name in tasks:
        task = replace(TASKS[name], steps=steps or TASKS[name].steps)
        alone = judged(task, "free", Follow(task), 0)
        rows.append({"task": name, "kind": "baseline alone", **alone, "runs": []})
        for kind in tqdm(kinds, desc=name, leave=False):
            runs = [run(task, kind, seed) for seed in seeds]
            rows.append({"task": name, "kind": kind, **medians(runs), "runs": runs})
    return rows


def medians(runs: Sequence[Row]) -> Row:
    """The median of each measure."""
    numbers = [key for key in runs[0] if key not in ("seed", "exploring")]
    return {
        key: None
        if runs[0][key] is None
        else statistics.median(one[key] for one in runs)
        for key in numbers
    }


LEARNING = {
    "episodes": "violated while learning, of 1,000 episodes",
    "violations": "outside, of 1,000 steps",
    "interventions": "replaced, of 1,000 actions",
    "cost_first_tenth": "cost of a step, first tenth",
    "cost": "cost of a step, all",
    "seconds": "seconds",
}
POLICY = {
    "final_cost": "policy cost",
    "worst": "the worst of all runs",
    "final_episodes": "violated by the policy, of 1,000 episodes",
    "bare_cost": "policy cost without its shield",
    "bare_episodes": "violated without its shield, of 1,000 episodes",
}


def as_markdown(rows: Sequence[Row]) -> str:
    """Two tables for each task: of learning, and of the policy at the end."""
    tables = []
    for task in dict.fromkeys(row["task"] for row in rows):
        own = []
        for row in rows:
            if row["task"] == task:
                costs = [one["final_cost"] for one in row["runs"]]
                own.append({**row, "worst": max(costs) if costs else None})
        for what, columns in ("learning", LEARNING), ("the policy", POLICY):
            lines = [
                [row["kind"], *(shown(row.get(k)) for k in columns)] for row in own
            ]
            heads = ["arrangement", *columns.values()]
            tables.append(f"{task}, {what}:\n\n{markdown(heads, lines)}")
    return "\n\n".join(tables)


def shown(value: float | None) -> str:
    """A number with three digits or so."""
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


LOOKS: dict[str, Row] = {
    "free": {"color": BLACK},
    "shield": {"color": BLUE, "linestyle": ":"},
    "shield, model": {"color": BLUE},
    "shield, model, masks": {"color": BLUE, "linestyle": "--"},
    "inner loop": {"color": GREEN},
    "inner loop, shield, model": {"color": ORANGE},
}


@in_style()
def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw cost and violations on the way, medians over the seeds."""
    tasks = [name for name in TASKS if any(row["task"] == name for row in rows)]
    figure = new_figure(2.3 * len(tasks) + 0.5, dpi=150)
    grid = figure.subplots(len(tasks), 2, squeeze=False)
    for line, name in zip(grid, tasks, strict=True):
        when = np.linspace(0.0, TASKS[name].steps, 101)
        for row in rows:
            if row["task"] != name or not row["runs"]:
                continue
            each = [one["exploring"] for one in row["runs"]]
            # Of a twentieth of the interactions, so that it is one of several trials.
            costs = np.reshape([one["costs"] for one in each], (len(each), 20, 5))
            cost = np.median(costs.mean(axis=2), axis=0)
            outside = np.median([np.cumsum(one["violations"]) for one in each], axis=0)
            line[0].plot(when[3::5], cost, **LOOKS[row["kind"]])
            line[1].plot(when, [0.0, *outside], **LOOKS[row["kind"]])
        line[0].set(ylabel=f"{name}\ncost of a step")
        if name == "hold":  # costs differ by a factor of a hundred
            line[0].set_yscale("log")
        else:
            line[0].set_ylim(bottom=0.0)
        line[1].set(ylabel="steps outside so far")
        line[1].set_yscale("symlog", linthresh=10.0)
        line[1].set_ylim(bottom=-0.5)
        for ax in line:
            ax.set(xlim=(0, when[-1]), xlabel="interactions")
            ax.xaxis.set_major_formatter(EngFormatter(sep=""))
    handles = [Line2D([], [], **look) for look in LOOKS.values()]
    figure.legend(handles, list(LOOKS), ncols=3, loc="outside upper center")
    figure.savefig(path)


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument(
        "--tasks",
        type=some_of(TASKS),
        default=list(TASKS),
        help=f"some of {', '.join(TASKS)} (default: both)",
    )
    parser.add_argument(
        "--kinds",
        type=some_of(LOOKS, ";"),
        default=list(LOOKS),
        help=f"some of {'; '.join(LOOKS)}, between semicolons (default: all)",
    )
    add_seeds(parser)
    parser.add_argument(
        "--steps",
        type=at_least_one,
        help="interactions of a run (default: "
        + ", ".join(f"{task.steps:,} for {name}" for name, task in TASKS.items())
        + ")",
    )
    add_results(parser, "the curves")
    options = parser.parse_args(arguments)
    if options.from_json is not None:
        # The baseline alone is in every file.
        read = rows_of(options.from_json)
        kept = {(row["task"], row["kind"]): row for row in read}
        order = ["baseline alone", *LOOKS]
        rows = sorted(kept.values(), key=lambda row: order.index(row["kind"]))
    else:
        seeds = range(options.seeds)
        rows = study(options.tasks, options.kinds, seeds, options.steps)
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
