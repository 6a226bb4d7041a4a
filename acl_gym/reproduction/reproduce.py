"""From names of experiments to results, verdicts, figures and a report."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from acl_gym.experiments.runner import (
    Executor,
    Task,
    circumstances,
    in_processes,
    run_tasks,
)
from acl_gym.reproduction import resume
from acl_gym.reproduction.catalogue import BY_NAME, EXPERIMENTS, RUNS
from acl_gym.reproduction.claims import CLAIMS
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.outcome import Outcome, outcome_of, runs_made
from acl_gym.reproduction.page import (
    ANIMATED,
    ANIMATION,
    FIGURES,
    RESULTS,
    write_claims,
    write_page,
)
from acl_gym.reproduction.settings import Experiment, Runnable
from acl_gym.reproduction.store import ParquetStore
from acl_gym.utils.files import write_atomically

EXECUTORS = ("local", "ray")
TASKS = "tasks"  # the folder of the raw results


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


def settings_of(experiments: Iterable[Experiment]) -> list[Runnable]:
    """What is run for experiments: each setting once, whoever shares it.

    Of those that share one, the most demanding says how many runs are made.
    """
    found: dict[str, Runnable] = {}
    for experiment in experiments:
        for study in experiment.studies:
            setting: Runnable = study.setting
            known = found.setdefault(setting.key, setting)
            if _most(setting) > _most(known):
                found[setting.key] = setting
    return list(found.values())


def _most(setting: Runnable) -> float:
    return math.inf if setting.most_runs is None else setting.most_runs


def tasks_for(settings: Iterable[Runnable], seeds: Iterable[int]) -> list[Task]:
    """A task for each setting and seed, seed by seed: early results are of all."""
    settings = list(settings)
    return [
        Task(
            f"{setting.system}-{setting.key}-{seed}",
            setting.learner,
            (setting, seed),
            {**setting.about, "seed": seed},
        )
        for place, seed in enumerate(seeds)
        for setting in settings
        if setting.most_runs is None or place < setting.most_runs
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
    workers = workers or os.cpu_count() or 1
    tasks = tasks_for(settings, range(first_seed, first_seed + runs))
    console = console or Console(quiet=True)
    store = ParquetStore(directory / TASKS)
    if not all(store.has(task) for task in tasks):
        # Here once, not in every process: Numba's cache is no place for a race.
        with console.status("Compiling the kernels (some 30 seconds, the first time)"):
            _compile(settings)
    execute = _executor(executor, workers)
    results = _run(tasks, directory / TASKS, workers, execute, console)
    by_setting: dict[str, list[dict[str, Any]]] = {each.key: [] for each in settings}
    for task, result in zip(tasks, results, strict=True):
        by_setting[task.arguments[0].key].append(result)
    evidence = Evidence(by_setting)
    outcome = outcome_of(
        experiments, evidence, runs, first_seed, circumstances(workers)
    )
    outcome["runs_made"] = runs_made(results)
    text = json.dumps(outcome)
    resume.begin(directory)
    write_atomically(directory / RESULTS, text.encode())
    return outcome, evidence


def already(
    names: Sequence[str], runs: int, directory: Path, first_seed: int, figures: bool
) -> tuple[Outcome | None, str]:
    """The outcome, if a call has nothing to do; and what it is made from, a stamp.

    Args:
        names: see `chosen`.
        runs: see `reproduce`.
        directory: see `reproduce`.
        first_seed: see `reproduce`.
        figures: whether figures and report are wanted.

    Raises:
        ValueError: there is no experiment of a name.
    """
    experiments = chosen(names)
    seeds = range(first_seed, first_seed + runs)
    tasks = tasks_for(settings_of(experiments), seeds)
    every = [each.name for each in experiments]
    drawn = every if figures else []
    store = ParquetStore(directory / TASKS)
    found = resume.finished(directory, store, tasks, every)
    if found is None and not figures:
        found = resume.finished(directory, store, tasks, [])
    return found, resume.stamp(tasks, drawn)


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

    folder = directory / FIGURES
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("Drawing") as status:
        for experiment in experiments:
            status.update(f"Drawing {experiment.name}")
            figures.save(experiment, evidence, folder)
        if any(experiment.name == ANIMATED for experiment in experiments):
            status.update("Drawing the animation")
            figures.animation.animate(folder / ANIMATION)


def write_report(directory: Path) -> Path:
    """Write report.html and claims.md from what is in a folder.

    Returns:
        The path of the page.
    """
    write_claims(directory)
    return write_page(directory)


def _compile(settings: list[Runnable]) -> None:
    """Let each kind of learner on each system make a short trial."""
    kinds = {each.kernels: each for each in settings}
    for setting in kinds.values():
        setting.learner(setting.brief(), 0, lambda done: None)


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
