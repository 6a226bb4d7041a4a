"""The command from its arguments to its files, on the smoke preset."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner, Result

ROOT = Path(__file__).resolve().parents[3]
SCRIPT = ROOT / "benchmarks" / "compare_acl_rl.py"
COLUMNS = ["agent", "seed", "env_steps", "seconds", "policy_cost", "success_rate"]
SMALL = ("--preset", "smoke", "--agents", "acl-fuzzy,q-crisp,dqn", "--seeds", "2")


def compare(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error::UserWarning:acl_gym", str(SCRIPT), *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        # Workers of pytest may have a width of their own there.
        env={name: value for name, value in os.environ.items() if name != "COLUMNS"},
        check=False,
    )


def invoke(*arguments: str) -> Result:
    """Run the command in this process."""
    app = runpy.run_path(str(SCRIPT))["app"]
    return CliRunner().invoke(app, arguments, prog_name=SCRIPT.name)


def in_this_process(out: Path, *arguments: str) -> Result:
    """Run the command in this process; it must succeed."""
    common = ("--preset", "smoke", "--workers", "1", "--out", str(out))
    done = invoke(*common, *arguments)
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("comparison")


@pytest.fixture(scope="module")
def finished(folder: Path) -> subprocess.CompletedProcess[str]:
    return compare(*SMALL, "--workers", "1", "--out", str(folder))


def test_it_ends_well_and_says_where_its_files_lie(finished, folder: Path) -> None:
    assert finished.returncode == 0, finished.stderr
    for label in ("ACL, fuzzy", "Q-learning, crisp", "DQN", "J* = 39.", "report.html"):
        assert label in finished.stdout
    assert max(map(len, finished.stdout.splitlines())) <= 100
    names = {path.name for path in folder.iterdir()}
    assert {"results.json", "results.parquet", "report.html", "runs"} <= names
    drawn = {"summary", "learning_curves", "policy_maps", "trajectories"}
    assert {path.stem for path in folder.glob("*.png")} == drawn


def test_results_hold_what_was_promised(finished, folder: Path) -> None:
    results = json.loads((folder / "results.json").read_text())
    assert set(results) == {"env", "preset", "reference", "rows", "summary"}
    assert (results["env"], results["preset"]) == ("acl_gym/Pendulum-v0", "smoke")
    reference = results["reference"]
    assert reference["optimal_cost"] == pytest.approx(39.0, abs=0.7)
    assert (reference["method"], reference["success_rate"]) == ("fuzzy Q-iteration", 1)
    assert reference["cells"] == [100, 101]
    assert reference["coarse"]["cells"] == [40, 41]
    assert reference["coarse"]["policy_cost"] > 1.2 * reference["optimal_cost"]
    rows = pd.DataFrame(results["rows"])
    assert list(rows) == COLUMNS
    assert set(zip(rows["agent"], rows["seed"], strict=True)) == {
        (agent, seed) for agent in ("acl-fuzzy", "q-crisp", "dqn") for seed in (0, 1)
    }
    last = rows.groupby(["agent", "seed"])["policy_cost"].last()
    for entry in results["summary"]:
        assert entry["seeds"] == 2
        found = entry["final_policy_cost"]["median"]
        assert found == pytest.approx(last[entry["agent"]].mean())
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "results.parquet"), rows)


def test_the_report_loads_its_figures_and_curves(finished, folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert not re.search(r"""(?:src|href)=["'](?:https?:|//)""", page)
    loaded = re.findall(r"""(?:src|data-curves)=["']([^"']+)""", page)
    assert len(loaded) == 5
    assert all((folder / file).is_file() for file in loaded)


def times(folder: Path) -> list[int]:
    runs = sorted((folder / "runs").glob("*-*"))
    return [path.stat().st_mtime_ns for path in runs]


