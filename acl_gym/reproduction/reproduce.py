"""From names of experiments to results, verdicts, figures and a report."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from acl_gym.experiments.runner import Executor, Task, in_processes, run_tasks
from acl_gym.reproduction.catalogue import BY_NAME, EXPERIMENTS, RUNS
from acl_gym.reproduction.claims import CLAIMS
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Experiment, Setting
from acl_gym.reproduction.store import ParquetStore
from acl_gym.reproduction.training import learn
from acl_gym.reproduction.verdicts import interval
from acl_gym.storage import write_atomically

EXECUTORS = ("local", "ray")
TASKS = "tasks"  # the folder of the raw results

CURVES = ("policy_cost", "ants_cost", "policy_variation", "sensitivity")
"""The measures that are kept trial by trial for the report."""

_BAND = "Black, the mean of the runs; grey, from the lowest to the highest of them"
CAPTIONS = {
    "bands": f"{_BAND}; dashed, the optimal cost where it is known.",
    "measures": f"{_BAND}.",
    "policies": "The last policy of the run whose last policy is the cheapest.",
    "baseline": "Forces at rest, and ways to the goal.",
    "bands_and_policies": f"{_BAND}; dashed, the optimal cost. Below, the last policy of "
    "the run whose last policy is the cheapest: white is the full positive torque, black "
    "the negative one, grey none.",
    "swing": "Angle (the line is upright), velocity, torque and cost from hanging at "
    "rest, by the last policy of the run whose last policy is the cheapest.",
    "level_band": "The pheromone of the one pair in q: simulated runs between the bounds "
    "on their expectation.",
    "policy_gap": "Where the blue and the orange region do not overlap, Delta is "
    "positive.",
}

ANIMATED = "fig5.6"
"""With this experiment the animation of its policy is drawn."""

Outcome = dict[str, Any]
"""All that a report needs, JSON types: `experiments`, `claims`, `runs`, `made`."""


def chosen(names: Sequence[str]) -> list[Experiment]:
    """The experiments of these names, in the order of the thesis.

    Args:
        names: of experiments; "all" are all of them, "claims" those that decide a
            claim or were tried to understand one.

    Raises:
        ValueError: there is no experiment of a name.
    """
    unknown = [name for name in names if name not in (*BY_NAME, "all", "claims")]
    if unknown:
        raise ValueError(
            f"experiments must be among all, claims, {', '.join(BY_NAME)}, got "
            f"{unknown[0]!r}."
        )
    wanted = set(names)
    if "all" in wanted:
        wanted |= set(BY_NAME)
    if "claims" in wanted:
        wanted |= {
            name for claim in CLAIMS for name in (*claim.experiments, *claim.trials)
        }
    return [experiment for experiment in EXPERIMENTS if experiment.name in wanted]


def settings_of(experiments: Iterable[Experiment]) -> list[Setting]:
    """What is run for experiments: each setting once, whoever shares it."""
    settings = {
        study.setting.key: study.setting
        for experiment in experiments
        for study in experiment.studies
    }
    return list(settings.values())


def tasks_for(settings: Iterable[Setting], seeds: Iterable[int]) -> list[Task]:
    """A task for each setting and seed, seed by seed: early results are of all."""
    settings = list(settings)
    return [
        Task(
            f"{setting.system}-{setting.key}-{seed}",
            learn,
            (setting, seed),
            {**asdict(setting), "seed": seed},
        )
        for seed in seeds
        for setting in settings
    ]


def reproduce(
    names: Sequence[str],
    runs: int = RUNS,
    directory: Path = Path("results/reproduce"),
    *,
    first_seed: int = 0,
    workers: int | None = None,
    executor: str = "local",
    console: Console | None = None,
) -> tuple[Outcome, Evidence]:
    """Run experiments, or read what is there, and judge the claims.

    Args:
        names: see `chosen`.
        runs: of each setting, >= 1; the thesis has 30.
        directory: receives results.json, and in tasks/ a Parquet file a run.
        first_seed: the seeds are this one and those that follow it.
        workers: processes; None takes one for each core.
        executor: "local", or "ray" for the cluster of this machine.
        console: where progress is shown.

    Returns:
        The outcome, and the results themselves.

    Raises:
        ValueError: there is no experiment of a name.
        TaskFailedError: a run failed; the others are kept.
        FolderInUseError: another run works on `directory`.
    """
    experiments = chosen(names)
    settings = settings_of(experiments)
    seeds = range(first_seed, first_seed + runs)
    workers = workers or os.cpu_count() or 1
    tasks = tasks_for(settings, seeds)
    console = console or Console(quiet=True)
    # Here once, not in every process: Numba's cache is no place for a race.
    with console.status("Compiling the kernels (some 30 seconds, the first time)"):
        _compile(settings)
    execute = _executor(executor, workers)
    results = _run(tasks, directory / TASKS, workers, execute, console)
    by_setting: dict[str, list[dict[str, Any]]] = {each.key: [] for each in settings}
    for task, result in zip(tasks, results, strict=True):
        by_setting[task.arguments[0].key].append(result)
    evidence = Evidence(by_setting)
    made = results[-1]["made"]
    outcome = outcome_of(experiments, evidence, runs, first_seed, made)
    text = json.dumps(outcome)
    write_atomically(directory / "results.json", text.encode())
    return outcome, evidence


def outcome_of(
    experiments: Sequence[Experiment],
    evidence: Evidence,
    runs: int,
    first_seed: int,
    made: dict[str, Any],
) -> Outcome:
    """What the runs say: each experiment summed up, each claim judged."""
    return {
        "runs": runs,
        "first_seed": first_seed,
        "experiments": [summary(each, evidence) for each in experiments],
        "claims": [claim.judge(evidence) for claim in CLAIMS],
        "made": made,
    }


def summary(experiment: Experiment, evidence: Evidence) -> dict[str, Any]:
    """What an experiment found, JSON types: each study with its last policies' cost."""
    found = []
    for study in experiment.studies:
        costs = evidence.last(study.setting)
        centre = interval(costs)
        found.append(
            {
                "label": study.label,
                "setting": asdict(study.setting),
                "runs": len(costs),
                "policy_cost": {
                    "interquartile_mean": centre.value,
                    "low": centre.low,
                    "high": centre.high,
                    "min": float(costs.min()),
                    "max": float(costs.max()),
                },
                "success_rate": float(
                    evidence.last(study.setting, "success_rate").mean()
                ),
                "seconds": float(
                    np.median([run["seconds"] for run in evidence.runs(study.setting)])
                ),
                "curves": curves(study.setting, evidence),
            }
        )
    return {
        "name": experiment.name,
        "title": experiment.title,
        "section": experiment.section,
        "text": experiment.text,
        "claims": list(experiment.claims),
        "explains": list(experiment.explains),
        "caption": CAPTIONS[experiment.drawing],
        "studies": found,
    }


