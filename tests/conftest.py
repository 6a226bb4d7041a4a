"""Settings for all tests, including what NumPy, torch and Numba read on import."""

from __future__ import annotations

import gc
import hashlib
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from acl_gym.experiments.results import Run
    from acl_gym.experiments.store import Job, Store
    from acl_gym.experiments.study import Study

ROOT = Path(__file__).resolve().parent.parent

# Workers share the cores already, and results do not depend on the number of threads.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Figures and frames need no screen.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")


def _kernels() -> str:
    """A name that changes with any file that holds kernels.

    Numba looks at the file of the kernel that it loads, not at those of the kernels that
    were compiled into it: after a change there it would run what stood there before.
    """
    digest = hashlib.sha256()
    for path in sorted((ROOT / "acl_gym").rglob("*.py")):
        if b"njit" in (text := path.read_bytes()):
            digest.update(text)
    return digest.hexdigest()[:16]


# Each worker keeps a cache of its own, see `tests.kernel_cache`.
if worker := os.environ.get("PYTEST_XDIST_WORKER"):
    cache = Path(os.environ.get("NUMBA_CACHE_DIR", ROOT / ".numba_cache"))
    os.environ["NUMBA_CACHE_DIR"] = str(cache / _kernels() / worker)

    from tests.kernel_cache import KernelCache

    kernel_cache = KernelCache(Path(os.environ["NUMBA_CACHE_DIR"]))

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup() -> None:
        """Compile nothing that another worker has compiled."""
        kernel_cache.copy_now_and_then()


# The first example of a test may wait for a kernel to compile: no deadline. Each run
# draws other examples, so that few are enough, but for the same ones each time.
settings.register_profile("local", deadline=None, max_examples=50)
settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")


def pytest_collection_finish() -> None:
    """What was imported and collected stays: garbage is looked for among the rest."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000)


MOST_TRIALS, MOST_STEPS = 5, 2_000
"""Of a run that a test needs only to have rows and a table, see `short_runs`."""


@pytest.fixture
def short_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Studies are run in this process, for a few trials, and stored as whole runs.

    For tests of what becomes of runs. A process of its own takes seconds to start, which
    the tests of the runner and of the commands as a whole pay for.
    """
    from acl_gym.experiments import executors, methods, runner
    from acl_gym.experiments.provenance import circumstances

    def run_briefly(study: Study, seed: int) -> Run:
        if study.trials is not None:
            study = replace(study, trials=min(study.trials, MOST_TRIALS))
        elif study.steps is not None:
            study = replace(study, steps=min(study.steps, MOST_STEPS))
        return methods.run(study, seed)

    def in_this_process(
        jobs: list[Job], store: Store, *, workers: int
    ) -> Iterator[Job]:
        made = circumstances(workers)
        for job in jobs:
            executors.write_run(job, run_briefly(job.study, job.seed), store, made)
            yield job

    monkeypatch.setattr(runner, "in_processes", in_this_process)
