"""The benchmark of few interactions: its rows, its table, its figure, its errors."""

from __future__ import annotations

import json
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym.envs.control.lookup import system_of

FOLDER = Path(__file__).resolve().parent.parent / "benchmarks"
PENDULUM = "acl_gym/Pendulum-v0"


@pytest.fixture(scope="module")
def bench() -> Iterator[SimpleNamespace]:
    """The script and its neighbours, which it imports by their names."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FOLDER)
        before = set(sys.modules)
        found = runpy.run_path(str(FOLDER / "few_interactions.py"))
        yield SimpleNamespace(**found)
        for name in set(sys.modules) - before:
            if name.startswith("few_"):
                del sys.modules[name]


def rows_of(
    bench: SimpleNamespace, capsys: pytest.CaptureFixture[str], *arguments: str
) -> list[dict[str, Any]]:
    assert bench.main([*arguments, "--json"]) == 0
    rows: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["rows"]
    return rows


def test_rows(
    bench: SimpleNamespace, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    kept = tmp_path / "rows.json"
    rows = rows_of(
        bench,
        capsys,
        *("--methods", "model", "returning", "q-learning", "q-replay"),
        *("--interactions", "40", "20", "--seeds", "1", "--out", str(kept)),
    )
    assert [(row["method"], row["interactions"]) for row in rows] == [
        *(("model", 20), ("model", 40), ("returning", 20), ("returning", 40)),
        *(("q-learning", 20), ("q-learning", 40), ("q-replay", 20), ("q-replay", 40)),
    ]
    assert json.loads(kept.read_text())["rows"] == rows
    for row in rows:
        assert {"seed", "seconds", "policy_cost", "success_rate"} <= set(row)
        assert row["seed"] == 0
        # No policy is cheaper than the best, or costs more than the highest stage cost
        # (18.0, at the corner of the state space) in each of 300 steps.
        assert 38.3 < row["policy_cost"] < 300 * 18.0
        assert row["made"] >= row["interactions"]
    # In 20 of 20 measured runs a model was worth less than 44 after 40 interactions.
    assert rows[1]["policy_cost"] < 50
    assert rows[1]["made"] == 40
    assert bench.main(["--read", str(kept), "--figure", str(tmp_path / "f.png")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 2 + 8
    assert set(bench.LOOKS) == set(bench.METHODS)
    assert "within 25% | within 10%" in printed[0]
    assert (tmp_path / "f.png").stat().st_size > 10_000


def test_a_plant_at_rest_whose_task_must_be_learned(bench: SimpleNamespace) -> None:
    """The variant starts at rest and hides its task; policies are judged as always."""
    task = bench.PlantTask(PENDULUM, "rest", True)
    plant = task.plant()
    system = system_of(plant)
    assert system is not None
    assert system.task is None
    for seed in range(3):
        observation, _ = plant.reset(seed=seed)
        np.testing.assert_array_equal(observation, [[0.0, 0.0]])
    assert task.steps_of_a_run == 40
    assert bench.PlantTask(PENDULUM).steps_of_a_run == 10
    plain = gym.make_vec(PENDULUM, num_envs=1)
    original = system_of(plain)
    assert original is not None
    # The same dynamics: one step from one state leads to one state.
    start = {"state": np.array([[1.0, 2.0]])}
    for env in (plant, plain):
        env.reset(options=start)
    np.testing.assert_array_equal(plant.step([2])[0], plain.step([2])[0])


def test_continuous_actions_are_numbered(bench: SimpleNamespace) -> None:
    task = bench.PlantTask("Pendulum-v1")
    env: Any = gym.make(task.variant)
    assert env.action_space == gym.spaces.Discrete(5)
    # Number 1 of -2, -1, 0, 1, 2 is a torque of -1.
    plain = gym.make("Pendulum-v1")
    for each in (env, plain):
        each.reset(seed=3)
    torque = np.array([-1.0], np.float32)
    np.testing.assert_array_equal(env.step(1)[0], plain.step(torque)[0])
    assert isinstance(task.plant().action_space, gym.spaces.Box)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["model-acl", "model-q", "dqn"])
def test_other_methods(
    method: str, bench: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    if method == "dqn":
        pytest.importorskip("stable_baselines3")
    arguments = ("--methods", method, "--interactions", "40", "--seeds", "1")
    (row,) = rows_of(bench, capsys, *arguments)
    assert (row["method"], row["interactions"]) == (method, 40)
    assert 38.3 < row["policy_cost"] < 300 * 18.0


@pytest.mark.slow
def test_an_environment_of_another_package(
    bench: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    """Costs are returns turned round; no return of this pendulum is below -3,300."""
    rows = rows_of(
        bench,
        capsys,
        *("--env", "Pendulum-v1", "--methods", "model", "returning", "q-learning"),
        *("--interactions", "20", "--seeds", "1"),
    )
    assert [row["method"] for row in rows] == ["model", "returning", "q-learning"]
    for row in rows:
        assert 0 < row["policy_cost"] < 3_300
        assert row["success_rate"] is None


def test_the_summary_counts_who_is_near(bench: SimpleNamespace) -> None:
    rows = [
        {
            "method": "model",
            "seed": seed,
            "interactions": 100,
            "seconds": float(seed),
            "policy_cost": cost,
            "success_rate": 1.0,
        }
        for seed, cost in enumerate([100.0, 110.0, 111.0, 125.0, 126.0])
    ]
    (entry,) = bench.summary(rows, 100.0)
    assert entry["made"] == 100
    assert entry["near"] == [4, 2]
    assert entry["median"] == 111.0
    assert (entry["lowest"], entry["highest"]) == (100.0, 126.0)
    assert bench.summary(rows, None)[0]["near"] == [None, None]
    assert "within" not in bench.table(rows, None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--env", "acl_gym/Nowhere-v0"], "--env must be a registered environment"),
        (["--env", "Taxi-v4"], "--env needs observations that are numbers"),
        (["--env", "CartPole-v1", "--starts", "rest"], "--starts rest needs"),
        (["--read", "nowhere.json"], "nowhere.json"),
        (["--out", "no/folder/rows.json"], "no/folder"),
    ],
)
def test_what_cannot_be_run(
    arguments: list[str],
    message: str,
    bench: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert bench.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("few_interactions.py: ")
    assert message in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("content", ["{}", "[]", '{"rows": [{"method": "model"}]}'])
def test_files_without_rows(
    content: str,
    bench: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    file = tmp_path / "rows.json"
    file.write_text(content)
    assert bench.main(["--read", str(file)]) == 2
    assert "must hold rows of this benchmark" in capsys.readouterr().err


@pytest.mark.parametrize("value", ["0", "4", "many"])
def test_too_few_interactions(
    value: str, bench: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    """A model needs five steps."""
    with pytest.raises(SystemExit, match="2"):
        bench.main(["--interactions", value])
    assert f"must be an integer >= 5, got '{value}'" in capsys.readouterr().err
