"""Killed at any moment, and a disk that is really full: nothing lost, nothing double."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from acl_gym.experiments.runner import Task, run_tasks
from acl_gym.reproduction.store import ParquetStore
from tests.cli.runner import run

COUNT = 60


def short_run(number: int, report: Any) -> dict[str, Any]:
    """A result of some size."""
    return {"rows": {"cost": [float(number)] * 400}, "levels": [0.5 * number] * 4000}


def tasks() -> list[Task]:
    return [Task(f"t-{n}", short_run, (n,), {"n": n}) for n in range(COUNT)]


KILLED = """
import sys
from pathlib import Path
from acl_gym.experiments.runner import run_tasks
from acl_gym.reproduction.store import ParquetStore
from tests.reproduction.test_hard_times import tasks

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    store = ParquetStore(folder / "runs")
    run_tasks(tasks(), folder / "runs", workers=1, store=store)
"""


@pytest.mark.parametrize("victim", ["runner", "worker"])
def test_killed_again_and_again(tmp_path: Path, victim: str) -> None:
    """kill -9 of the runner or of its worker, whatever it is about to do."""
    script, runs, rng = tmp_path / "killed.py", tmp_path / "runs", random.Random(4)
    script.write_text(KILLED)
    store = ParquetStore(runs)
    for turn in range(3):
        process = subprocess.Popen(
            [sys.executable, str(script), str(tmp_path)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(["", *sys.path])},
            stderr=subprocess.PIPE,
            text=True,
        )
        enough = 15 * (turn + 1)
        give_up = time.monotonic() + 60
        while len(list(runs.glob("t-*"))) < enough and time.monotonic() < give_up:
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 0.01))
        if victim == "runner":
            process.kill()
        else:
            for worker in workers_of(process.pid):
                os.kill(worker, signal.SIGKILL)
        told = process.communicate(timeout=60)[1]
        assert (
            victim == "runner"
            or process.returncode == 0
            or ("a worker process died" in told)
        )
        for path in runs.glob("t-*.parquet"):
            pq.read_table(path)  # what is there is whole
    before = {path: path.stat().st_mtime_ns for path in runs.glob("t-*.parquet")}
    assert len(before) >= 45
    results = run_tasks(tasks(), runs, workers=1, store=store)
    assert [result["rows"]["cost"][0] for result in results] == [*map(float, range(60))]
    assert all(path.stat().st_mtime_ns == when for path, when in before.items())
    assert sorted(p.name for p in runs.iterdir()) == sorted(
        ["running.lock", *(f"t-{n}.parquet" for n in range(COUNT))]
    )


def workers_of(runner: int) -> list[int]:
    """The processes that run tasks: those that know the mark of `multiprocessing`."""
    found = []
    for each in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((each / "stat").read_text().rsplit(")", 1)[1].split()[1])
            line = (each / "cmdline").read_bytes()
        except (OSError, IndexError):
            continue
        if parent == runner and b"spawn_main" in line:
            found.append(int(each.name))
    return found


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 48 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=48k", "tmpfs", str(disk)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("needs the right to mount a file system")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_disk_that_is_full(small_disk: Path) -> None:
    call = ["reproduce", "fig3.9", "--runs", "6", "--workers", "1", "--no-figures"]
    full = run(*call, "--out", str(small_disk / "r"), cwd=small_disk)
    assert full.returncode == 1
    (line,) = full.stderr.splitlines()
    assert "cannot be written to" in line
    assert "No space left on device; what is finished is kept, make room" in line
    kept = {p: p.stat().st_mtime_ns for p in small_disk.glob("r/tasks/*.parquet")}
    assert 0 < len(kept) < 18
    assert not list(small_disk.glob("r/tasks/.*"))
    subprocess.run(["mount", "-o", "remount,size=200k", str(small_disk)], check=True)
    full = run(*call[:-1], "--out", str(small_disk / "r"), cwd=small_disk)
    assert full.returncode == 1, "there is room for the runs, not for the figures"
    (line,) = full.stderr.splitlines()
    assert "results, figures or report cannot be written to" in line
    assert "No space left on device; runs that are finished are kept" in line
    subprocess.run(["mount", "-o", "remount,size=8m", str(small_disk)], check=True)
    done = run(*call, "--out", str(small_disk / "r"), "--json", cwd=small_disk)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["runs"] == 6
    assert len(list(small_disk.glob("r/tasks/*.parquet"))) == 18
    assert all(path.stat().st_mtime_ns == when for path, when in kept.items())