def curves(setting: Setting, evidence: Evidence) -> dict[str, Any]:
    """Mean, least and largest value of each measure after each trial, 5 digits."""
    found = {}
    for measure in CURVES:
        if measure not in evidence.runs(setting)[0]["rows"]:
            continue
        values = evidence.rows(setting, measure)
        found[measure] = {
            name: [float(f"{value:.5g}") for value in line]
            for name, line in (
                ("mean", values.mean(axis=0)),
                ("low", values.min(axis=0)),
                ("high", values.max(axis=0)),
            )
        }
    return found


def draw(
    experiments: Iterable[Experiment],
    evidence: Evidence,
    directory: Path,
    console: Console,
) -> None:
    """Draw the figure of each experiment into figures/, as PNG and SVG.

    Args:
        experiments: which.
        evidence: their runs.
        directory: where figures/ is, or is made.
        console: where progress is shown.
    """
    from acl_gym.reproduction import figures

    folder = directory / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("Drawing") as status:
        for experiment in experiments:
            status.update(f"Drawing {experiment.name}")
            figures.save(experiment, evidence, folder)
        if any(experiment.name == ANIMATED for experiment in experiments):
            status.update("Drawing the animation")
            figures.animation.animate(folder / "learning.gif")


def write_report(directory: Path) -> Path:
    """Write report.html and claims.md from what is in a folder.

    Returns:
        The path of the page.
    """
    from acl_gym.reproduction.page import write_claims, write_page

    write_claims(directory)
    return write_page(directory)


def figures_only(outcome: Outcome) -> Outcome:
    """An outcome without its curves, to be printed."""
    return {
        **outcome,
        "experiments": [
            {
                **each,
                "studies": [
                    {name: value for name, value in study.items() if name != "curves"}
                    for study in each["studies"]
                ],
            }
            for each in outcome["experiments"]
        ],
    }


def _compile(settings: list[Setting]) -> None:
    """Let each kind of colony on each system make a short trial."""
    kinds = {(each.env_id, each.kind, len(each.env)): each for each in settings}
    for setting in kinds.values():
        short = {**setting.colony, "max_steps": 2}
        learn(replace(setting, ants=2, trials=1, colony=short), 0, lambda done: None)


def _executor(name: str, workers: int) -> Executor:
    if name == "ray":
        from acl_gym.reproduction.cluster import in_ray

        return in_ray
    return partial(in_processes, workers=workers)


def _run(
    tasks: list[Task],
    directory: Path,
    workers: int,
    executor: Executor,
    console: Console,
) -> list[dict[str, Any]]:
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
    ) as bar:
        line = bar.add_task("runs", total=len(tasks))

        def progress(_: str, fraction: float) -> None:
            if fraction >= 1.0:
                bar.advance(line)

        return run_tasks(
            tasks,
            directory,
            workers=workers,
            progress=progress,
            store=ParquetStore(directory),
            executor=executor,
        )