def test_a_second_call_runs_nothing_again(
    finished, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(folder / "runs", tmp_path / "runs")
    before = times(tmp_path)
    assert len(before) == 2 * 3 + 2  # of them two of dynamic programming
    # Figures would be drawn once more, which takes seconds.
    monkeypatch.setattr("acl_gym.experiments.plots.save", lambda *_: None)
    in_this_process(tmp_path, *SMALL)
    assert times(tmp_path) == before
    assert (tmp_path / "results.json").is_file()


@pytest.mark.usefixtures("short_runs")
def test_a_fresh_call_makes_every_run_anew(tmp_path: Path) -> None:
    arguments = ("--env", "acl_gym/GridSearch1D-v0", "--agents", "q-crisp", "--json")
    found = [
        json.loads(in_this_process(tmp_path, *arguments, *more).stdout)["rows"]
        for more in ((), ("--fresh",))
    ]
    for one, other in zip(*found, strict=True):
        assert {**one, "seconds": 0} == {**other, "seconds": 0}
        assert one["seconds"] != other["seconds"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--preset", "huge"], "--preset must be one of"),
        (["--agents", "acl-fuzzy,sarsa"], "must be one of"),
        (["--seeds", "0"], "whole number >= 1"),
        (["--env", "Nope-v0"], "there is no environment 'Nope-v0'"),
        (
            ["--env", "acl_gym/GridSearch1D-v0", "--agents", "acl-fuzzy"],
            "must be one of 'acl-crisp', 'returning-crisp', 'q-crisp', 'q-lambda-crisp',",
        ),
    ],
)
def test_bad_arguments_exit_with_2(arguments: list[str], message: str) -> None:
    failed = invoke(*arguments)
    assert failed.exit_code == 2
    assert message in failed.stderr
    assert len(failed.stderr.strip().splitlines()) == 1


@pytest.mark.usefixtures("short_runs")
def test_a_method_stands_for_its_agents(tmp_path: Path) -> None:
    """And all of those that remember are drawn, with partitions that have grown."""
    agents = ("--agents", "returning,returning-fuzzy,q-replay,acl")
    in_this_process(tmp_path, *agents)
    results = json.loads((tmp_path / "results.json").read_text())
    assert {row["agent"] for row in results["rows"]} == {
        *("returning", "returning-fuzzy", "q-replay", "acl-fuzzy", "acl-crisp"),
    }
    assert (tmp_path / "policy_maps.png").is_file()


@pytest.mark.usefixtures("short_runs")
def test_an_environment_of_another_package(tmp_path: Path) -> None:
    agents = "returning,q-replay,ppo,a2c"
    in_this_process(tmp_path, "--env", "CartPole-v1", "--agents", agents)
    results = json.loads((tmp_path / "results.json").read_text())
    assert {row["agent"] for row in results["rows"]} == set(agents.split(","))
    assert all(-500 <= row["policy_cost"] < 0 for row in results["rows"])


@pytest.mark.usefixtures("short_runs")
@pytest.mark.parametrize("name", ["Navigation", "GridSearch1D", "GridSearch2D"])
def test_the_other_systems(name: str, tmp_path: Path) -> None:
    env_id, moving = f"acl_gym/{name}-v0", name == "Navigation"
    agents = "acl-crisp,q-lambda-crisp"
    (tmp_path / "trajectories.png").write_text("of a system before")
    done = in_this_process(tmp_path, "--env", env_id, "--agents", agents)
    results = json.loads((tmp_path / "results.json").read_text())
    assert {row["agent"] for row in results["rows"]} == set(agents.split(","))
    assert [entry["seeds"] for entry in results["summary"]] == [1, 1]
    wanted = "best_known_cost" if moving else "optimal_cost"
    assert results["reference"][wanted] > 0
    assert ("coarse" in results["reference"]) == moving
    assert ("best known = " in done.output) == moving
    drawn = {"summary", "learning_curves", "policy_maps"}
    drawn |= {"trajectories"} if moving else set()
    assert {path.stem for path in tmp_path.glob("*.png")} == drawn


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    failed = invoke("--preset", "smoke", "--out", str(tmp_path / "file" / "x"))
    assert failed.exit_code == 1
    assert len(failed.stderr.strip().splitlines()) == 1


def test_help_teaches() -> None:
    text = invoke("--help").stdout
    for word in ("--preset", "--env", "--agents", "--seeds", "--out", "acl-fuzzy"):
        assert word in text
