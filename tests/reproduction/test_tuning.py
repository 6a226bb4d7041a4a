"""Searches: what they hold, that they can be stopped, and what is read from them."""

from __future__ import annotations

import builtins
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acl_gym.reproduction.versus import tuned, tuning
from acl_gym.reproduction.versus.arenas import ARENAS
from acl_gym.reproduction.versus.contest import Contest
from acl_gym.reproduction.versus.spaces import Choice, defaults_of, space_of
from acl_gym.reproduction.versus.tuned import (
    best_of,
    methods_in,
    path_of,
    read_search,
    settings_of,
)

PAIRS = [(name, method) for name in ARENAS for method in methods_in(ARENAS[name])]

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "tune.py"


def inside(dimension: Any, value: Any) -> bool:
    if isinstance(dimension, Choice):
        return value in dimension.values
    return bool(dimension.low <= value <= dimension.high)


@pytest.mark.parametrize(("name", "method"), PAIRS)
def test_the_search_that_is_kept(name: str, method: str) -> None:
    """16 evaluations, the first of them the defaults, all of them in the space."""
    space, defaults = (f(ARENAS[name], method) for f in (space_of, defaults_of))
    found = read_search(name, method)
    evaluations = found["evaluations"]
    assert len(evaluations) == tuning.EVALUATIONS
    assert found["seeds"] == list(tuning.SEEDS)
    assert evaluations[0]["parameters"] == {key: defaults[key] for key in space}
    for each in evaluations:
        assert set(each["parameters"]) == set(space)
        for key, value in each["parameters"].items():
            assert inside(space[key], value), key
        assert each["value"] == pytest.approx(sum(each["costs"]) / len(each["costs"]))
        assert 0 < each["value"] <= ARENAS[name].ceiling
    best = best_of(found)
    assert best["value"] <= min(each["value"] for each in evaluations) + 1e-8
    settings = settings_of(name, method)
    assert settings == {**defaults, **best["parameters"]}
    assert Contest(ARENAS[name], method, settings).brief() is not None


def test_every_method_has_as_many_evaluations_and_none_is_of_a_tuning_seed() -> None:
    counts = {len(read_search(*pair)["evaluations"]) for pair in PAIRS}
    assert counts == {tuning.EVALUATIONS}
    assert min(tuning.SEEDS) >= 1000


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arenas in which a run takes a moment."""
    for name, arena in ARENAS.items():
        monkeypatch.setitem(ARENAS, name, replace(arena, steps=300))


@pytest.mark.usefixtures("short")
def test_a_search_that_was_stopped_goes_on_as_if_it_had_not_been(
    tmp_path: Path,
) -> None:
    pytest.importorskip("optuna")
    told: list[None] = []
    tuning.search(
        "row", "acl", tmp_path / "a", evaluations=1, tell=lambda: told.append(None)
    )
    assert len(told) == 1
    stopped = tuning.search("row", "acl", tmp_path / "a", evaluations=8)
    whole = tuning.search("row", "acl", tmp_path / "b", evaluations=8)
    for one, other in zip(stopped["evaluations"], whole["evaluations"], strict=True):
        assert one["parameters"] == other["parameters"]
        assert one["costs"] == other["costs"]
    assert json.loads(path_of("row", "acl", tmp_path / "a").read_text()) == stopped
    assert {"optuna", "acl-gym", "numpy"} <= stopped["versions"].keys()


@pytest.mark.usefixtures("short")
def test_a_file_of_another_search_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    tuning.search("row", "q", tmp_path, evaluations=1)
    with pytest.raises(
        ValueError, match=r"seeds is \[1000, 1001\] and not \[7\]; remove"
    ):
        tuning.search("row", "q", tmp_path, evaluations=1, seeds=(7,))
    path = path_of("row", "q", tmp_path)
    found = json.loads(path.read_text())
    found["evaluations"][0]["parameters"]["epsilon"] = 0.2
    path.write_text(json.dumps(found))
    with pytest.raises(ValueError, match="its evaluation 0 is another; remove"):
        tuning.search("row", "q", tmp_path, evaluations=1)


def test_without_optuna_the_error_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = builtins.__import__

    def without(name: str, *arguments: Any, **options: Any) -> Any:
        if name == "optuna":
            raise ModuleNotFoundError(name)
        return whole(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'acl-gym\[dev\]'"):
        tuning.search("row", "acl", tmp_path)


def test_of_equal_values_the_one_that_costs_least_on_the_way_is_the_best() -> None:
    search = {
        "evaluations": [
            {"value": 5.0, "on_the_way": 9.0, "parameters": 0},
            {"value": 5.0 + 1e-12, "on_the_way": 7.0, "parameters": 1},
            {"value": 6.0, "on_the_way": 1.0, "parameters": 2},
        ]
    }
    assert best_of(search)["parameters"] == 1


def test_the_mean_cost_over_a_run() -> None:
    rows = {"env_steps": [10.0, 20.0, 40.0], "policy_cost": [8.0, 4.0, 2.0]}
    assert tuning.mean_cost(rows) == (10 * 8 + 10 * 8 + 20 * 4) / 40


def test_searches_that_are_missing_or_damaged(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"tune\.py --only row-acl"):
        read_search("row", "acl", tmp_path)
    with pytest.raises(ValueError, match="arena must be one of"):
        read_search("moon", "acl", tmp_path)
    with pytest.raises(ValueError, match="method must be one of"):
        read_search("pendulum-noise", "dqn", tmp_path)
    for text in ("{", "{}", '{"evaluations": [{}]}'):
        path_of("row", "acl", tmp_path).write_text(text)
        with pytest.raises(ValueError, match="is not the data of a search"):
            read_search("row", "acl", tmp_path)


def tune(*arguments: str, out: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *arguments, "--out", str(out)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_the_command(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    done = tune("--only", "row-q", "--evaluations", "1", out=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "| 1-D grid | Q-learning | 5 | 5 | " in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["row-q.json"]
    wrong = tune("--only", "moon", out=tmp_path)
    assert wrong.returncode == 2
    assert "--only must be arenas or arena-method, got 'moon'" in wrong.stderr


def test_the_folder_is_in_the_package() -> None:
    assert tuned.FOLDER.is_dir()
    assert (tuned.FOLDER.parent / "reproduce.py").is_file()
