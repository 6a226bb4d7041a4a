"""Runs in processes, each result kept as soon as it is there.

A result is one file, written to a temporary name and renamed. A run that is there
already, made by the same code with the same settings, is not made again: a comparison
that was killed goes on where it stopped. One runner at a time works on a folder.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import logging
import multiprocessing
import os
import platform
import queue
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

from filelock import FileLock, Timeout
from tqdm.auto import tqdm

import acl_gym
from acl_gym.experiments.fingerprint import code_fingerprint
from acl_gym.utils.files import write_atomically

logger = logging.getLogger("acl_gym")

Result = dict[str, Any]
Progress = Callable[[str, float], None]
"""Told the name of a task and the fraction of it that is done."""


@dataclass(frozen=True)
class Task:
    """A call that is made once.

    Attributes:
        name: names its file; unique among the tasks of a folder.
        function: a module-level function of `(*arguments, report)` that returns a
            dict of JSON types; `report` takes the fraction done.
        arguments: its other arguments.
        settings: what the result depends on, JSON types.
    """

    name: str
    function: Callable[..., Result]
    arguments: tuple[Any, ...]
    settings: dict[str, Any]

    @property
    def key(self) -> str:
        """What must be equal for a kept result to be used: settings, code, versions."""
        text = json.dumps(
            [
                *(self.name, self.settings),
                code_fingerprint(self.function.__module__),
                versions(),
            ],
            sort_keys=True,
        )
        return hashlib.sha256(text.encode()).hexdigest()


class TaskFailedError(RuntimeError):
    """A task raised an exception, its process died, or its result was not written."""


class FolderInUseError(RuntimeError):
    """Another runner works on the folder."""


class Store(Protocol):
    """Where results are kept, one a task."""

    directory: Path

    def path(self, task: Task) -> Path:
        """The file of a task."""

    def read(self, task: Task) -> Result | None:
        """The kept result of a task; None if there is none that may be used."""

    def write(self, task: Task, result: Result) -> None:
        """Keep a result: afterwards all of it is there, or nothing."""


Finished = Generator[tuple[Task, Result], None, None]

Executor = Callable[[list[Task], Progress], Finished]
"""Runs tasks and yields each with its result, in any order."""


def run_tasks(
    tasks: Iterable[Task],
    directory: Path,
    *,
    workers: int,
    progress: Progress | None = None,
    store: Store | None = None,
    executor: Executor | None = None,
) -> list[Result]:
    """Return the result of every task, in order, running those that are not there.

    Each has a key `made` as well: where, when and with what it was made, whenever that
    was.

    Args:
        tasks: what to run.
        directory: where results are kept.
        workers: processes, >= 1.
        progress: told how far each task is; 1.0 at once for one that was there.
        store: how they are kept; None takes JSON files in `directory`.
        executor: who runs them; None takes `workers` processes here.

    Raises:
        TaskFailedError: a task failed, or its result could not be written. The results
            of the others are kept.
        FolderInUseError: another runner works on `directory`.
    """
    tasks = list(tasks)
    directory.mkdir(parents=True, exist_ok=True)
    kept = JsonStore(directory) if store is None else store
    execute = executor or partial(in_processes, workers=workers)
    tell = progress or (lambda name, fraction: None)
    results: dict[str, Result] = {}
    with alone_in(directory):
        for half in directory.glob(".*.tmp"):
            half.unlink()  # of a runner that was killed while it wrote
        for task in tasks:
            found = kept.read(task)
            if found is not None:
                results[task.name] = found
                tell(task.name, 1.0)
        missing = [task for task in tasks if task.name not in results]
        unusable = sum(kept.path(task).exists() for task in missing)
        if unusable:
            logger.warning(
                "%d of %d results in %s are damaged, or were made by other code, with "
                "other settings or other versions; they are made again.",
                *(unusable, len(tasks), directory),
            )
        if missing:
            with closing(execute(missing, tell)) as finished:
                for task, result in finished:
                    made = {**result, "made": circumstances(workers)}
                    _keep(kept, task, made)
                    results[task.name] = made
                    tell(task.name, 1.0)
    return [results[task.name] for task in tasks]


@contextmanager
def alone_in(directory: Path) -> Iterator[None]:
    """Hold a lock that the system takes back when this process ends, however it does.

    Args:
        directory: on which this process alone is to work.

    Raises:
        FolderInUseError: another one does.
    """
    lock = FileLock(directory / "running.lock")
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise FolderInUseError(
            f"another run works on {directory}; wait for its end, or take another "
            "folder."
        ) from error
    try:
        yield
    finally:
        lock.release()


def _keep(store: Store, task: Task, result: Result) -> None:
    try:
        store.write(task, result)
    except OSError as error:
        raise TaskFailedError(
            f"the result of {task.name} cannot be written to {store.directory}: "
            f"{error.strerror or error}; what is finished is kept, make room and call "
            "again to go on."
        ) from error


AHEAD = 4
"""Tasks that wait or run for each worker."""


def in_processes(tasks: list[Task], tell: Progress, *, workers: int) -> Finished:
    """Run tasks in processes of this machine; an `Executor` with so many workers."""
    # Spawned, not forked: a fork after torch or OpenMP has started may hang.
    context = multiprocessing.get_context("spawn")
    reports: Any = context.Queue()
    with ProcessPoolExecutor(
        max_workers=min(workers, len(tasks)),
        mp_context=context,
        initializer=_start_worker,
        initargs=(reports,),
    ) as pool:
        waiting: dict[Future[Result], Task] = {}
        left = iter(tasks)
        try:
            while True:
                # A few ahead: to watch thousands at once would keep this process busy.
                for task in islice(left, AHEAD * workers - len(waiting)):
                    waiting[_submit(pool, task)] = task
                if not waiting:
                    return
                done, _ = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                _pass_on(reports, tell)
                # What succeeded first: an error ends this, and would lose it.
                for future in sorted(done, key=_has_failed):
                    task = waiting.pop(future)
                    yield task, _outcome(task, future)
        except BaseException:
            # What is under way is lost anyhow: stop now, and not minutes later.
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _submit(pool: ProcessPoolExecutor, task: Task) -> Future[Result]:
    try:
        return pool.submit(_run_one, task)
    except BrokenProcessPool as error:
        # A worker died while results were kept. It is one more failed task, so that
        # those which had finished before are still handed over.
        failed: Future[Result] = Future()
        failed.set_exception(error)
        return failed


def _has_failed(done: Future[Result]) -> bool:
    return done.exception() is not None


def _outcome(task: Task, future: Future[Result]) -> Result:
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise TaskFailedError(
            f"a worker process died while {task.name} was under way or waiting "
            "(out of memory?); what is finished is kept, call again to go on."
        ) from error
    except Exception as error:
        raise TaskFailedError(f"{task.name} failed: {error}") from error


PAUSE = 0.2
"""Seconds between two reports of a task."""

_reports: Any = None  # the queue of this worker process


def _start_worker(reports: Any) -> None:
    global _reports  # noqa: PLW0603 - set once, before any task
    _reports = reports
    # Ctrl-C reaches every process of a terminal; the parent is the one to answer it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The lock that tqdm makes otherwise is one for all processes: when this one is
    # terminated, Python complains of a leak below the error that is the matter.
    tqdm.set_lock(threading.RLock())
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this worker when its parent has been killed: nobody waits for its result."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_one(task: Task) -> Result:
    heard = time.monotonic()

    def report(fraction: float) -> None:
        nonlocal heard
        if time.monotonic() - heard >= PAUSE:  # not every step needs to be heard of
            heard = time.monotonic()
            _reports.put((task.name, fraction))

    return task.function(*task.arguments, report)


def _pass_on(reports: Any, tell: Progress) -> None:
    while True:
        try:
            name, fraction = reports.get_nowait()
        except queue.Empty:
            return
        tell(name, min(fraction, 0.999))


class JsonStore:
    """A JSON file a task.

    Attributes:
        directory: where they are.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def path(self, task: Task) -> Path:
        """See `Store.path`."""
        return self.directory / f"{task.name}.json"

    def read(self, task: Task) -> Result | None:
        """See `Store.read`."""
        try:
            stored = json.loads(self.path(task).read_text())
        except (FileNotFoundError, json.JSONDecodeError, UnicodeDecodeError):
            return None
        if not isinstance(stored, dict) or stored.get("key") != task.key:
            return None
        result = stored.get("result")
        return result if isinstance(result, dict) else None

    def write(self, task: Task, result: Result) -> None:
        """See `Store.write`."""
        text = json.dumps(
            {"key": task.key, "settings": task.settings, "result": result}
        )
        write_atomically(self.path(task), text.encode())


