"""Whatever goes wrong while results are written, none is lost and none is altered.

A thousand faults, as are injected before a release, take a minute or two:
`ACL_GYM_FAULTS=1000 pytest tests/experiments/test_faults.py`.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym import ACL, Crisp
from acl_gym.experiments import plots, reproduce
from acl_gym.experiments.comparison import compare
from acl_gym.experiments.comparison.tasks import BY_ENV_ID
from acl_gym.experiments.plots import FigureFailedError
from acl_gym.experiments.results import Run
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.systems import grid_1d
from acl_gym.utils import files
from acl_gym.utils.hashing import checksum_fits, with_checksum
from tests.agents.reference_colony import chains
from tests.experiments.synthetic import make_run

FAULTS = int(os.environ.get("ACL_GYM_FAULTS", "40"))

JOBS = [Job(replace(grid_1d(), trials=2), seed) for seed in range(6)]
TRUTH = {job.name: make_run(job.study, job.seed) for job in JOBS}


def same(found: Run, job: Job) -> bool:
    truth = TRUTH[job.name]
    return (
        found.rows.equals(truth.rows.astype(float))
        and found.table.tobytes() == truth.table.tobytes()
        and (found.seconds, found.failure) == (truth.seconds, truth.failure)
    )


class Folder:
    """Results of three kinds, and what was successfully written of them."""

    def __init__(self, path: Path) -> None:
        self.path, self.store = path, Store(path)
        self.kept: dict[str, Any] = {}
        grid = Crisp([np.arange(6.0)])
        self.agent = ACL(chains(2), grid, tau0=1e-3, max_steps=5, seed=0)

    def write(self, kind: str, number: int) -> None:
        """Write something; it counts as kept once this has returned."""
        if kind == "run":
            job = JOBS[number % len(JOBS)]
            self.store.write(job, TRUTH[job.name], {})
            self.kept[job.name] = job
        elif kind == "agent":
            self.agent.metadata = {"number": number}
            self.agent.save(self.path / "agent")
            self.kept["agent"] = number
        else:
            content = json.dumps(with_checksum({"number": number}))
            files.write_atomically(self.path / "results.json", content.encode())
            self.kept["results"] = number

    def lost(self, possible: tuple[str, int] | None = None) -> list[str]:
        """What is lost or altered.

        Args:
            possible: what a process may have come to write before it was killed.
        """
        found = []
        for name, kept in self.kept.items():
            if name == "agent":
                now = ACL.load(self.path / "agent").metadata["number"]
                good = now == kept or possible == ("agent", now)
            elif name == "results":
                values = json.loads((self.path / "results.json").read_bytes())
                now = values["number"]
                good = now == kept or possible == ("results", now)
                good &= checksum_fits(values)
            else:
                run = self.store.read(kept)
                good = run is not None and same(run, kept)
            found += [] if good else [name]
        return found


def failing(
    where: str, error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> Callable[[], None]:
    """Let one system call fail, half of the content being written; undo with a call."""

    def fail(file: Any, *_: Any) -> None:
        if isinstance(file, int):
            os.ftruncate(file, os.fstat(file).st_size // 2)
        raise error

    context = monkeypatch.context()
    patch = context.__enter__()
    patch.setattr(where, fail)
    return lambda: context.__exit__(None, None, None)


def killed(act: Callable[[], None], after: float) -> None:
    """Act in a process of its own, which is killed (SIGKILL) after some seconds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of threads, none of which is at work here
        child = os.fork()
    if child == 0:  # pragma: no cover - it is killed
        try:
            act()
        finally:
            os._exit(0)
    time.sleep(after)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


ERRORS = (
    OSError(28, "No space left on device"),
    OSError(5, "Input/output error"),
    KeyboardInterrupt(),
    MemoryError(),
)


def test_no_result_is_lost_or_altered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    folder = Folder(tmp_path)
    counts = {"failed": 0, "killed": 0, "damaged": 0}
    for number in range(FAULTS):
        kind = str(rng.choice(["run", "agent", "results"]))
        for each in ("run", "agent", "results"):  # there is something to lose
            folder.write(each, 10 * number)
        fault, possible = str(rng.choice(list(counts))), None
        if fault == "failed":
            where = str(rng.choice(["os.fsync", "os.replace"]))
            error = ERRORS[rng.integers(len(ERRORS))]
            undo = failing(where, error, monkeypatch)
            with pytest.raises(type(error)):
                folder.write(kind, 10 * number + 1)
            undo()
        elif fault == "killed":
            possible = (kind, 10 * number + 1)
            killed(
                lambda k=kind, n=number: [
                    folder.write(k, 10 * n + 1) for _ in range(99)
                ],
                after=float(rng.uniform(0, 0.03)),
            )
        else:
            # Somebody else's doing: it must be seen, and what is made again is right.
            job = JOBS[number % len(JOBS)]
            folder.write("run", number)
            path = folder.store.path(job)
            damage(path, rng)
            run = folder.store.read(job)
            assert run is None or same(run, job), f"fault {number} was not seen"
            folder.write("run", number)
        counts[fault] += 1
        assert folder.lost(possible) == [], f"after fault {number}, {fault}"
    assert all(counts.values())
    folder.write("results", 0)
    assert not list(tmp_path.glob(".*")), "nothing half written may stay"


