"""First answers to claims of chapters 3 and 4: the grids and the navigation.

Trains colonies over several seeds and prints what docs/grid-search.md and
docs/navigation.md quote; `--figures DIR` draws the bands over the trials. A study that
was killed goes on where it stopped when the same command is given again.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from tqdm.auto import tqdm

from acl_gym import (
    ACL,
    Crisp,
    Fuzzy,
    PolicyEvaluation,
    evaluate_policy_cost,
    fuzzy_q_iteration,
)
from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.agents.value_iteration import (
    TabularModel,
    policy_value,
    value_iteration,
)
from acl_gym.evaluation import control_env
from acl_gym.experiments.runner import Task, run_tasks
from acl_gym.partition import Partition, named

GRID_1D, GRID_2D = "acl_gym/GridSearch1D-v0", "acl_gym/GridSearch2D-v0"
NAVIGATION = "acl_gym/Navigation-v0"
CHAPTER_3 = {
    "tau0": 1e-3,
    "alpha": 3.0,
    "global_decay": 0.1,
    "local_decay": 0.0,
    "selection": "boltzmann",
}
EVALUATION_STEPS = 200
"""T of an evaluation: several times the longest of the shortest paths."""
TABLE_4_1 = {**CHAPTER_3, "local_decay": 0.01, "max_steps": 150}


@dataclass(frozen=True)
class Setting:
    """One line of a table: an environment, a colony, and how often it is run."""

    name: str
    env_id: str
    ants: int
    trials: int
    seeds: int
    env: dict[str, Any] = field(default_factory=dict)
    colony: dict[str, Any] = field(default_factory=dict)
    partition: tuple[str, str] | None = None

    def make_env(self) -> Any:
        return gym.make_vec(self.env_id, num_envs=self.ants, **self.env)

    def make_partition(self) -> Partition | None:
        if self.partition is None:
            return None
        grid, kind = self.partition
        return named.navigation(grid, kind=Fuzzy if kind == "fuzzy" else Crisp)


def grid_1d() -> list[Setting]:
    base = {**CHAPTER_3, "max_steps": 50}

    def setting(name: str, **changes: Any) -> Setting:
        return Setting(name, GRID_1D, 9, 100, 30, colony={**base, **changes})

    return [
        setting("1d alpha 3"),
        setting("1d alpha 2", alpha=2.0),
        setting("1d alpha 1", alpha=1.0),
        setting("1d tau0 0.01", tau0=1e-2),
        setting("1d tau0 0.0001", tau0=1e-4),
        setting("1d epsilon 0.1", selection="max_boltzmann", epsilon=0.1),
        setting("1d tabu", tabu=True),
    ]


def grid_2d() -> list[Setting]:
    found = [
        Setting(
            f"2d p1 {name}", GRID_2D, 86, 200, seeds, colony={**CHAPTER_3, **changes}
        )
        for name, seeds, changes in (
            ("alpha 3", 30, {}),
            ("tabu", 30, {"tabu": True}),
            ("alpha 2", 10, {"alpha": 2.0}),
            ("alpha 1", 10, {"alpha": 1.0}),
            ("tau0 0.01", 10, {"tau0": 1e-2}),
            ("epsilon 0.1", 10, {"selection": "max_boltzmann", "epsilon": 0.1}),
        )
    ]
    for p, name, changes in (
        (0.5, "alpha 3", {}),
        (0.5, "tabu", {"tabu": True}),
        (0.7, "alpha 3", {}),
        (0.9, "alpha 3", {}),
    ):
        env, colony = {"transition_probability": p}, {**CHAPTER_3, **changes}
        found.append(Setting(f"2d p{p} {name}", GRID_2D, 86, 200, 10, env, colony))
    return found


def sizes() -> list[Setting]:
    return [
        Setting(
            f"{name} {share:.0%}",
            GRID_2D,
            max(1, round(share * states)),
            200,
            10,
            {"map_name": name},
            CHAPTER_3,
        )
        for name, states in (("11x11", 86), ("21x21", 278), ("31x31", 640))
        for share in (0.2, 1.0)
    ]


def navigation() -> list[Setting]:
    found = []
    for cost, rule, grid, spacing in (
        ("quadratic", "bounds", "regular", 0.1),
        ("quadratic", "membership", "regular", 0.1),
        ("time", "bounds", "damping", 0.3),
        ("time", "membership", "damping", 0.3),
    ):
        env = {"cost": cost, "goal_rule": rule, "goal_spacing": (spacing, 2.0)}
        found += [
            Setting(
                f"{cost} {rule} {kind}",
                NAVIGATION,
                200,
                200,
                10,
                env,
                TABLE_4_1,
                (grid, kind),
            )
            for kind in ("fuzzy", "crisp")
        ]
    return found


STUDIES: dict[str, Callable[[], list[Setting]]] = {
    "grid-1d": grid_1d,
    "grid-2d": grid_2d,
    "sizes": sizes,
    "navigation": navigation,
}


def run(setting: Setting, seed: int, report: Callable[[float], None]) -> dict[str, Any]:
    """Train one colony, its policy evaluated after every trial."""
    warnings.simplefilter("ignore", PheromoneBoundWarning)
    env = setting.make_env()
    steps = control_env(env).system.evaluation_steps
    colony_steps = {"max_steps": steps, **setting.colony}
    colony = ACL(env, setting.make_partition(), seed=seed, **colony_steps)
    evaluation = PolicyEvaluation(env, max_steps=min(steps, EVALUATION_STEPS))
    colony.learn(
        trials=setting.trials,
        callback=[evaluation, lambda agent, _: report(agent.trials / setting.trials)],
    )
    names = ("policy_cost", "success_rate", "ants_cost", "policy_variation")
    history = {
        name: [row[name] for row in colony.history] for name in (*names, "sensitivity")
    }
    found: dict[str, Any] = {"history": history, "seconds": colony.seconds}
    if setting.env_id != NAVIGATION:
        found |= on_a_grid(env, colony)
    return found


def on_a_grid(env: Any, colony: ACL) -> dict[str, Any]:
    """The exact expected cost of the last policy, and where it is not the best."""
    model = TabularModel.of(env)
    optimum = value_iteration(model)
    actions = colony.policy.best_actions()
    goals = control_env(env).system.goal_states
    free = np.setdiff1d(np.arange(len(actions)), goals)
    values = policy_value(model, actions)
    best = optimum.action_values.max(axis=1)
    chosen = optimum.action_values[np.arange(len(actions)), actions]
    return {
        "exact_cost": float(-values[free].mean()),
        "optimal_cost": float(-optimum.values[free].mean()),
        "optimal_actions": float(np.mean(chosen[free] >= best[free] - 1e-6)),
        "policy": actions[free].tolist(),
    }


def baseline(setting: Setting) -> dict[str, Any]:
    """Fuzzy Q-iteration on the same partition, discounted or not: the better policy."""
    env = setting.make_env()
    found = []
    for discount in (1.0, 0.98, 0.95):
        result = fuzzy_q_iteration(
            env, setting.make_partition(), discount=discount, max_iterations=500
        )
        cost = evaluate_policy_cost(result.policy, env)
        found.append((cost.cost, cost.success_rate, discount))
    return dict(zip(("cost", "success_rate", "discount"), min(found), strict=True))


def spread(values: Any) -> str:
    """Median, lowest and highest; infinite ones count."""
    return f"{np.median(values):.2f} [{np.min(values):.2f}, {np.max(values):.2f}]"


def settled(costs: list[float], slack: float) -> int:
    """The first trial from which the cost stays within `slack` of its last value."""
    last = costs[-1]
    off = np.flatnonzero(np.abs(np.array(costs) - last) > slack * last)
    return int(off[-1]) + 2 if off.size else 1


def tell(setting: Setting, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """One line of the table."""
    costs = np.array([each["history"]["policy_cost"] for each in runs])
    last_ten = costs[:, -10:].mean(axis=1)
    success = [each["history"]["success_rate"][-1] for each in runs]
    line: dict[str, Any] = {
        "setting": setting.name,
        "runs": len(runs),
        "final": spread(costs[:, -1]),
        "best": spread(costs.min(axis=1)),
        "last ten": spread(last_ten),
        "success": spread(success),
        "settled in trial": float(
            np.median([settled(c, 0.05) for c in costs.tolist()])
        ),
        "variation": float(
            np.mean(
                [np.mean(each["history"]["policy_variation"][-10:]) for each in runs]
            )
        ),
        "sensitivity": float(
            np.mean([each["history"]["sensitivity"][-1] for each in runs])
        ),
        "seconds": float(np.median([each["seconds"] for each in runs])),
    }
    if "exact_cost" in runs[0]:
        exact = np.array([each["exact_cost"] for each in runs])
        optimum = runs[0]["optimal_cost"]
        line |= {
            "optimum": optimum,
            "exact final": spread(exact),
            "median over optimum": float(np.median(exact) / optimum - 1),
            "at the optimum": int(np.sum(exact <= optimum * (1 + 1e-9))),
            "optimal actions": float(
                np.median([each["optimal_actions"] for each in runs])
            ),
        }
    return line


def agreement(
    first: list[dict[str, Any]], second: list[dict[str, Any]], shift: int
) -> float:
    """The fraction of cells in which two sets of policies choose the same action."""
    count = len(first)
    pairs = [
        np.mean(
            np.array(first[i]["policy"])
            == np.array(second[(i + shift) % count]["policy"])
        )
        for i in range(count)
    ]
    return float(np.mean(pairs))


def draw(settings: list[Setting], runs: dict[str, Any], path: Path) -> None:
    """Mean and min-max band of the policy cost over the trials, a panel a setting.

    Settings that a reader will compare stand side by side, on one scale.
    """
    columns = 2 if settings[0].env_id == NAVIGATION or "x" in settings[0].name else 3
    rows = -(-len(settings) // columns)
    figure = Figure(figsize=(7.2, 1.75 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, sharey="row", sharex=True, squeeze=False)
    for setting, axes in zip(settings, panels.flat, strict=False):
        costs = np.array(
            [each["history"]["policy_cost"] for each in runs[setting.name]]
        )
        trials = np.arange(1, costs.shape[1] + 1)
        axes.fill_between(trials, costs.min(axis=0), costs.max(axis=0), color="0.85")
        axes.plot(trials, costs.mean(axis=0), color="black", linewidth=1.0)
        if "optimal_cost" in runs[setting.name][0]:
            optimum = runs[setting.name][0]["optimal_cost"]
            axes.axhline(optimum, color="#0072B2", linewidth=0.9, linestyle="--")
        axes.set_title(f"{setting.name}, {len(costs)} runs", fontsize=8)
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(labelsize=7, which="both")
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels.flat[len(settings) :]:
        axes.remove()
    figure.supylabel("policy cost $J^h$", fontsize=8)
    figure.supxlabel("trial", fontsize=8)
    figure.savefig(path, dpi=140)


def study(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    settings = STUDIES[name]()
    if options.only:
        settings = [each for each in settings if options.only in each.name]
    tasks = [
        Task(
            f"{setting.name.replace(' ', '_')}-{seed}",
            run,
            (setting, seed),
            {"setting": repr(setting), "seed": seed},
        )
        for setting in settings
        for seed in range(options.seeds or setting.seeds)
    ]
    with tqdm(total=len(tasks), desc=name, disable=options.json) as bar:

        def progress(_: str, fraction: float) -> None:
            if fraction >= 1.0:
                bar.update()

        results = run_tasks(
            tasks, options.out / name, workers=options.workers, progress=progress
        )
    runs = {
        setting.name: [
            result
            for task, result in zip(tasks, results, strict=True)
            if task.arguments[0] == setting
        ]
        for setting in settings
    }
    lines = [tell(setting, runs[setting.name]) for setting in settings]
    if name == "navigation":
        for setting, line in zip(settings, lines, strict=True):
            line["Q-iteration"] = baseline(setting)
    if {"2d p0.5 alpha 3", "2d p0.9 alpha 3"} <= runs.keys():
        low, high = runs["2d p0.5 alpha 3"], runs["2d p0.9 alpha 3"]
        lines.append(
            {
                "setting": "cells with the same action",
                "p = 0.5 and p = 0.9": agreement(low, high, 0),
                "two seeds at p = 0.5": agreement(low, low, 1),
                "two seeds at p = 0.9": agreement(high, high, 1),
            }
        )
    if options.figures:
        options.figures.mkdir(parents=True, exist_ok=True)
        draw(settings, runs, options.figures / f"{name}.png")
    return lines


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--only", help="settings whose name contains this")
    parser.add_argument("--seeds", type=int, help="runs of each setting")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/claims"))
    parser.add_argument("--figures", type=Path, metavar="DIR", help="draw them here")
    parser.add_argument("--json", action="store_true", help="print JSON only")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.studies if name not in STUDIES]
    if unknown:
        parser.error(f"studies must be among {', '.join(STUDIES)}, got {unknown}")
    lines = []
    for name in options.studies or STUDIES:
        for line in study(name, options):
            lines.append(line)
            if not options.json:
                print(f"\n{line.pop('setting')}")
                for key, value in line.items():
                    print(f"  {key:24} {value}")
    if options.json:
        print(json.dumps(lines, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
