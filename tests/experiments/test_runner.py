"""The runner keeps every finished result and never makes one twice."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import gymnasium as gym
import pytest
from filelock import FileLock

from acl_gym import ACL, Fuzzy
from acl_gym.experiments import runner
from acl_gym.experiments.runner import (
    FolderInUseError,
    Task,
    TaskFailedError,
    run_tasks,
)


def square(number: int, calls: str, report) -> dict:
    """A task that leaves a mark each time it is run."""
    with open(calls, "a") as file:
        file.write(f"{number}\n")
    report(0.5)
    return {"square": number * number}


def levels(seed: int, report) -> dict:
    """What a small colony has laid, to the last bit."""
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=30)
    grid = Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0])
    colony = ACL(env, grid, seed=seed, max_steps=60).learn(trials=4)
    return {"levels": colony.pheromone.levels.tobytes().hex()}


def refuse(report) -> dict:
    raise ValueError("three is not a number")


def die(report) -> dict:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def tasks(calls: Path, numbers=range(4), **settings: int) -> list[Task]:
    return [
        Task(f"square-{n}", square, (n, str(calls)), {"n": n, **settings})
        for n in numbers
    ]


def calls_in(path: Path) -> list[str]:
    return sorted(path.read_text().split()) if path.exists() else []


def test_results_come_in_order_and_are_made_once(tmp_path: Path) -> None:
    calls, told = tmp_path / "calls", []
    for _ in range(2):
        results = run_tasks(
            tasks(calls),
            tmp_path / "runs",
            workers=2,
            progress=lambda name, fraction: told.append((name, fraction)),
        )
        assert [result["square"] for result in results] == [0, 1, 4, 9]
    assert calls_in(calls) == ["0", "1", "2", "3"]
    assert told.count(("square-2", 1.0)) == 2
    assert not list((tmp_path / "runs").glob(".*")), "no temporary file may stay"


def test_seeds_in_processes_give_the_bits_of_seeds_in_series(tmp_path: Path) -> None:
    seeds = range(4)
    made = run_tasks(
        [Task(f"seed-{n}", levels, (n,), {"seed": n}) for n in seeds],
        tmp_path / "runs",
        workers=2,
    )
    in_series = [levels(n, lambda fraction: None)["levels"] for n in seeds]
    assert [result["levels"] for result in made] == in_series
    assert len(set(in_series)) == len(in_series), "seeds differ"


def test_other_settings_or_other_code_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = tmp_path / "calls"
    run_tasks(tasks(calls, [1]), tmp_path / "runs", workers=1)
    run_tasks(tasks(calls, [1], trials=7), tmp_path / "runs", workers=1)
    assert calls_in(calls) == ["1", "1"]
    monkeypatch.setattr(runner, "code_fingerprint", lambda module: "other code")
    run_tasks(tasks(calls, [1], trials=7), tmp_path / "runs", workers=1)
    assert calls_in(calls) == ["1", "1", "1"]


def test_other_versions_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = tmp_path / "calls"
    run_tasks(tasks(calls, [1]), tmp_path / "runs", workers=1)
    others = {**runner.versions(), "torch": "0.1"}
    monkeypatch.setattr(runner, "versions", lambda: others)
    run_tasks(tasks(calls, [1]), tmp_path / "runs", workers=1)
    assert calls_in(calls) == ["1", "1"]


def test_a_kept_result_says_where_it_was_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = tmp_path / "calls"
    (first,) = run_tasks(tasks(calls, [1]), tmp_path / "runs", workers=1)
    assert first["made"]["processes"] == 1
    assert first["made"]["numba"] == runner.versions()["numba"]
    monkeypatch.setattr(runner, "circumstances", lambda workers: {"cpu": "another"})
    kept, new = run_tasks(tasks(calls, [1, 2]), tmp_path / "runs", workers=2)
    assert kept["made"] == first["made"]
    assert new["made"] == {"cpu": "another"}


@pytest.mark.parametrize("damage", [b"", b"{", b"[]", b"\xff\xfe", b'{"key": 1}'])
def test_a_damaged_result_is_made_again(tmp_path: Path, damage: bytes) -> None:
    calls, runs = tmp_path / "calls", tmp_path / "runs"
    run_tasks(tasks(calls, [3]), runs, workers=1)
    (runs / "square-3.json").write_bytes(damage)
    (result,) = run_tasks(tasks(calls, [3]), runs, workers=1)
    assert result["square"] == 9
    assert calls_in(calls) == ["3", "3"]


@pytest.mark.parametrize(
    ("function", "message"),
    [(refuse, "bad failed: three is not a number"), (die, "a worker process died")],
)
def test_a_failure_is_one_clear_error_and_loses_nothing(
    tmp_path: Path, function, message: str
) -> None:
    calls, runs = tmp_path / "calls", tmp_path / "runs"
    run_tasks(tasks(calls, [1, 2]), runs, workers=1)
    with pytest.raises(TaskFailedError, match=message):
        run_tasks(
            [*tasks(calls, [1, 2]), Task("bad", function, (), {})], runs, workers=1
        )
    run_tasks(tasks(calls, [1, 2]), runs, workers=1)
    assert calls_in(calls) == ["1", "2"]


def test_a_worker_may_die_while_results_are_kept(tmp_path: Path) -> None:
    """The pool then refuses the next task; what had finished before is kept all the same."""
    calls, runs = tmp_path / "calls", tmp_path / "runs"
    works = tasks(calls, [1, 2, 3, 4, 5])
    works.insert(3, Task("bad", die, (), {}))

    def keep_slowly(name: str, fraction: float) -> None:
        while fraction == 1.0 and multiprocessing.active_children():
            time.sleep(0.01)

    with pytest.raises(TaskFailedError, match="a worker process died while"):
        run_tasks(works, runs, workers=1, progress=keep_slowly)
    assert {path.stem for path in runs.glob("*.json")} == {
        "square-1",
        "square-2",
        "square-3",
    }
    assert calls_in(calls) == ["1", "2", "3"]


KILLED = """
import os
import signal
import time
from pathlib import Path
from acl_gym.experiments.runner import Task, run_tasks
from tests.experiments.test_runner import square, tasks