_PACKAGES = ("numpy", "numba", "scipy", "gymnasium", "stable-baselines3", "torch")


@cache
def versions() -> dict[str, str]:
    """The versions of what computes results."""
    installed = {name: version(name) for name in _PACKAGES}
    return {"acl-gym": acl_gym.__version__, **installed}


def circumstances(workers: int) -> dict[str, Any]:
    """Where, when and with what a result is made."""
    return {
        "date": datetime.date.today().isoformat(),
        "python": platform.python_version(),
        "cpu": _cpu_name(),
        "cores": os.cpu_count(),
        "processes": workers,
        "commit": _commit(),
        **versions(),
    }


@cache
def _commit() -> str | None:
    """The commit of a checkout, with a plus sign if files differ; None elsewhere."""
    folder = Path(acl_gym.__file__).parent
    try:
        _, found, changes = (
            subprocess.run(
                ["git", "-C", str(folder), *arguments],
                capture_output=True,
                text=True,
                check=True,
                timeout=10,
            ).stdout.strip()
            for arguments in (
                # First, whether it is this package's checkout, and not one around it.
                ("ls-files", "--error-unmatch", "__init__.py"),
                ("rev-parse", "HEAD"),
                ("status", "--porcelain", "."),  # new files count as changes
            )
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return f"{found}+" if changes else found


@cache
def _cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = (line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    return next(names, platform.processor() or "unknown")
