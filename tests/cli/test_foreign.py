"""Environments of other packages, and films of any."""

from __future__ import annotations

import json
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import DiscretizeAction
from PIL import Image

from acl_gym import ACL, ReturningACL, WaitingVectorEnv, evaluate_policy_cost
from acl_gym.cli.environments import Environment
from tests.cli.runner import PENDULUM, SMALL, figures, invoke, refused

FEW = ["--ants", "10", "--trials", "2", "--max-steps", "20"]


def test_rewards_that_are_no_costs_get_a_deposit_with_a_word() -> None:
    shown = invoke("train", "CartPole-v1", "--agent", "acl", *FEW, "--out", "c")
    assert shown.exit_code == 0, shown.output
    (note,) = [line for line in shown.stderr.splitlines() if "note:" in line]
    assert "not negative costs" in note
    assert "--param deposit=rank:5" in note
    assert "policy return" in shown.stdout
    assert "success" not in shown.stdout, "nothing is known of it"
    found = figures("evaluate", "c.npz")
    assert found["mean_return"] == -found["policy_cost"] > 0
    assert found["success_rate"] is None
    assert ACL.load("c.npz").deposit.exponent == 5  # type: ignore[attr-defined]
    shown = invoke("evaluate", "c.npz")
    assert f"mean return {found['mean_return']:.4f}" in " ".join(shown.stdout.split())


@pytest.mark.parametrize(
    "arguments",
    [
        ["CartPole-v1"],
        ["MountainCar-v0", "--agent", "acl"],
        ["CartPole-v1", "--param", "deposit=return"],
        ["CartPole-v1", "--param", "cost=steps"],
        ["CartPole-v1", "--agent", "q-learning"],
    ],
)
def test_no_word_where_none_is_needed(arguments: list[str]) -> None:
    """The agent has no deposits, costs are costs, or the user has chosen."""
    shown = invoke("train", *arguments, *FEW)
    assert shown.exit_code == 0, shown.output
    assert "not negative costs" not in shown.stderr


def test_a_deposit_that_does_not_suit_names_the_option() -> None:
    arguments = ["CartPole-v1", "--agent", "acl", "--param", "deposit=inverse_cost"]
    line = refused(1, "train", *arguments, *FEW)
    assert "Add --param deposit=rank:5, or deposit=return" in line


def test_a_hint_where_all_ants_cost_the_same() -> None:
    """No random ant gets up the mountain in 20 steps: each costs 20."""
    arguments = ["train", "MountainCar-v0", "--ants", "5", "--max-steps", "20"]
    arguments += ["--agent", "acl"]
    shown = invoke(*arguments, "--trials", "9", "--evaluate-every", "9", "--out", "m")
    (line,) = [line for line in shown.stderr.splitlines() if "hint:" in line]
    assert "in the first 5 trials all 5 ants cost the same, 20" in line
    assert "--max-steps" in line
    for quiet in (
        ["train", "--resume", "m.npz", "--trials", "6"],
        [*arguments, "--trials", "6", "--agent", "q-learning"],
        [*arguments, "--trials", "4"],
        [*SMALL, "--trials", "6"],
    ):
        assert "hint:" not in invoke(*quiet).stderr


def test_continuous_actions_are_discretised() -> None:
    arguments = ["train", "Pendulum-v1", *FEW, "--discretize", "3", "--cells", "5"]
    trained = figures(*arguments, "--out", "p")
    assert trained["discretize"] == [3]
    agent = ReturningACL.load("p.npz")
    assert agent.n_actions == 3
    env = WaitingVectorEnv(
        [lambda: DiscretizeAction(gym.make("Pendulum-v1"), bins=3)] * 100
    )
    expected = evaluate_policy_cost(agent, env, max_steps=20, seed=0)
    evaluated = figures("evaluate", "p.npz")
    assert evaluated["policy_cost"] == trained["policy_cost"] == expected.cost
    # Between the values, in the environment as it is.
    between = figures("evaluate", "p.npz", "--interpolate")
    box_env = WaitingVectorEnv.make("Pendulum-v1", 100)
    policy = agent.interpolated_policy()
    assert policy.grid.values.ravel() == pytest.approx([-4 / 3, 0, 4 / 3], abs=1e-6)
    expected = evaluate_policy_cost(policy, box_env, max_steps=20, seed=0)
    assert between["policy_cost"] == expected.cost != evaluated["policy_cost"]
    assert (between["interpolated"], between["discretize"]) == (True, [3])
    more = figures("train", "--resume", "p.npz", "--trials", "1", "--discretize", "3")
    assert (more["trials"], more["discretize"]) == (3, [3])
    refused(2, "train", "--resume", "p.npz", "--discretize", "4")


def test_only_discretised_actions_can_be_interpolated() -> None:
    figures(*SMALL, "--trials", "1", "--out", "s")
    assert "--discretize 5" in refused(2, "evaluate", "s.npz", "--interpolate")