def slow(report):
    (Path({folder!r}) / "worker").write_text(str(os.getpid()))
    time.sleep(600)

if __name__ == "__main__":
    # A shell that runs this in the background has it ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = Path({folder!r})
    run_tasks(
        [*tasks(folder / "calls"), Task("slow", slow, (), {{}})],
        folder / "runs",
        workers=1,
    )
"""


def start_killed(folder: Path) -> subprocess.Popen[bytes]:
    script = folder / "killed.py"
    script.write_text(KILLED.format(folder=str(folder)))
    root = Path(__file__).resolve().parents[2]
    return subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": str(root)},
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def test_killed_at_any_moment_it_goes_on(tmp_path: Path) -> None:
    process = start_killed(tmp_path)
    runs = tmp_path / "runs"
    give_up = time.monotonic() + 120
    while len(list(runs.glob("square-*.json"))) < 4 and time.monotonic() < give_up:
        time.sleep(0.05)
    while not (tmp_path / "worker").exists() and time.monotonic() < give_up:
        time.sleep(0.05)
    # A second runner is refused while the first one lives, and loses nothing of it.
    with pytest.raises(FolderInUseError, match="another run works on"):
        run_tasks(tasks(tmp_path / "calls"), runs, workers=1)
    process.kill()
    process.wait()
    (runs / ".square-1.json.77.tmp").write_text("{")
    worker = int((tmp_path / "worker").read_text())
    while _runs(worker) and time.monotonic() < give_up:
        time.sleep(0.05)
    assert not _runs(worker), "a worker must not outlive the runner"
    for path in runs.glob("square-*.json"):
        assert "result" in json.loads(path.read_text())
    results = run_tasks(tasks(tmp_path / "calls"), runs, workers=1)
    assert [result["square"] for result in results] == [0, 1, 4, 9]
    assert calls_in(tmp_path / "calls") == ["0", "1", "2", "3"]
    assert not list(runs.glob(".*")), "nothing half written may stay"


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_ctrl_c_stops_at_once_and_leaves_nothing_running(tmp_path: Path) -> None:
    process = start_killed(tmp_path)
    give_up = time.monotonic() + 120
    while not (tmp_path / "worker").exists() and time.monotonic() < give_up:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    process.wait(timeout=60)  # the task itself would sleep for ten minutes
    assert process.returncode != 0
    assert not _runs(int((tmp_path / "worker").read_text()))


def test_two_runners_do_not_share_a_folder(tmp_path: Path) -> None:
    calls = tmp_path / "calls"
    with FileLock(tmp_path / "running.lock"):
        with pytest.raises(FolderInUseError, match="another run works on"):
            run_tasks(tasks(calls), tmp_path, workers=1)
        assert not calls.exists()
    run_tasks(tasks(calls), tmp_path, workers=1)
    assert calls_in(calls) == ["0", "1", "2", "3"]


FULL = """
import resource, sys
from pathlib import Path
from acl_gym.experiments.runner import Task, TaskFailedError, run_tasks
from tests.experiments.test_runner import long_text, square

if __name__ == "__main__":
    folder, calls = Path(sys.argv[1]), sys.argv[2]
    tasks = [
        Task("small", square, (2, calls), {}),
        Task("large", long_text, (), {}),
    ]
    # No file may grow beyond this: writing fails as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
    try:
        run_tasks(tasks, folder, workers=1)
    except TaskFailedError as error:
        print(error)
"""


def long_text(report) -> dict:
    """A result that a small disk does not hold."""
    return {"text": "x" * 100_000}


def test_a_full_disk_loses_nothing(tmp_path: Path) -> None:
    script, folder = tmp_path / "full.py", tmp_path / "runs"
    script.write_text(FULL)
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, script, folder, tmp_path / "calls"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(["", *sys.path])},
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        assert "the result of large cannot be written to" in done.stdout
        assert "make room and call again" in done.stdout
        assert sorted(path.name for path in folder.glob("*.json")) == ["small.json"]
        assert not list(folder.glob(".*")), "no temporary file may stay"
    assert calls_in(tmp_path / "calls") == ["2"], "what was there is not made again"
