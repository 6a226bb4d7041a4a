"""The runner keeps every finished run, makes none twice, and says what went wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock

from acl_gym.experiments import methods, runner
from acl_gym.experiments.executors import RunFailedError
from acl_gym.experiments.runner import FolderInUseError, list_jobs, run_studies
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.study import Study
from acl_gym.experiments.systems import grid_1d, pendulum
from acl_gym.utils import files

SHORT = replace(grid_1d(), trials=2)
OTHER = replace(grid_1d(alpha=2.0), trials=2)
REFUSED = replace(grid_1d(alpha=-1.0), trials=2)
ENDLESS = replace(pendulum("crisp", cells=(4, 5)), trials=10**6)


def times_of(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("*.parquet")}


@pytest.mark.usefixtures("short_runs")
def test_runs_come_by_study_and_seed_and_are_made_once(tmp_path: Path) -> None:
    first = run_studies([SHORT, OTHER, SHORT], range(3), tmp_path, workers=2)
    before = times_of(tmp_path)
    again = run_studies([SHORT, OTHER], range(3), tmp_path, workers=2)
    assert len(before) == 6
    assert times_of(tmp_path) == before
    for study in (SHORT, OTHER):
        assert [run.seed for run in first.runs(study)] == [0, 1, 2]
        assert (first.values(study) == again.values(study)).all()
    assert not list(tmp_path.glob(".*")), "no temporary file may stay"


def test_seeds_in_processes_give_the_bits_of_seeds_in_series(tmp_path: Path) -> None:
    study = replace(pendulum("fuzzy", 30, (8, 9), max_steps=60), trials=3)
    made = run_studies([study], range(4), tmp_path, workers=2).runs(study)
    tables = [methods.run(study, seed).table.tobytes() for seed in range(4)]
    assert [run.table.tobytes() for run in made] == tables
    assert len(set(tables)) == len(tables), "seeds differ"


def test_of_equal_studies_the_most_demanding_counts() -> None:
    few = replace(SHORT, most_runs=2)
    assert len(list_jobs([few], range(5))) == 2
    assert len(list_jobs([few, replace(SHORT, most_runs=3)], range(5))) == 3
    assert len(list_jobs([few, SHORT], range(5))) == 5
    assert few.key == SHORT.key


@pytest.mark.usefixtures("short_runs")
def test_other_settings_or_other_code_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_studies([SHORT], [0], tmp_path, workers=1)
    run_studies([OTHER], [0], tmp_path, workers=1)
    before = times_of(tmp_path)
    assert len(before) == 2
    monkeypatch.setattr("acl_gym.experiments.store.code_of_runs", lambda: "other code")
    assert not Store(tmp_path).has(Job(SHORT, 0))
    monkeypatch.undo()
    monkeypatch.setattr("acl_gym.experiments.store.versions", lambda: {"torch": "0"})
    assert not Store(tmp_path).has(Job(SHORT, 0))


@pytest.mark.usefixtures("short_runs")
def test_a_damaged_run_is_made_again_with_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = run_studies([SHORT], [0, 1], tmp_path, workers=1)
    assert not caplog.messages
    path = Store(tmp_path).path(Job(SHORT, 1))
    path.write_bytes(path.read_bytes()[:-50])
    again = run_studies([SHORT], [0, 1], tmp_path, workers=1)
    assert "1 of 2 runs" in caplog.text
    assert "are made again" in caplog.text
    assert (first.values(SHORT) == again.values(SHORT)).all()


def test_a_failure_is_one_clear_error_and_loses_nothing(tmp_path: Path) -> None:
    run_studies([SHORT], [0, 1], tmp_path, workers=1)
    before = times_of(tmp_path)
    with pytest.raises(RunFailedError, match="failed: alpha must lie in"):
        run_studies([SHORT, REFUSED], [0, 1], tmp_path, workers=1)
    assert times_of(tmp_path) == before


@pytest.mark.usefixtures("short_runs")
def test_two_runners_do_not_share_a_folder(tmp_path: Path) -> None:
    with FileLock(tmp_path / "running.lock"):
        with pytest.raises(FolderInUseError, match="another run works on"):
            run_studies([SHORT], [0], tmp_path, workers=1)
        assert not times_of(tmp_path)
    run_studies([SHORT], [0], tmp_path, workers=1)
    assert len(times_of(tmp_path)) == 1


SCRIPT = """
import signal, sys
from pathlib import Path
from acl_gym.experiments.executors import RunFailedError
from acl_gym.experiments.runner import run_studies
from tests.experiments.test_runner import ENDLESS, OTHER, SHORT

if __name__ == "__main__":
    # A shell that runs this in the background has it ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run_studies([SHORT, OTHER, ENDLESS], [0], Path(sys.argv[1]), workers=1)
    except RunFailedError as error:
        sys.exit(str(error))
"""


@pytest.fixture
def running(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A runner that has kept two runs and is at a third, which never ends."""
    script = tmp_path / "endless.py"
    script.write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "runs")],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(["", *sys.path])},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    give_up = time.monotonic() + 120
    while len(times_of(tmp_path / "runs")) < 2 and time.monotonic() < give_up:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.05)
    assert len(times_of(tmp_path / "runs")) == 2
    yield process
    process.kill()
    process.communicate()


