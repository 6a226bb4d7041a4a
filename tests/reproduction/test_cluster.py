"""The same bits from a Ray cluster as from processes here."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from acl_gym.experiments.runner import Task, TaskFailedError, run_tasks
from acl_gym.reproduction.cluster import in_ray
from acl_gym.reproduction.reproduce import tasks_for
from acl_gym.reproduction.store import ParquetStore
from acl_gym.reproduction.systems import row
from tests.reproduction.slices import shortened


def fail(report) -> dict:
    raise ValueError("there is no such run")


@pytest.fixture
def cluster() -> Iterator[None]:
    """`ray start --head` on this machine."""
    pytest.importorskip("ray")
    ray = Path(sys.executable).with_name("ray")
    quiet = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0"}
    quiet["PYTHONPATH"] = os.pathsep.join(["", *sys.path])  # of the workers
    start = ["start", "--head", "--num-cpus=2", "--port=6397"]
    subprocess.run(
        [ray, *start, "--include-dashboard=false", "--disable-usage-stats"],
        env=quiet,
        check=True,
        capture_output=True,
        timeout=120,
    )
    yield
    subprocess.run([ray, "stop", "--force"], check=True, capture_output=True)


@pytest.mark.filterwarnings("default")  # Ray's own
@pytest.mark.usefixtures("cluster")
def test_a_cluster_gives_the_bits_of_this_machine(tmp_path: Path) -> None:
    tasks = tasks_for([shortened(row())], range(3))
    found = {}
    for name, executor in (("ray", in_ray), ("local", None)):
        folder = tmp_path / name
        found[name] = run_tasks(
            tasks, folder, workers=2, store=ParquetStore(folder), executor=executor
        )
        assert len(list(folder.glob("*.parquet"))) == 3
    for far, near in zip(found["ray"], found["local"], strict=True):
        assert far["rows"] == near["rows"]
        assert far["levels"].tobytes() == near["levels"].tobytes()

    task = Task("bad", fail, (), {})
    with pytest.raises(TaskFailedError, match=r"bad failed on the cluster: .*no such"):
        run_tasks([task], tmp_path / "bad", workers=1, executor=in_ray)


def test_without_a_cluster_the_error_says_what_to_do(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    script = (
        "from acl_gym.reproduction.cluster import in_ray\n"
        "try:\n    next(in_ray([], None))\n"
        "except Exception as error:\n    print(type(error).__name__, error)\n"
    )
    elsewhere = {"PYTHONPATH": os.pathsep.join(sys.path), "RAY_TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **elsewhere},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.stdout.startswith("TaskFailedError there is no Ray cluster here"), (
        done.stderr
    )
