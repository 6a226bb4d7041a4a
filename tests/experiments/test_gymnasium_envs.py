"""Gymnasium's own environments: what the benchmark writes, and that ACL learns there."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import (
    ACL,
    PolicyEvaluation,
    WaitingVectorEnv,
    automatic_partition,
    evaluate_policy_cost,
)
from acl_gym.colony.deposits import Rank
from tests.scripts import run_script

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "benchmarks" / "gymnasium_envs.py"

ENVIRONMENTS = ("FrozenLake-v1", "CliffWalking-v1")


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run_script(SCRIPT, "--out", str(folder), *arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("gymnasium")


def smoke(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return run(folder, "--preset", "smoke", "--env", ",".join(ENVIRONMENTS), *more)


@pytest.fixture(scope="module")
def finished(folder: Path) -> subprocess.CompletedProcess[str]:
    return smoke(folder)


def test_results_and_table_hold_every_run(finished, folder: Path) -> None:
    assert finished.returncode == 0, finished.stderr
    results = json.loads((folder / "results.json").read_text())
    methods = ("acl", "returning", "q-learning", "q-replay", "dqn", "ppo", "a2c")
    wanted = {(env, method) for env in ENVIRONMENTS for method in methods}
    assert {(run["env"], run["method"]) for run in results["runs"]} == wanted
    assert {(row["env"], row["method"]) for row in results["table"]} == wanted
    for one in results["runs"]:
        assert one["steps"] > 0
        assert one["seconds"] > 0
        assert one["best_steps"] <= one["steps"]
        assert (one["target_steps"] is None) == (one["target_seconds"] is None)
        low, high = (0, 1) if one["env"] == "FrozenLake-v1" else (-20_000, -13)
        for which in ("final", "best"):
            assert low <= one[which]["return"] <= high
    table = (folder / "table.md").read_text()
    assert len(table.splitlines()) == 2 + len(wanted)
    assert table.strip() in finished.stdout


def test_kept_runs_are_not_made_again(finished, folder: Path) -> None:
    files = sorted((folder / "runs").iterdir())
    times = [path.stat().st_mtime_ns for path in files]
    again = smoke(folder, "--table-only")
    assert again.returncode == 0, again.stderr
    assert [path.stat().st_mtime_ns for path in files] == times
    assert (folder / "table.md").read_text().strip() in again.stdout


def test_an_unknown_name_is_refused_with_those_that_are_known(tmp_path: Path) -> None:
    refused = run(tmp_path, "--env", "Pong-v0")
    assert refused.returncode == 2
    assert "'Pong-v0' is not one of CartPole-v1" in refused.stderr


def test_the_colony_reaches_the_target_and_seeds_are_a_number(tmp_path: Path) -> None:
    arguments = ("--env", "FrozenLake-v1", "--agents", "returning")
    done = run(tmp_path, *arguments, "--seeds", "2", "--seed", "3")
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "results.json").read_text())
    assert [one["seed"] for one in results["runs"]] == [3, 4]
    (row,) = results["table"]
    assert row["final"]["reached"] == 2
    assert 0 < row["target_steps"] < row["steps"] < 11_000


def test_scaled_observations_and_rewards_are_for_those_that_ask(tmp_path: Path) -> None:
    smoke = ("--preset", "smoke", "--env", "MountainCar-v0", "--agents", "ppo,a2c")
    done = run(tmp_path, *smoke)
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "results.json").read_text())
    # The returns are those of the environment, not what the network has learned from.
    for one in results["runs"]:
        assert -200.0 <= one["final"]["return"] <= -80.0
        assert 2 * one["final"]["return"] % 1 == 0  # a mean of two whole numbers


def test_without_kept_runs_there_is_no_table(tmp_path: Path) -> None:
    empty = run(tmp_path, "--table-only", "--agents", "acl")
    assert empty.returncode == 1
    assert "no runs" in empty.stdout


def test_acl_finds_the_way_over_the_frozen_lake() -> None:
    env = gym.make_vec(
        "FrozenLake-v1", num_envs=50, vectorization_mode="sync", is_slippery=False
    )
    colony = ACL(env, deposit="return", seed=0).learn(trials=30)
    result = evaluate_policy_cost(
        colony.policy, WaitingVectorEnv.make("FrozenLake-v1", 1, is_slippery=False)
    )
    assert result.cost == -1.0


def test_acl_finds_the_shortest_way_along_the_cliff() -> None:
    env = WaitingVectorEnv.make("CliffWalking-v1", 100, max_episode_steps=200)
    colony = ACL(
        env,
        deposit=Rank(30),
        alpha=1.0,
        epsilon=0.05,
        global_decay=0.3,
        seed=2,
        max_steps=200,
    )
    colony.learn(trials=18)
    one = WaitingVectorEnv.make("CliffWalking-v1", 1)
    assert evaluate_policy_cost(colony.policy, one, max_steps=200).cost == 13.0


def test_acl_balances_the_pole_far_longer_than_chance() -> None:
    env = gym.make_vec("CartPole-v1", num_envs=200)
    bounds = {0: (-2.4, 2.4), 1: (-3.0, 3.0), 2: (-0.21, 0.21), 3: (-3.5, 3.5)}
    grid = automatic_partition(env, cells=(3, 3, 7, 7), bounds=bounds)
    watch = PolicyEvaluation(
        gym.make_vec("CartPole-v1", num_envs=20), every=5, max_steps=500
    )
    colony = ACL(env, grid, deposit=Rank(5), seed=0)
    colony.learn(trials=20, callback=watch)
    assert watch.best is not None
    by_chance = -np.mean([row["ants_cost"] for row in colony.history[:1]])
    assert by_chance < 30
    assert -watch.best.cost > 200
