"""Search for the settings of every method, alike: what the comparison `versus` runs with.

On each task (a system as it is, or made harder) each method but the returning colony,
which has its defaults everywhere, and Q-learning with replay on the harder tasks, gets the same number of evaluations by Optuna's TPE
sampler, the first of them its defaults. An evaluation is one run for each tuning seed; its
value is the mean cost of the last policies, so that a policy that fails counts as what it
costs. The search is logged after every evaluation, in one
JSON file for each task and method: a search that was stopped goes on where it was, and
ends as if it had not been stopped: a proposal is a function of the sampler's seed and of
the values before it. One process, one thread; needs Optuna (extra `dev`).

examples:
  python benchmarks/tune.py                        everything, an hour or so
  python benchmarks/tune.py --only pendulum-acl    one method on one task
  python benchmarks/tune.py --only grid            every method on one task
  python benchmarks/tune.py --only q-replay        one method on every task
  python benchmarks/tune.py --table                what was found, as Markdown
  python benchmarks/tune.py --write                the comparison takes what was found
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

try:
    import optuna
except ModuleNotFoundError:
    sys.exit("tune.py needs Optuna; pip install 'acl-gym[dev]'.")
from optuna.distributions import BaseDistribution, distribution_to_json
from optuna.distributions import CategoricalDistribution as Choice
from optuna.distributions import FloatDistribution as Real
from optuna.distributions import IntDistribution as Whole

from acl_gym.experiments.comparison.tasks import (
    PLAIN,
    SETTINGS_FILE,
    TASKS,
    TunedTask,
    is_tuned,
)
from acl_gym.experiments.methods import run
from acl_gym.experiments.names import GROWING, METHODS, NETWORKS, REMEMBERING
from acl_gym.experiments.provenance import versions
from acl_gym.experiments.study import Study
from acl_gym.utils.files import write_atomically
from acl_gym.utils.text import replace_unprintable_letters

FOLDER = Path(__file__).with_name("tuning")

EVALUATIONS = 16
SEEDS = (1000, 1001)
"""Those of the search; the comparison has others."""

SAMPLER: dict[str, Any] = {"name": "TPE, multivariate", "seed": 0, "startup": 6}
"""So many evaluations are drawn evenly before the sampler begins to learn from them."""

PAIRS = [
    (name, method)
    for name, task in TASKS.items()
    for method in task.methods
    if method != "returning" and (method not in REMEMBERING or name in PLAIN)
]
"""Every search: the name of a task and of a method. On the harder tasks Q-learning with
replay has its defaults, as the colony has."""

Log = dict[str, Any]
"""A search as its file holds it; `evaluations` are in the order in which they were made."""


_LEARNING: dict[str, BaseDistribution] = {
    "learning_rate": Real(2e-4, 4e-3, log=True),
    "discount": Choice((0.95, 0.98, 0.99, 1.0)),
    "reward_scale": Real(0.1, 2.0, log=True),
}
_ACTOR_CRITIC: dict[str, BaseDistribution] = {
    "trace_decay": Real(0.8, 1.0),
    "entropy_weight": Real(0.0, 0.05),
    "max_episode_steps": Choice((50, 100, 300)),
}
_OF_NETWORK: dict[str, dict[str, BaseDistribution]] = {
    "dqn": {
        "target_update_interval": Whole(50, 800, log=True),
        "exploration_fraction": Real(0.05, 0.5),
        "exploration_final": Real(0.01, 0.2),
        "max_episode_steps": Choice((50, 100, 300)),
    },
    "ppo": {"n_steps": Choice((16, 32, 64, 128, 256)), **_ACTOR_CRITIC},
    "a2c": {"n_steps": Choice((5, 8, 16, 32, 64)), **_ACTOR_CRITIC},
}
"""As many settings of each network are searched."""


def space_of(task: TunedTask, method: str) -> dict[str, BaseDistribution]:
    """The settings of a method that are searched on a task, and their ranges."""
    if method in NETWORKS:
        return {**_LEARNING, **_OF_NETWORK[method]}
    slots: int = task.defaults(method)["slots"]
    longest = task.max_steps or task.system.max_steps
    space: dict[str, BaseDistribution] = {
        "slots": Whole(max(2, slots // 5), 4 * slots, log=True),
        "max_steps": Choice((longest // 3, 2 * longest // 3, longest)),
    }
    if not task.system.finite:
        kinds = ("fuzzy", "crisp")
        if method in REMEMBERING and task.cells is None:
            kinds = (*kinds, GROWING)
        space["kind"] = Choice(kinds)
    if method == "acl":
        space["global_decay"] = Real(1e-3, 1.0, log=True)
        space["local_decay"] = Real(0.0, 0.2)
        space["alpha"] = Real(1.0, 6.0)
        space["epsilon"] = Real(0.0, 0.3)
        if task.system.finite:
            space["tabu"] = Choice((False, True))
        return space
    space["learning_rate"] = Real(0.03, 1.0, log=True)
    space["discount"] = Choice((0.9, 0.95, 0.98, 0.99, 1.0))
    space["epsilon"] = Real(0.0, 0.3)
    if method == "q-lambda":
        space["trace_decay"] = Real(0.1, 0.95)
    if method == "q-replay":
        space["trace_decay"] = Real(0.0, 0.95)
        space["optimism"] = Real(0.0, 1.0)
    if task.task.cost is not None:
        # No reward expresses the cost: the closest of those that there are.
        space["reward"] = Choice(("stage", "steps"))
    return space


def starts(task: TunedTask, method: str) -> list[dict[str, Any]]:
    """The settings that are tried before the sampler proposes any: first the defaults.

    On the grids then those of Chapter 3, without a tabu list: under one, an action that
    failed by chance may not be chosen again.
    """
    defaults = task.defaults(method)
    if method in NETWORKS:
        from acl_gym.sb3.models import MODELS

        defaults = asdict(MODELS[method].settings(**defaults))
    found = [defaults]
    if method == "acl" and task.system.finite:
        found.append({**defaults, "tabu": False, "local_decay": 0.0})
    space = space_of(task, method)
    return [{key: each[key] for key in space} for each in found]


def search(
    name: str,
    method: str,
    folder: Path,
    *,
    evaluations: int = EVALUATIONS,
    seeds: tuple[int, ...] = SEEDS,
    after_each: Callable[[], Any] = lambda: None,
) -> Log:
    """Search for the settings of a method on a task, and keep all of it in a log.

    Args:
        name: of the task.
        method: one of its methods.
        folder: where the log is, or is made.
        evaluations: how many settings are tried, those of `starts` among them.
        seeds: of the runs of each.
        after_each: called after each evaluation, also after one that was there.

    Returns:
        The search.

    Raises:
        ValueError: the log is of another search.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    task, path = TASKS[name], path_of(name, method, folder)
    log = open_log(name, method, folder, seeds)
    known, space = log["evaluations"], space_of(task, method)
    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(
            seed=SAMPLER["seed"], n_startup_trials=SAMPLER["startup"], multivariate=True
        )
    )
    for settings in starts(task, method):
        study.enqueue_trial(settings)
    for number in range(evaluations):
        trial = study.ask(space)
        if number == len(known):
            value = evaluate(task.study(method, trial.params), seeds)
            known.append({"parameters": trial.params, **value})
            write_atomically(path, f"{json.dumps(log, indent=1)}\n".encode())
        elif known[number]["parameters"] != trial.params:
            raise ValueError(
                f"{path} must hold the search of this version, but its evaluation "
                f"{number} is another; remove the file to search anew."
            )
        study.tell(trial, known[number]["value"])
        after_each()
    return log


