"""The same bits from a Ray cluster as from processes here."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from acl_gym.experiments.cluster import in_ray
from acl_gym.experiments.executors import RunFailedError
from acl_gym.experiments.runner import run_studies
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.systems import grid_1d

STUDY = replace(grid_1d(), trials=3)
REFUSED = replace(grid_1d(alpha=-1.0), trials=3)


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
@pytest.mark.usefixtures("cluster", "short_runs")
def test_a_cluster_gives_the_bits_of_this_machine(tmp_path: Path) -> None:
    found = {}
    for executor in ("ray", "local"):
        folder = tmp_path / executor
        results = run_studies([STUDY], range(3), folder, workers=2, executor=executor)
        found[executor] = results.runs(STUDY)
        assert len(list(folder.glob("*.parquet"))) == 3
    for far, near in zip(found["ray"], found["local"], strict=True):
        timeless = (run.rows.drop(columns="seconds") for run in (far, near))
        assert next(timeless).equals(next(timeless))
        assert far.table.tobytes() == near.table.tobytes()

    (tmp_path / "bad").mkdir()
    with pytest.raises(RunFailedError, match=r"failed on the cluster: .*alpha must"):
        list(in_ray([Job(REFUSED, 0)], Store(tmp_path / "bad")))


def test_without_a_cluster_the_error_says_what_to_do(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    script = (
        "from pathlib import Path\n"
        "from acl_gym.experiments.cluster import in_ray\n"
        "from acl_gym.experiments.store import Store\n"
        "try:\n    next(in_ray([], Store(Path('runs'))))\n"
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
    assert done.stdout.startswith("RunFailedError there is no Ray cluster here"), (
        done.stderr
    )
