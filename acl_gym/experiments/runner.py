"""Run studies in processes, saving each run and reusing stored ones."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from acl_gym.experiments.cluster import in_ray
from acl_gym.experiments.executors import Executor, RunFailedError, in_processes
from acl_gym.experiments.methods import warm_up
from acl_gym.experiments.names import NETWORKS
from acl_gym.experiments.results import Results, Run
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.study import AnyStudy
from acl_gym.utils.files import remove_stale

logger = logging.getLogger("acl_gym")


class FolderInUseError(RuntimeError):
    """Another runner works on the folder."""


def run_studies(
    studies: Iterable[AnyStudy],
    seeds: Sequence[int],
    directory: Path,
    *,
    workers: int | None = None,
    executor: str = "local",
    console: Console | None = None,
) -> Results:
    """Return the runs of studies, making those that are not there.

    Args:
        studies: what to run; of equal ones one is run.
        seeds: of the runs of each study.
        directory: where runs are kept, a file each.
        workers: processes, >= 1; None takes one for each core.
        executor: "local" for processes here, "ray" for the cluster of this machine.
        console: where progress is shown; None shows nothing.

    Raises:
        RunFailedError: a run failed, or could not be written. The others are kept.
        FolderInUseError: another runner works on `directory`.
    """
    jobs = list_jobs(studies, seeds)
    workers = workers or os.cpu_count() or 1
    console = console or Console(quiet=True)
    store = Store(directory)
    with exclusive_lock(directory):
        remove_stale(directory)  # of a runner that was killed while it wrote
        runs: dict[str, Run | None] = {job.name: store.read(job) for job in jobs}
        missing = [job for job in jobs if runs[job.name] is None]
        unusable = sum(store.path(job).exists() for job in missing)
        if unusable:
            logger.warning(
                "%d of %d runs in %s are damaged, or were made by other code, with "
                "other settings or other versions; they are made again.",
                *(unusable, len(jobs), directory),
            )
        if missing:
            _compile_kernels(missing, console)
            execute = (
                in_ray if executor == "ray" else partial(in_processes, workers=workers)
            )
            _make(missing, store, execute, console, len(jobs))
            runs |= {job.name: store.read(job) for job in missing}
    found: dict[str, list[Run]] = {}
    for job in jobs:
        run = runs[job.name]
        if run is None:
            raise RunFailedError(f"{store.path(job)} was changed while runs were made.")
        found.setdefault(job.study.key, []).append(run)
    return Results(found)


def list_jobs(studies: Iterable[AnyStudy], seeds: Sequence[int]) -> list[Job]:
    """The runs to be made, seed by seed, so that early ones are of all studies.

    Of equal studies the most demanding says how many runs are made. Those of networks
    come first: they take longest, and no core is to wait for them at the end.
    """
    distinct: dict[str, AnyStudy] = {}
    for study in studies:
        known = distinct.setdefault(study.key, study)
        if known.most_runs is not None and (
            study.most_runs is None or study.most_runs > known.most_runs
        ):
            distinct[study.key] = study
    jobs = [
        Job(study, seed)
        for place, seed in enumerate(seeds)
        for study in distinct.values()
        if study.most_runs is None or place < study.most_runs
    ]
    return sorted(jobs, key=lambda job: job.study.method not in NETWORKS)


def exclusive_lock(directory: Path) -> AbstractContextManager[Any]:
    """Hold a lock that the operating system releases when this process exits.

    A thread that holds it may take it again.

    Args:
        directory: in which this process alone is to work; made if it is not there.

    Raises:
        FolderInUseError: another one works there.
    """
    directory.mkdir(parents=True, exist_ok=True)
    lock = FileLock(directory / "running.lock", is_singleton=True)
    try:
        return lock.acquire(timeout=0)
    except Timeout as error:
        raise FolderInUseError(
            f"another run works on {directory}; wait for its end, or take another "
            "folder."
        ) from error


def _compile_kernels(jobs: list[Job], console: Console) -> None:
    """Compile here once, not in every process, to avoid races on Numba's cache."""
    kinds = {job.study.kernels: job for job in jobs if job.study.method not in NETWORKS}
    with console.status("Compiling the kernels (half a minute, the first time)"):
        for job in kinds.values():
            try:
                warm_up(job.study)
            except Exception as error:
                raise RunFailedError(f"{job.name} failed: {error}") from error


def _make(
    jobs: list[Job], store: Store, execute: Executor, console: Console, total: int
) -> None:
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
    ) as bar:
        line = bar.add_task("runs", total=total, completed=total - len(jobs))
        with closing(execute(jobs, store)) as finished:
            for _ in finished:
                bar.advance(line)