def evaluate(study: Study, seeds: tuple[int, ...]) -> dict[str, Any]:
    """What the settings of a study are worth.

    Returns:
        `value`, the mean over the seeds of the cost of the last policy; `costs`, that
        of each; `on_the_way`, the mean cost of the policies over the interactions of a
        run; `seconds` of learning, the mean; `failures`, why runs broke down.
    """
    began = time.perf_counter()
    runs = [run(study, seed) for seed in seeds]
    costs = [float(each.rows["policy_cost"].iloc[-1]) for each in runs]
    return {
        "value": float(np.mean(costs)),
        "costs": costs,
        "on_the_way": float(np.mean([mean_cost(each.rows) for each in runs])),
        "seconds": round(float(np.mean([each.seconds for each in runs])), 3),
        "seconds_in_all": round(time.perf_counter() - began, 3),
        "failures": [each.failure for each in runs if each.failure],
    }


def mean_cost(rows: pd.DataFrame) -> float:
    """The mean cost of policies over interactions; each lasts until the next."""
    steps, costs = rows["env_steps"].to_numpy(), rows["policy_cost"].to_numpy()
    spans = np.diff(steps, prepend=0.0)
    held = np.concatenate([costs[:1], costs[:-1]])  # the first from the beginning
    return float(spans @ held / steps[-1])


def best_of(log: Log) -> dict[str, Any]:
    """The evaluation with the lowest value.

    Of equal ones that whose policies cost least on the way, and then the first: where
    every setting finds the optimum, the soonest.
    """
    evaluations: list[dict[str, Any]] = log["evaluations"]
    if not evaluations:
        name = f"{log['task']}-{log['method']}"
        raise ValueError(
            f"the search of {name} must have an evaluation, got none; "
            f"`python benchmarks/tune.py --only {name}` makes them."
        )
    # Sums over the same states in another order of slots may differ in their last bits.
    return min(
        evaluations, key=lambda each: (round(each["value"], 9), each["on_the_way"])
    )


def path_of(name: str, method: str, folder: Path) -> Path:
    """The log of a search."""
    return folder / f"{name}-{method}.json"


