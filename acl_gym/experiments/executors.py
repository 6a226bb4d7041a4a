"""Executors: running jobs in local processes; `cluster` has the one for Ray."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Generator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import Any

from loky import ProcessPoolExecutor
from tqdm import tqdm

from acl_gym.experiments.methods import run as run_study
from acl_gym.experiments.provenance import circumstances
from acl_gym.experiments.results import Run
from acl_gym.experiments.store import Job, Store
from acl_gym.utils.processes import serve_parent


class RunFailedError(RuntimeError):
    """A run raised an exception, its process died, or its result was not written."""


Finished = Generator[Job, None, None]
Executor = Callable[[list[Job], Store], Finished]
"""Makes runs, keeps each in the store, and yields its job then; in any order."""

AHEAD = 4
"""Runs that wait or are under way for each worker."""


def in_processes(jobs: list[Job], store: Store, *, workers: int) -> Finished:
    """Make runs in processes of this machine; an `Executor` with `workers` processes.

    Each process writes its own runs, so that none is lost when another one dies.
    """
    made = circumstances(workers)
    pool = ProcessPoolExecutor(
        max_workers=min(workers, len(jobs)),
        initializer=_start_worker,
        initargs=(os.getpid(),),
    )
    under_way: dict[Future[None], Job] = {}
    try:
        left = iter(jobs)
        while True:
            # A few ahead: to watch thousands at once would keep this process busy.
            for job in islice(left, AHEAD * workers - len(under_way)):
                under_way[pool.submit(_run_and_write, job, store, made)] = job
            if not under_way:
                break
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in done:
                job = under_way.pop(future)
                _raise_failure(job, future)
                yield job
    finally:
        # Whatever happens, what is under way is lost: these processes, and no others.
        pool.shutdown(wait=True, kill_workers=bool(under_way))


def _raise_failure(job: Job, future: Future[None]) -> None:
    try:
        future.result()
    except BrokenProcessPool as error:
        raise RunFailedError(
            f"a worker process died while {job.name} was under way or waiting "
            "(out of memory?); what is finished is kept, call again to go on."
        ) from error
    except RunFailedError:
        raise
    except Exception as error:
        raise RunFailedError(f"{job.name} failed: {error}") from error


def _run_and_write(job: Job, store: Store, made: dict[str, Any]) -> None:
    write_run(job, run_study(job.study, job.seed), store, made)


def write_run(job: Job, run: Run, store: Store, made: dict[str, Any]) -> None:
    """Write a run.

    Raises:
        RunFailedError: it cannot be written.
    """
    try:
        store.write(job, run, made)
    except OSError as error:
        raise RunFailedError(
            f"the result of {job.name} cannot be written to {store.directory}: "
            f"{error.strerror or error}; what is finished is kept, make room and call "
            "again to go on."
        ) from error


def _start_worker(parent: int) -> None:
    serve_parent(parent)
    # The lock that tqdm makes otherwise is one for all processes: when this process is
    # killed, Python would complain of a leak below the error that is the reason.
    tqdm.set_lock(threading.RLock())
