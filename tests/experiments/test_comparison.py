"""The main job from command line to files, on the smoke preset."""

from __future__ import annotations

import json
import re
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from acl_gym.experiments import comparison
from acl_gym.experiments.courses import NAVIGATION, Course

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "benchmarks" / "compare_acl_rl.py"


def compare(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error::UserWarning:acl_gym", str(SCRIPT), *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("comparison")


@pytest.fixture(scope="module")
def finished(folder: Path) -> subprocess.CompletedProcess[str]:
    agents = "acl-fuzzy,q-crisp,dqn"
    return compare(
        "--preset", "smoke", "--agents", agents, "--seeds", "2", "--out", str(folder)
    )


def test_it_ends_well_and_says_where_its_files_lie(finished, folder: Path) -> None:
    assert finished.returncode == 0, finished.stderr
    for label in ("ACL, fuzzy", "Q-learning, crisp", "DQN"):
        assert label in finished.stdout
    assert "report.html" in finished.stdout
    names = {path.name for path in folder.iterdir()}
    assert {"results.json", "results.parquet", "report.html", "runs"} <= names
    assert len([name for name in names if name.endswith(".png")]) >= 3


def test_results_hold_what_was_promised(finished, folder: Path) -> None:
    results = json.loads((folder / "results.json").read_text())
    assert results["env"] == "acl_gym/Pendulum-v0"
    assert results["preset"] == "smoke"
    assert results["reference"]["optimal_cost"] > 0
    assert {(row["agent"], row["seed"]) for row in results["rows"]} == {
        (agent, seed) for agent in ("acl-fuzzy", "q-crisp", "dqn") for seed in (0, 1)
    }
    for row in results["rows"]:
        assert set(row) == {
            "agent",
            "seed",
            "env_steps",
            "seconds",
            "policy_cost",
            "success_rate",
        }
    assert len(results["summary"]) == 3
    assert pq.read_table(folder / "results.parquet").to_pylist() == results["rows"]


def test_the_report_is_one_file(finished, folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert not re.search(r"""(?:src|href)=["'](?:https?:|//|[^"'#d])""", page)
    assert page.count("data:image/png;base64,") >= 3


def test_a_second_call_runs_nothing_again(finished, folder: Path) -> None:
    runs = sorted((folder / "runs" / "Pendulum").glob("*.json"))
    assert len(runs) == 7
    before = [path.stat().st_mtime_ns for path in runs]
    again = compare(
        *("--preset", "smoke", "--agents", "acl-fuzzy,q-crisp,dqn", "--seeds", "2"),
        *("--out", str(folder)),
    )
    assert again.returncode == 0, again.stderr
    assert [path.stat().st_mtime_ns for path in runs] == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--preset", "huge"], "invalid choice"),
        (["--agents", "acl-fuzzy,sarsa"], "must be among"),
        (["--seeds", "0"], "whole number >= 1"),
        (["--env", "CartPole-v1"], "invalid choice"),
        (
            ["--env", "acl_gym/GridSearch1D-v0", "--agents", "acl-fuzzy"],
            "must be among acl-crisp, q-crisp, q-lambda-crisp, dqn for",
        ),
    ],
)
def test_bad_arguments_exit_with_2(arguments: list[str], message: str) -> None:
    failed = compare(*arguments)
    assert failed.returncode == 2
    assert message in failed.stderr
    assert len(failed.stderr.strip().splitlines()) == 1


def test_runs_are_kept_as_long_as_their_own_settings_stay() -> None:
    def keys(course: Course) -> dict[str, str]:
        tasks = comparison.list_tasks(course, "quick", list(course.methods), [0])
        return {task.name: task.key for task in tasks}

    def changed(**settings: Any) -> set[str]:
        before, after = keys(NAVIGATION), keys(replace(NAVIGATION, **settings))
        return {name for name in before if before[name] != after[name]}

    assert changed() == set()
    assert changed(acl={**NAVIGATION.acl, "alpha": 2.0}) == {
        "acl-fuzzy-0",
        "acl-crisp-0",
    }
    assert changed(dqn_short={"discount": 0.5}) == {"dqn-0"}
    assert changed(optimum=True) == {"reference"}
    assert changed(own={**NAVIGATION.own, "q-fuzzy": {"epsilon": 0.5}}) == {"q-fuzzy-0"}
    others = {**NAVIGATION.partitions, "crisp": NAVIGATION.partitions["fuzzy"]}
    assert changed(partitions=others) == {
        *("acl-crisp-0", "q-crisp-0", "q-lambda-crisp-0")
    }
    budgets = {**NAVIGATION.budgets, "quick": NAVIGATION.budgets["smoke"]}
    assert changed(budgets=budgets) == set(keys(NAVIGATION))


@pytest.mark.parametrize("name", ["Navigation", "GridSearch1D", "GridSearch2D"])
def test_the_other_systems(name: str, tmp_path: Path) -> None:
    env_id = f"acl_gym/{name}-v0"
    agents = "acl-crisp,q-lambda-crisp"
    # In this process; only the runs are in one of their own.
    script = runpy.run_path(str(SCRIPT))
    done = CliRunner().invoke(
        script["app"],
        [
            *("--preset", "smoke", "--env", env_id, "--agents", agents),
            *("--workers", "1", "--out", str(tmp_path)),
        ],
    )
    assert done.exit_code == 0, done.output
    results = json.loads((tmp_path / "results.json").read_text())
    assert set(results) == {
        *("env", "preset", "reference", "rows", "summary", "findings")
    }
    assert (results["env"], results["preset"]) == (env_id, "smoke")
    assert {row["agent"] for row in results["rows"]} == set(agents.split(","))
    assert [entry["seeds"] for entry in results["summary"]] == [1, 1]
    wanted = "best_known_cost" if name == "Navigation" else "optimal_cost"
    assert results["reference"][wanted] > 0
    assert "picture" not in results["reference"]
    drawn = {path.stem for path in tmp_path.glob("*.png")}
    assert {"summary", "learning_curves", "policy_maps"} <= drawn
    page = (tmp_path / "report.html").read_text()
    text = re.sub(r'src="[^"]*"', "", page).lower()
    for word in ("pendulum", "torque"):
        assert word not in text
    assert ("optimum is not known" in text) == (name == "Navigation")


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    failed = compare("--preset", "smoke", "--out", str(tmp_path / "file" / "x"))
    assert failed.returncode == 1
    assert len(failed.stderr.strip().splitlines()) == 1
    assert "Traceback" not in failed.stderr


def test_help_teaches() -> None:
    text = compare("--help").stdout
    for word in ("--preset", "--env", "--agents", "--seeds", "--out", "acl-fuzzy"):
        assert word in text