def workers_of(parent: int) -> list[int]:
    found = []
    for each in Path("/proc").glob("[0-9]*"):
        try:
            stat = (each / "stat").read_text().rsplit(")", 1)[1].split()
            line = (each / "cmdline").read_bytes()
        except (OSError, IndexError):
            continue
        if int(stat[1]) == parent and b"popen_loky" in line and stat[0] != "Z":
            found.append(int(each.name))
    return found


def gone(pids: list[int], seconds: float = 30) -> bool:
    give_up = time.monotonic() + seconds
    while time.monotonic() < give_up:
        if not any(Path(f"/proc/{pid}").exists() for pid in pids):
            return True
        time.sleep(0.05)
    return False


def test_killed_it_leaves_nothing_running_and_goes_on(
    tmp_path: Path, running: subprocess.Popen[str]
) -> None:
    runs = tmp_path / "runs"
    with pytest.raises(FolderInUseError, match="another run works on"):
        run_studies([SHORT], [0], runs, workers=1)
    workers = workers_of(running.pid)
    assert workers
    running.kill()
    assert gone(workers), "a worker must not outlive the runner"
    before = times_of(runs)
    # What a write leaves that was killed half way.
    half = f".acl-{files._machine()}-{running.pid}-0123456789ab.tmp"
    running.wait()
    (runs / half).write_text("{")
    found = run_studies([SHORT, OTHER], [0], runs, workers=1)
    assert times_of(runs) == before
    assert len(found.runs(OTHER)) == 1
    assert not list(runs.glob(".*")), "nothing half written may stay"


def test_a_worker_that_dies_is_reported_and_nothing_is_lost(
    tmp_path: Path, running: subprocess.Popen[str]
) -> None:
    for worker in workers_of(running.pid):
        os.kill(worker, signal.SIGKILL)
    _, message = running.communicate(timeout=60)
    assert running.returncode == 1
    assert "a worker process died while" in message
    assert "call again to go on" in message
    assert len(times_of(tmp_path / "runs")) == 2


def test_ctrl_c_stops_at_once_and_leaves_nothing_running(
    running: subprocess.Popen[str],
) -> None:
    workers = workers_of(running.pid)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does
    running.communicate(timeout=60)
    assert running.returncode != 0
    assert gone(workers)


def test_processes_of_the_caller_are_left_alone(tmp_path: Path) -> None:
    """A failure ends the runner's own workers, and no other child of the caller."""
    bystander = subprocess.Popen([sys.executable, "-c", "input()"], stdin=-1)
    try:
        methods.warm_up(SHORT)
        broken = replace(SHORT, settings={**SHORT.settings, "max_steps": -1})
        with pytest.raises(RunFailedError):
            run_studies([SHORT, broken], [0], tmp_path, workers=1)
        assert bystander.poll() is None
    finally:
        bystander.communicate(b"\n")


FULL = """
import resource, sys
from dataclasses import replace
from pathlib import Path
from acl_gym.experiments.executors import RunFailedError
from acl_gym.experiments.methods import warm_up
from acl_gym.experiments.runner import run_studies
from acl_gym.experiments.systems import pendulum
from tests.experiments.test_runner import SHORT

if __name__ == "__main__":
    large = replace(pendulum("crisp", 50, (60, 61)), trials=2)
    for study in (SHORT, large):  # kernels are compiled while there is room for them
        warm_up(study)
    # No file may grow beyond this: writing fails as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
    for _ in range(2):
        try:
            run_studies([SHORT, large], [0], Path(sys.argv[1]), workers=1)
        except RunFailedError as error:
            print(error)
        print(*(path.name for path in Path(sys.argv[1]).iterdir()))
"""


def test_a_full_disk_loses_nothing(tmp_path: Path) -> None:
    script, runs = tmp_path / "full.py", tmp_path / "runs"
    script.write_text(FULL)
    done = subprocess.run(
        [sys.executable, script, runs],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(["", *sys.path])},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    first, names, again, names_then = done.stdout.splitlines()
    for error in (first, again):
        assert "cannot be written to" in error, done.stderr
        assert "make room and call again" in error
    kept = [name for name in names.split() if name != "running.lock"]
    assert [name.split("-")[1] for name in kept] == ["gridsearch1d"], "no half file"
    assert set(names_then.split()) == set(names.split())


@pytest.mark.usefixtures("short_runs")
def test_progress_counts_what_was_there(tmp_path: Path) -> None:
    from rich.console import Console

    run_studies([SHORT], [0], tmp_path, workers=1)
    console = Console(record=True, force_terminal=False, width=80)
    run_studies([SHORT], [0, 1, 2], tmp_path, workers=1, console=console)
    assert "3/3" in console.export_text()


def test_a_study_travels_as_it_is(tmp_path: Path) -> None:
    """Nothing of a study is lost on the way to another process or into its file."""
    study: Study = replace(SHORT, watched={"level": (1, 0)})
    run = run_studies([study], [5], tmp_path, workers=1).runs(study)[0]
    again = methods.run(study, 5)
    assert (run.rows["level"] == again.rows["level"]).all()
    assert np.array_equal(run.table, again.table)
    assert run.made["processes"] == 1
    assert runner.list_jobs([study], [5])[0].key == Job(study, 5).key