def open_log(
    name: str, method: str, folder: Path, seeds: tuple[int, ...] = SEEDS
) -> Log:
    """A search as far as its log has come.

    Raises:
        ValueError: the log is of another search.
    """
    about = {
        "task": name,
        "method": method,
        "study": TASKS[name].study(method, {}).inputs,
        "objective": "mean cost of the last policies",
        "seeds": seeds,
        "sampler": SAMPLER,
        "space": {
            key: json.loads(distribution_to_json(each))
            for key, each in space_of(TASKS[name], method).items()
        },
    }
    about, path = json.loads(json.dumps(about)), path_of(name, method, folder)
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        made = {**versions(), "optuna": version("optuna")}
        return {**about, "versions": made, "evaluations": []}
    log: Log = json.loads(path.read_text())
    for key, value in about.items():
        if log.get(key) != value:
            raise ValueError(
                f"{path} must be of this search, but its {key} is "
                f"{log.get(key)!r:.200} and not {value!r:.200}; remove the file to "
                "search anew."
            )
    return log


def found_in(folder: Path) -> dict[str, dict[str, dict[str, Any]]]:
    """The best settings of all logs: task -> method -> settings.

    A method of which there was no search on a task has its defaults there.

    Raises:
        ValueError: a log is missing from which the settings of now have come.
    """
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for name, method in PAIRS:
        if not (is_tuned(name, method) or path_of(name, method, folder).is_file()):
            continue
        best = best_of(open_log(name, method, folder))
        found.setdefault(name, {})[method] = best["parameters"]
    return found


def chosen(names: Sequence[str] | None) -> list[tuple[str, str]]:
    """The pairs of task and method that names stand for.

    Raises:
        ValueError: a name stands for none.
    """
    if names is None:
        return PAIRS
    pairs = {f"{name}-{method}" for name, method in PAIRS}
    known = {*TASKS, *pairs, *(method for _, method in PAIRS)}
    for each in names:
        if each not in known:
            raise ValueError(
                f"--only must be tasks, methods or task-method, got {each!r}; tasks are "
                f"{', '.join(TASKS)}, methods "
                f"{', '.join(dict.fromkeys(method for _, method in PAIRS))}."
            )
    wanted = set(names)
    return [
        (name, method)
        for name, method in PAIRS
        if {name, method, f"{name}-{method}"} & wanted
    ]


def table(pairs: Sequence[tuple[str, str]], folder: Path) -> str:
    """What was found, as Markdown."""
    lines = [
        "| task | method | defaults | best | best settings | seconds |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, method in pairs:
        if not path_of(name, method, folder).is_file():
            continue
        log = open_log(name, method, folder)
        best, first = best_of(log), log["evaluations"][0]
        settings = ", ".join(
            f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in best["parameters"].items()
        )
        seconds = sum(each["seconds_in_all"] for each in log["evaluations"])
        lines.append(
            f"| {TASKS[name].label} | {METHODS[method].label} | {first['value']:.4g} "
            f"| {best['value']:.4g} | {settings} | {seconds:.0f} |"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only",
        nargs="+",
        metavar="NAME",
        help=f"tasks, methods, or task-method; tasks: {', '.join(TASKS)}; methods: "
        f"{', '.join(dict.fromkeys(method for _, method in PAIRS))}",
    )
    parser.add_argument(
        "--evaluations",
        type=int,
        default=EVALUATIONS,
        metavar="N",
        help=f"settings tried for each, the defaults among them (default {EVALUATIONS})",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=FOLDER,
        metavar="DIR",
        help=f"where the logs are (default {FOLDER.name}, beside this script)",
    )
    parser.add_argument(
        "--table", action="store_true", help="print what was found, and search nothing"
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help=f"write the best settings of all logs to {SETTINGS_FILE.name} of the package, "
        "from which the comparison reads them, and search nothing",
    )
    options = parser.parse_args(arguments)
    try:
        pairs = chosen(options.only)
    except ValueError as error:
        parser.error(str(error))
    if options.evaluations < 1:
        parser.error(f"--evaluations must be at least 1, got {options.evaluations}.")
    try:
        if options.write:
            text = json.dumps(found_in(options.out), indent=1)
            write_atomically(SETTINGS_FILE, f"{text}\n".encode())
            print(f"Written: {SETTINGS_FILE}")
            lacking = [
                f"{name}-{method}"
                for name, method in PAIRS
                if not path_of(name, method, options.out).is_file()
            ]
            if lacking:
                print(f"With the defaults, for want of a search: {', '.join(lacking)}.")
            return 0
        if not options.table:
            total = len(pairs) * options.evaluations
            with tqdm(total=total, unit="evaluation", smoothing=0.05) as bar:
                for name, method in pairs:
                    bar.set_description(f"{name}-{method}")
                    search(
                        name,
                        method,
                        options.out,
                        evaluations=options.evaluations,
                        after_each=bar.update,
                    )
        print(table(pairs, options.out))
    except ValueError as error:
        print(f"tune.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    sys.exit(main())
