"""How the command line fails: one line, an exit code, no traceback."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from acl_gym.utils import files
from tests.cli.runner import (
    MODULE,
    PENDULUM,
    ROOT,
    SMALL,
    figures,
    invoke,
    refused,
    run,
)


@pytest.mark.parametrize(
    ("argument", "written", "said"),
    [
        ("compare", False, "interrupted; finished runs are kept"),
        ("envs", False, "interrupted; nothing was written."),
        ("envs", True, "interrupted; files written so far are kept."),
    ],
)
def test_an_interrupted_command_says_what_is_kept(
    argument: str, written: bool, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: Any, **__: Any) -> None:
        if written:
            files.write_atomically("a", b"1")
        raise KeyboardInterrupt

    monkeypatch.setattr("acl_gym.utils.files._Written.any", False)
    monkeypatch.setattr("acl_gym.experiments.comparison.compare.compare", interrupt)
    monkeypatch.setattr("acl_gym.cli.envs.describe", interrupt)
    assert said in refused(130, argument)


@pytest.mark.parametrize("best", [False, True])
def test_a_place_that_cannot_be_written_is_refused_before_learning(best: bool) -> None:
    if best:
        Path("a-best.npz").mkdir()
        assert "a-best.npz is a folder" in refused(2, *SMALL, "--out", "a")
        return
    line = refused(2, *SMALL, "--out", "/proc/self/a.npz")
    assert "a.npz cannot be written in the folder /proc/self" in line
    assert "--out FILE.npz" in line


def test_too_many_ants() -> None:
    line = refused(2, "train", PENDULUM, "--ants", str(10**12))
    assert "1,000,000,000,000 slots must fit into" in line
    assert line.endswith("use fewer ants or slots.")


def test_memory_that_ends_before_the_first_walk_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise MemoryError("1 TiB")

    monkeypatch.setattr("acl_gym.evaluation.rollout.Rollout.start", full)
    assert "not enough memory; take fewer ants" in refused(1, *SMALL)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["trian"], "No such command 'trian'. Did you mean 'train'"),
        (["train"], "ENV_ID is missing"),
        (["train", PENDULUM, "--trials", "0"], "--trials"),
        (["train", PENDULUM, "--ants", "many"], "--ants"),
        (["train", PENDULUM, "--seed", "-1"], "--seed"),
        (["train", PENDULUM, "--agent", "sarsa"], "'returning', 'acl', 'q-learning'"),
        (["train", PENDULUM, "--walk"], "No such option: --walk"),
        (["train", "acl_gym/Pendulm-v0"], "Did you mean 'acl_gym/Pendulum-v0'"),
        (["train", "no_such_module:X-v0"], "no_such_module"),
        (["train", "FrozenLake-v1", "--cells", "4"], "cells and bounds must be None"),
        (["train", "Blackjack-v1"], "Tuple"),
        (["train", "Pendulum-v1"], "add --discretize 5 for five values"),
        (["train", "Pendulum-v1"], "acl_gym/Pendulum-v0 of this package"),
        (["train", "Pendulum-v0"], "'acl_gym/Pendulum-v0' of this package"),
        (["train", "Pendulum-v0"], "with --discretize 5"),
        (["train", "CartPole"], "no environment 'CartPole'"),
        (
            ["train", "FrozenLake-v1", "--env-arg", "is_slippery=never"],
            "is_slippery must be true or false, got 'never'",
        ),
        (["train", "Pendulum-v1", "--discretize", "1"], "number of values >= 2"),
        (["train", "Pendulum-v1", "--discretize", "5,3"], "each of the 1 dimensions"),
        ([*SMALL, "--discretize", "5"], "for continuous actions, but"),
        ([*SMALL, "--cells", "6,7,8"], "cells must be an int or 2 ints"),
        ([*SMALL, "--cells", "six"], "--cells must be whole numbers"),
        ([*SMALL, "--param", "epsilon"], "--param must be name=value, got 'epsilon'"),
        ([*SMALL, "--param", "speed=1"], "no 'speed'; choose from alpha (> 0), "),
        ([*SMALL, "--param", "seed=1"], "no 'seed'"),
        ([*SMALL, "--param", "epsilon=1.5"], "epsilon must lie in [0, 1]"),
        (
            [*SMALL, "--param", "epsilon=high"],
            "has no 'high'; choose from linear:START",
        ),
        ([*SMALL, "--param", "deposit=rnak:5"], "Did you mean 'rank'?"),
        ([*SMALL, "--param", "tabu=yes"], "must be true or false"),
        ([*SMALL, "--env-arg", "torques=[1,2"], "must be a list such as"),
        ([*SMALL, "--env-arg", "render_mode=human"], "no parameter of"),
        ([*SMALL, "--out", "."], "is a folder"),
        (["train", "--resume", "/no/such/agent"], "no agent file at"),
        ([*SMALL, "--param", "alpha=1", "--param", "alpha=2"], "twice"),
        ([*SMALL, "--env-arg", "gravitas=1"], "choose from inertia, motor_gain"),
        ([*SMALL, "--env-arg", "mass=-1"], "mass must lie in"),
        ([*SMALL, "--out", "/no/such/folder/x"], "no folder /no/such/folder"),
        ([*SMALL, "--log", "/no/such/folder/x"], "no folder /no/such/folder"),
        ([*SMALL, "--log", str(ROOT / "README.md")], "is not a log"),
        (["evaluate", "/no/such/agent"], "no agent file at /no/such/agent.npz"),
        (["evaluate", str(ROOT / "README.md")], "is not an agent saved by acl-gym"),
        (["envs", "CartPole-v1"], "no environment 'CartPole-v1'; choose from"),
        (["envs", "acl_gym/Pendulum"], "Did you mean 'acl_gym/Pendulum-v0'?"),
        (["compare", "--preset", "huge"], "--preset must be one of 'smoke'"),
        (["compare", "--env", "CartPol-v1"], "Did you mean 'CartPole-v1'?"),
        (["compare", "--env", "Pendulum-v1"], "--discretize"),
        (["compare", "--agents", "sarsa"], "must be one of 'acl-fuzzy'"),
        (["compare", "--seeds", "0"], "whole number >= 1"),
    ],
)
def test_bad_arguments_are_one_line_and_2(arguments: list[str], message: str) -> None:
    assert message in refused(2, *arguments)


def test_an_agent_for_another_environment(tmp_path: Path) -> None:
    out = str(tmp_path / "x.npz")
    figures(*SMALL, "--out", out)
    line = refused(2, "evaluate", out, "--env-id", "CartPole-v1")
    assert "3 actions as the table has, got 2" in line


def test_a_run_that_fails_is_one_line_and_1(tmp_path: Path) -> None:
    """Rewards that are no costs."""
    (tmp_path / "my_treat.py").write_text(
        MODULE.replace("-1.0, self.x", "1.0, self.x").replace("Corridor-v0", "Treat-v0")
    )
    arguments = ["train", "my_treat:Treat-v0", "--ants", "3", "--trials", "3"]
    arguments += ["--param", "tau0=0.001", "--param", "deposit=inverse_cost"]
    done = run(*arguments, "--json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert "cost" in line


@pytest.mark.parametrize("first", [True, False])
def test_debug_shows_the_traceback(first: bool) -> None:
    arguments = ["evaluate", "/no/such/agent"]
    arguments = ["--debug", *arguments] if first else [*arguments, "--debug"]
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert "Traceback" in result.stderr
    assert result.stderr.splitlines()[-1].startswith("acl-gym: no agent file")


def test_a_warning_is_one_line_and_json_stays_pure(tmp_path: Path) -> None:
    done = run(*SMALL, "--param", "tau0=0.5", "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert json.loads(done.stdout)["parameters"]["tau0"] == 0.5
    (line,) = done.stderr.splitlines()
    assert line.startswith("acl-gym: warning: tau0 = 0.5 exceeds")