def damage(path: Path, rng: np.random.Generator) -> None:
    """Flip a bit, cut the file, or write over a part of it."""
    content = bytearray(path.read_bytes())
    place = int(rng.integers(len(content)))
    kind = rng.integers(4)
    if kind <= 1:
        content[place] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        del content[place:]
    else:
        content[place : place + 8] = rng.integers(256, size=8, dtype=np.uint8).tobytes()
    path.write_bytes(content)


def test_flipped_bits_in_a_run_are_seen(tmp_path: Path) -> None:
    """At 300 places, evenly over the file: no other numbers are read."""
    store, job = Store(tmp_path), JOBS[0]
    store.write(job, TRUTH[job.name], {"date": "today"})
    content = store.path(job).read_bytes()
    unseen = 0
    for place in np.linspace(0, len(content) - 1, 300).astype(int):
        changed = bytearray(content)
        changed[place] ^= 1 << (place % 8)
        store.path(job).write_bytes(changed)
        run = store.read(job)
        assert run is None or same(run, job), f"byte {place}"
        assert run is None or run.made == {"date": "today"}
        unseen += run is not None
    # Fields of Parquet that nobody reads.
    assert unseen < 150


def test_numbers_that_are_edited_are_seen(tmp_path: Path) -> None:
    """Also where somebody writes a valid file with a better result."""
    store, job = Store(tmp_path), JOBS[0]
    better = replace(TRUTH[job.name], rows=TRUTH[job.name].rows * 0.5)
    store.write(job, TRUTH[job.name], {})
    import pyarrow.parquet as pq

    metadata = pq.read_schema(store.path(job)).metadata
    store.write(job, better, {})
    table = pq.read_table(store.path(job)).replace_schema_metadata(metadata)
    pq.write_table(table, store.path(job))
    assert store.read(job) is None


# --- whole commands ----------------------------------------------------------------


@pytest.mark.usefixtures("short_runs")
def test_a_figure_that_fails_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> Any:
        raise ValueError("a letter that no font has")

    monkeypatch.setitem(plots.PLOTS, "summary", broken)
    system = BY_ENV_ID["acl_gym/GridSearch1D-v0"]
    arguments: Any = (system, "smoke", ["q-crisp"], 1, tmp_path)
    with pytest.raises(FigureFailedError, match=r"ValueError: a letter .* all results"):
        compare.compare(*arguments, workers=1)
    found = json.loads((tmp_path / "results.json").read_text())
    assert {row["agent"] for row in found["rows"]} == {"q-crisp"}
    assert (tmp_path / "report.html").is_file()
    assert not (tmp_path / "summary.png").exists()
    assert (tmp_path / "learning_curves.png").is_file(), "the others are drawn"


def reproduced(folder: Path) -> tuple[dict[str, Any], bool]:
    return reproduce.reproduce(["fig3.9"], 1, folder, workers=1, figures=False)


@pytest.mark.usefixtures("short_runs")
def test_files_that_were_changed_do_not_count_as_done(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first, was_there = reproduced(tmp_path)
    assert not was_there
    assert reproduced(tmp_path)[1]
    runs = sorted((tmp_path / "runs").glob("*.parquet"))
    whole = runs[0].read_bytes()
    assert not caplog.messages

    def edit_results() -> None:
        path = tmp_path / "results.json"
        values = json.loads(path.read_text())
        values["experiments"][0]["studies"][0]["last"]["min"] = 0.0
        path.write_text(json.dumps(values))
        with pytest.raises(ValueError, match="damaged or edited since"):
            reproduce.write_pages(tmp_path)

    def edit_rows() -> None:
        path = tmp_path / "results.parquet"
        path.write_bytes(path.read_bytes()[:-9] + b"123456789")

    def flip_a_bit() -> None:
        changed = bytearray(whole)
        changed[len(whole) // 2] ^= 4
        runs[0].write_bytes(changed)

    for change, name in (
        (edit_results, "results.json"),
        (edit_rows, "results.parquet"),
        (flip_a_bit, runs[0].name),
    ):
        change()
        caplog.clear()
        with caplog.at_level(logging.WARNING, logger="acl_gym"):
            again, was_there = reproduced(tmp_path)
        assert not was_there
        assert "1 of " in caplog.text
        assert name in caplog.text
        assert again["experiments"][0]["name"] == first["experiments"][0]["name"]
        for one, other in zip(
            *(found["experiments"][0]["studies"] for found in (first, again)),
            strict=True,
        ):
            assert one["last"] == other["last"]
        assert reproduced(tmp_path)[1]
