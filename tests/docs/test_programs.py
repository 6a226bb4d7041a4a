"""The programs of pages about plants run as printed, and do what the pages say."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import acl_gym

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEST = 38.4  # of the thesis's pendulum

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (DOCS / "conf.py").exists(),
        reason="a source distribution has no documentation",
    ),
]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the programs write goes into an empty folder."""
    monkeypatch.chdir(tmp_path)


def run(page: str) -> dict[str, Any]:
    """The names that are defined once all programs of a page have run, in order."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert blocks
    names: dict[str, Any] = {"__name__": page}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    return names


def cost_of(policy: Any, **parameters: Any) -> float:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, **parameters)
    return acl_gym.evaluate_policy_cost(policy, env).cost


def test_changing_plants(capsys: pytest.CaptureFixture[str]) -> None:
    names = run("changing-plants")
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 30
    assert names["env"].values == pytest.approx({"mass": 0.08, "motor_gain": 0.09})
    assert len(names["window"]) == 300
    # In the model of the newest steps it has learned the plant as it is now.
    last = acl_gym.evaluate_policy_cost(names["colony"], names["env"].now())
    assert last.success_rate >= 0.95


def test_uncertain_plants(capsys: pytest.CaptureFixture[str]) -> None:
    names = run("uncertain-plants")
    found = acl_gym.evaluate_over_range(names["colony"], names["env"])
    assert f"{found}" in capsys.readouterr().out
    assert found.nominal.cost < 1.25 * BEST
    assert found.worst.cost < 200.0, "of a colony that learns the nominal plant: 319"
    assert min(found.success_rates) > 0.9


def test_continuous_actions() -> None:
    names = run("continuous-actions")
    interpolated = cost_of(names["policy"], continuous=True)
    assert interpolated == pytest.approx(39.2, abs=0.1)
    assert cost_of(names["agent"]) == pytest.approx(42.7, abs=0.1)
    (torque,) = names["policy"].predict([3.3, 0.1])[0]
    assert torque == pytest.approx(-0.8)
    assert "policy_input(const float x[2], float u[1])" in Path("swing_up.h").read_text(
        encoding="utf-8"
    )


def test_learning_from_data(capsys: pytest.CaptureFixture[str]) -> None:
    record("data.csv")
    names = run("learning-from-data")
    assert capsys.readouterr().out.startswith("LearnedDynamics(gaussian process")
    assert cost_of(names["learned"].policy) < 1.1 * BEST
    assert cost_of(names["colony"].policy) < 1.25 * BEST
    assert Path("rig/transitions.csv").is_file()
    assert Path("policy.h").is_file()
    assert Path("policy.npz").is_file()


def record(path: str) -> None:
    """A minute of the pendulum under random torques, as the page describes the file."""
    plant: Any = gym.make("acl_gym/Pendulum-v0", max_episode_steps=50)
    rng = np.random.default_rng(0)
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["run", "time", "theta", "omega", "u"])
        for number in range(12):
            state, _ = plant.reset(seed=number)
            for step in range(50):
                if step % 5 == 0:
                    action = int(rng.integers(3))
                row = [number, round(0.1 * step, 1), *state, [-0.8, 0.0, 0.8][action]]
                table.writerow(row)
                state, _, done, _, _ = plant.step(action)
                if done:
                    break
