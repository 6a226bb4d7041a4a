"""Searches: what they hold, that they can be stopped, and what is read from them."""

from __future__ import annotations

import json
import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from acl_gym.experiments.comparison.tasks import SETTINGS_FILE, TASKS, tuned
from tests.scripts import run_script

pytest.importorskip("optuna")
SCRIPT = Path(__file__).resolve().parents[3] / "benchmarks" / "tune.py"
tuning = SimpleNamespace(**runpy.run_path(str(SCRIPT)))
FOLDER = tuning.FOLDER


SEARCHED = [
    (name, method)
    for name, method in tuning.PAIRS
    if tuning.path_of(name, method, FOLDER).is_file()
]


@pytest.mark.parametrize(("name", "method"), SEARCHED)
def test_the_search_that_is_kept(name: str, method: str) -> None:
    """16 evaluations, the first of them the defaults, all of them in the space."""
    task = TASKS[name]
    log = tuning.open_log(name, method, FOLDER)  # task, space and seeds are the code's
    space, evaluations = tuning.space_of(task, method), log["evaluations"]
    assert len(evaluations) == tuning.EVALUATIONS
    firsts = tuning.starts(task, method)
    assert [each["parameters"] for each in evaluations[: len(firsts)]] == firsts
    for each in evaluations:
        assert set(each["parameters"]) == set(space)
        for key, value in each["parameters"].items():
            assert space[key]._contains(space[key].to_internal_repr(value)), key
        assert each["value"] == pytest.approx(sum(each["costs"]) / len(each["costs"]))
        assert 0 < each["value"] <= task.task.highest_cost * (1 + 1e-12)


def test_every_method_can_be_searched() -> None:
    """The defaults, which are tried first, lie in the space; as many for each network."""
    sizes = {}
    for name, method in tuning.PAIRS:
        space = tuning.space_of(TASKS[name], method)
        for first in tuning.starts(TASKS[name], method):
            assert set(first) == set(space)
            for key, value in first.items():
                assert space[key]._contains(space[key].to_internal_repr(value)), key
        sizes[method] = len(space)
    assert sizes["dqn"] == sizes["ppo"] == sizes["a2c"]
    assert "returning" not in sizes


def test_settings_of_the_package_are_those_of_the_logs() -> None:
    found = tuning.found_in(FOLDER)
    assert SETTINGS_FILE.read_text() == f"{json.dumps(found, indent=1)}\n"
    study = tuned("pendulum", "acl", most_runs=3)
    best = found["pendulum"]["acl"]
    assert (study.slots, study.kind, study.most_runs) == (
        best["slots"],
        best["kind"],
        3,
    )
    assert study.settings["alpha"] == best["alpha"]
    assert study.settings["tau0"] == 1e-4  # not searched


def test_no_run_of_the_comparison_has_a_seed_of_the_search() -> None:
    assert min(tuning.SEEDS) >= 1000


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks of which a run takes little time."""
    for name, task in TASKS.items():
        monkeypatch.setitem(TASKS, name, replace(task, steps=300))


@pytest.mark.usefixtures("short")
def test_a_search_that_was_stopped_goes_on_as_if_it_had_not_been(
    tmp_path: Path,
) -> None:
    count: list[None] = []
    one, other = tmp_path / "a", tmp_path / "b"
    tuning.search(
        "row", "acl", one, evaluations=1, after_each=lambda: count.append(None)
    )
    assert len(count) == 1
    stopped = tuning.search("row", "acl", one, evaluations=8)
    at_once = tuning.search("row", "acl", other, evaluations=8)
    for first, second in zip(
        stopped["evaluations"], at_once["evaluations"], strict=True
    ):
        assert first["parameters"] == second["parameters"]
        assert first["costs"] == second["costs"]
    assert json.loads(tuning.path_of("row", "acl", one).read_text()) == stopped
    assert {"optuna", "acl-gym", "numpy"} <= stopped["versions"].keys()


@pytest.mark.usefixtures("short")
def test_a_log_of_another_search_is_refused(tmp_path: Path) -> None:
    tuning.search("row", "q", tmp_path, evaluations=1)
    with pytest.raises(
        ValueError, match=r"seeds is \[1000, 1001\] and not \[7\]; remove"
    ):
        tuning.search("row", "q", tmp_path, evaluations=1, seeds=(7,))
    path = tuning.path_of("row", "q", tmp_path)
    found = json.loads(path.read_text())
    found["evaluations"][0]["parameters"]["epsilon"] = 0.2
    path.write_text(json.dumps(found))
    with pytest.raises(ValueError, match="its evaluation 0 is another; remove"):
        tuning.search("row", "q", tmp_path, evaluations=1)


def test_of_equal_values_the_one_that_costs_least_on_the_way_is_the_best() -> None:
    log = {
        "evaluations": [
            {"value": 5.0, "on_the_way": 9.0, "parameters": 0},
            {"value": 5.0 + 1e-12, "on_the_way": 7.0, "parameters": 1},
            {"value": 5.0, "on_the_way": 7.0, "parameters": 2},
            {"value": 6.0, "on_the_way": 1.0, "parameters": 3},
        ]
    }
    assert tuning.best_of(log)["parameters"] == 1


def test_the_mean_cost_over_a_run() -> None:
    rows = pd.DataFrame(
        {"env_steps": [10.0, 20.0, 40.0], "policy_cost": [8.0, 4.0, 2.0]}
    )
    assert tuning.mean_cost(rows) == (10 * 8 + 10 * 8 + 20 * 4) / 40


def test_the_command(tmp_path: Path) -> None:
    done = run_script(
        SCRIPT, "--only", "row-q", "--evaluations", "1", "--out", str(tmp_path)
    )
    assert done.returncode == 0, done.stderr
    assert "| 1-D grid | Q-learning | 5 | 5 | " in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["row-q.json"]
    wrong = run_script(SCRIPT, "--only", "moon")
    assert wrong.returncode == 2
    assert "--only must be tasks, methods or task-method, got 'moon'" in wrong.stderr
    partly = run_script(SCRIPT, "--write", "--out", str(tmp_path))
    assert partly.returncode == 1
    assert "search of row-acl must have an evaluation, got none" in partly.stderr