def test_each_dimension_has_its_own_number(monkeypatch: pytest.MonkeyPatch) -> None:
    class Two(gym.Env[Any, Any]):
        observation_space = gym.spaces.Box(0.0, 1.0, (1,), np.float64)
        action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float64)

        def reset(self, *, seed: Any = None, options: Any = None) -> Any:
            super().reset(seed=seed)
            return np.array([0.5]), {}

        def step(self, action: Any) -> Any:
            return np.array([0.5]), -1.0 - float(np.abs(action).sum()), False, False, {}

    gym.register("TwoDimensions-v0", entry_point=Two, max_episode_steps=5)
    try:
        arguments = ["train", "TwoDimensions-v0", *FEW, "--out", "t"]
        figures(*arguments, "--discretize", "5,3")
        assert ReturningACL.load("t.npz").n_actions == 15
        figures(*arguments, "--discretize", "4")
        assert ReturningACL.load("t.npz").n_actions == 16
        assert "at most 10,000 actions" in refused(2, *arguments, "--discretize", "200")
        assert "2 dimensions" in refused(2, *arguments, "--discretize", "2,3,4")
    finally:
        del gym.registry["TwoDimensions-v0"]


@pytest.mark.parametrize(
    ("arguments", "size"),
    [(SMALL, (480, 480)), (["train", "CartPole-v1", *FEW], (600, 400))],
)
def test_a_film_of_an_episode(
    arguments: list[str], size: tuple[int, int], tmp_path: Path
) -> None:
    figures(*arguments, "--max-steps", "20", "--out", "x")
    found = figures("evaluate", "x.npz", "--video", "x.gif", "--seed", "3")
    assert found["video"] == "x.gif"
    plain = figures("evaluate", "x.npz", "--seed", "3")
    del found["video"]
    assert found == plain, "a film changes no figure"
    with Image.open(tmp_path / "x.gif") as film:
        assert film.size == size
        assert 2 <= film.n_frames <= 21  # type: ignore[attr-defined]


@pytest.mark.skipif(find_spec("moviepy") is None, reason="no moviepy")
def test_a_film_as_mp4(tmp_path: Path) -> None:
    figures(*SMALL, "--max-steps", "5", "--out", "x")
    assert invoke("evaluate", "x.npz", "--video", "x.mp4").exit_code == 0
    assert (tmp_path / "x.mp4").read_bytes()[4:8] == b"ftyp"


def test_what_cannot_be_shown_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    figures(*SMALL, "--max-steps", "5", "--out", "x")
    assert "must be one of '.gif', '.mp4'" in refused(
        *(2, "evaluate", "x.npz", "--video", "x.avi")
    )
    assert "no folder" in refused(2, "evaluate", "x.npz", "--video", "no/x.gif")
    monkeypatch.setattr("acl_gym.cli.showing.find_spec", lambda name: None)
    line = refused(2, "evaluate", "x.npz", "--video", "x.mp4")
    assert "pip install moviepy" in line
    assert ".gif" in line
    if sys.platform.startswith("linux"):
        for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
            monkeypatch.delenv(name, raising=False)
        assert "needs a display" in refused(2, "evaluate", "x.npz", "--render")


def test_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL's dummy driver has a window that nobody sees."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    figures(*SMALL, "--max-steps", "3", "--out", "x")
    found = figures("evaluate", "x.npz", "--render")
    assert found == figures("evaluate", "x.npz")


@pytest.mark.usefixtures("short_runs")
def test_any_environment_is_compared(tmp_path: Path) -> None:
    shown = invoke(
        *("compare", "--env", "FrozenLake-v1", "--preset", "smoke", "--seeds", "2"),
        *("--agents", "acl-crisp,q-crisp", "--workers", "1", "--out", "c"),
    )
    assert shown.exit_code == 0, shown.output
    found = json.loads((tmp_path / "c" / "results.json").read_text())
    assert found["env"] == "FrozenLake-v1"
    assert found["reference"]["method"] == "the best policy of these runs"
    assert {row["agent"] for row in found["rows"]} == {"acl-crisp", "q-crisp"}
    assert {row["seed"] for row in found["rows"]} == {0, 1}
    assert {row["success_rate"] for row in found["rows"]} == {None}
    costs = [row["policy_cost"] for row in found["rows"]]
    assert found["reference"]["best_known_cost"] == min(costs)
    assert -1.0 <= min(costs) <= max(costs) <= 0.0
    for name in ("report.html", "results.parquet", "comparison.png"):
        assert (tmp_path / "c" / name).is_file()


def test_our_own_environments_report_costs() -> None:
    assert "policy cost" in invoke("train", PENDULUM, *FEW).stdout


def test_slots_of_a_shared_world_are_worlds_of_their_own() -> None:
    """So that their number is no part of the task."""
    env = Environment("acl_gym/SwarmAggregation-v0", {"nearest": 0}).vector(3)
    assert isinstance(env, WaitingVectorEnv)
    assert env.reset(seed=0)[0].shape == (3, 4)
    assert (
        "policy return" in invoke("train", "acl_gym/SwarmAggregation-v0", *FEW).stdout
    )
