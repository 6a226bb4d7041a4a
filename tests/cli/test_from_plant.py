"""`acl-gym train --interactions` and `--from-data`: learning in a model."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

from acl_gym import Transitions
from acl_gym.cli.environments import Environment
from tests.cli.runner import MODULE, PENDULUM, figures, invoke, refused

FEW = ["train", PENDULUM, "--interactions", "40", "--restart-after", "10"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 random steps of the pendulum: enough for a model with errors below 0.1."""
    file = tmp_path_factory.mktemp("data") / "recorded.npz"
    Transitions.record(gym.make(PENDULUM), 60, hold=3, seed=0).save(file)
    return file


@pytest.fixture(scope="module")
def table(recorded: Path) -> Path:
    """The same as rows of measurements."""
    data = Transitions.load(recorded)
    file = recorded.with_name("log.csv")
    pd.DataFrame(
        {
            "t": 0.1 * np.arange(len(data)),
            "theta": data.states[:, 0],
            "omega": data.states[:, 1],
            "u": data.inputs[:, 0],
        }
    ).to_csv(file, index=False)
    return file


def test_few_interactions_give_a_policy_for_the_plant() -> None:
    """In 20 runs policies cost 40 to 54 after 40 interactions; at random over 1,000."""
    found = figures(*FEW, "--log", "rounds.csv", "--seed", "1")
    assert found["interactions"] == found["recorded_steps"] == 40
    assert found["best"]["policy_cost"] < 60
    assert found["plant"] == "Pendulum-v0-plant"
    assert all(error < 0.5 for error in found["model"]["errors"].values())
    rows = found["rows"]
    assert [row["interactions"] for row in rows] == [20, 40]
    log = pd.read_csv("rounds.csv")
    assert log["model_cost"].tolist() == [row["model_cost"] for row in rows]
    # The file is of the environment, not of the model: evaluation needs nothing else.
    again = figures("evaluate", "Pendulum-v0-best.npz")
    assert again["env_id"] == PENDULUM
    assert again["policy_cost"] == found["best"]["policy_cost"]
    assert again["episodes"] == 100
    last = figures("evaluate", "Pendulum-v0.npz")
    assert last["policy_cost"] == found["policy_cost"]
    # The agent can go on where steps are cheap.
    more = figures("train", "--resume", "Pendulum-v0.npz", "--trials", "1")
    assert more["env_id"] == PENDULUM


def test_the_same_command_goes_on_and_makes_nothing_twice() -> None:
    first = figures(*FEW, "--out", "p.npz")
    assert len(Path("p-plant/transitions.csv").read_text().splitlines()) == 41
    again = invoke(*FEW, "--out", "p.npz", "--json")
    assert json.loads(again.stdout)["best"] == first["best"]
    assert len(Path("p-plant/transitions.csv").read_text().splitlines()) == 41
    more = invoke(*FEW[:2], "--interactions", "45", *FEW[4:], "--out", "p.npz")
    assert more.exit_code == 0, more.output
    assert "going on with what was recorded in p-plant" in more.stderr
    assert "45 of 45 interactions" in more.stderr
    assert len(Path("p-plant/transitions.csv").read_text().splitlines()) == 46
    other = [*FEW[:4], "--restart-after", "11", "--out", "p.npz"]
    said = refused(2, *other)
    assert "restart_after=10" in said
    assert "give another name with --out FILE.npz" in said


def test_an_error_of_the_plant_names_the_folder_of_what_was_recorded() -> None:
    """And the same command goes on where it was, once the plant is mended."""
    blown = MODULE.replace(
        "def step(self, action):",
        "def step(self, action):\n"
        "        import pathlib\n"
        "        self.made = getattr(self, 'made', 0) + 1\n"
        "        if self.made > 30 and not pathlib.Path('mended').exists():\n"
        "            raise ConnectionError('no answer from the rig')",
    ).replace("Corridor-v0", "Blown-v0")
    Path("my_blown.py").write_text(blown)
    command = ["train", "my_blown:Blown-v0", "--interactions", "40", "--quiet"]
    said = refused(2, *command, "--out", "rig.npz")
    assert "no answer from the rig. All 30 interactions made so far are kept" in said
    assert "kept in rig-plant; run the same again, and it goes on from there." in said
    Path("mended").touch()
    found = figures(*command, "--out", "rig.npz")
    assert found["recorded_steps"] == 40
    assert len(Path("rig-plant/transitions.csv").read_text().splitlines()) == 41


@pytest.mark.slow
def test_a_killed_run_goes_on() -> None:
    """SIGKILL after the first round: the second run makes what was left."""
    command = [sys.executable, "-m", "acl_gym", *FEW[:2], "--interactions", "5000"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    journal = Path("Pendulum-v0-plant/transitions.csv")
    with subprocess.Popen(
        command, env=environment, stderr=subprocess.DEVNULL
    ) as process:
        deadline = time.monotonic() + 300  # compilation may take long
        while time.monotonic() < deadline and process.poll() is None:
            if journal.exists() and len(journal.read_text().splitlines()) > 20:
                break
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
    made = len(journal.read_text().splitlines()) - 1
    assert 20 <= made < 5_000
    kept = journal.read_text()
    found = figures(*FEW[:2], "--interactions", str(made + 5))
    assert found["recorded_steps"] == made + 5
    assert journal.read_text().startswith(kept)


def test_recorded_data_alone(recorded: Path) -> None:
    found = figures("train", PENDULUM, "--from-data", str(recorded), "--out", "d.npz")
    assert (found["interactions"], found["recorded_steps"]) == (0, 60)
    assert found["data"]["file"] == str(recorded)
    assert found["plant"] is None
    assert not Path("d-plant").exists()
    assert found["best"]["success_rate"] > 0.9  # of the real pendulum
    assert found["model"]["spread_highest"] >= found["model"]["spread_median"] >= 0
    assert (
        figures("evaluate", "d-best.npz")["policy_cost"]
        == (found["best"]["policy_cost"])
    )


def test_a_table_first_and_then_the_plant(table: Path) -> None:
    """The data come first, so that not even the first step is made at random."""
    shown = invoke(
        *FEW,
        *("--from-data", str(table), "--state", "theta,omega", "--input", "u"),
        *("--time", "t"),
    )
    assert shown.exit_code == 0, shown.output
    assert "0 of 40 interactions" in shown.stderr
    assert "40 of 40 interactions" in shown.stderr
    assert "Errors in cross-validation" in shown.stdout
    assert "Its spread on the paths of the policy" in shown.stdout


@pytest.mark.slow
@pytest.mark.parametrize("agent", ["acl", "q-learning"])
def test_other_agents_in_the_model(agent: str, recorded: Path) -> None:
    found = figures(
        *("train", PENDULUM, "--from-data", str(recorded), "--agent", agent),
        *("--param", "epsilon=0.2"),
    )
    assert found["agent"] == agent
    assert (
        figures("evaluate", "Pendulum-v0-best.npz")["policy_cost"]
        == (found["best"]["policy_cost"])
    )


@pytest.mark.slow
def test_continuous_actions_of_another_package() -> None:
    """Cost and angle are learned; the actions are those of DiscretizeAction."""
    found = figures(
        *("train", "Pendulum-v1", "--interactions", "20", "--discretize", "3"),
        *("--max-steps", "20"),
    )
    assert found["discretize"] == [3]
    assert found["model"]["learned_cost_error"] is not None
    again = figures("evaluate", "Pendulum-v1-best.npz")
    assert again["mean_return"] == found["best"]["policy_return"]


def test_continuous_actions_take_values_from_end_to_end() -> None:
    """As `learn_from_plant` does; and the file is all that its evaluation needs."""
    found = figures(
        *("train", "Pendulum-v1", "--interactions", "20", "--max-steps", "20"),
        *("--out", "p.npz"),
    )
    assert (found["discretize"], found["end_to_end"]) == ([5], True)
    inputs = np.loadtxt("p-plant/transitions.csv", delimiter=",", skiprows=1)[:, 4]
    assert set(inputs) <= {-2.0, -1.0, 0.0, 1.0, 2.0}
    assert {-2.0, 2.0} <= set(inputs)  # the middles of five parts end at 1.6
    again = figures("evaluate", "p-best.npz")
    assert again["mean_return"] == found["best"]["policy_return"]
    assert (again["discretize"], again["end_to_end"]) == ([5], True)
    between = figures("evaluate", "p-best.npz", "--interpolate", "--episodes", "3")
    assert between["interpolated"]
    more = figures("train", "--resume", "p.npz", "--trials", "1")
    assert (more["discretize"], more["end_to_end"]) == ([5], True)
    assert "must be left out" in refused(
        2, "train", "--resume", "p.npz", "--discretize", "5"
    )


def test_real_inputs_of_this_package_stay_native() -> None:
    found = figures(*FEW, "--env-arg", "continuous=true", "--out", "c.npz")
    assert (found["discretize"], found["end_to_end"]) == ([5], True)
    again = figures("evaluate", "c-best.npz")
    assert again["policy_cost"] == found["best"]["policy_cost"]
    assert again["episodes"] == 100  # from its evaluation states
    environment = Environment(PENDULUM, {"continuous": True}, (5,), end_to_end=True)
    single, several = environment.single(), environment.vector(3)
    assert single.action_space == several.single_action_space
    states = np.tile([1.0, 2.0], (3, 1))
    several.reset(options={"state": states})
    seen = several.step(np.array([4, 4, 4]))[0]
    single.reset(options={"state": states[0]})
    np.testing.assert_array_equal(single.step(4)[0], seen[0])
    real = environment.with_real_inputs().single()
    real.reset(options={"state": states[0]})
    np.testing.assert_array_equal(real.step(np.array([0.8]))[0], seen[0])


@pytest.fixture
def corridor() -> list[str]:
    """Rows of a corridor of another package, and a command that learns from them.

    A row for each moment: what the step gave that begins there, and whether it was the
    last of its episode. The last row of a run holds the state that it led to.
    """
    Path("my_corridor.py").write_text(MODULE)
    rows: list[dict[str, Any]] = []
    rng = np.random.default_rng(0)
    for run in range(8):
        x, over = float(rng.uniform(1.0, 1.8)), False
        while not over:
            u = int(rng.random() < 0.7)
            after = float(np.clip(x + (0.1 if u else -0.1), 0.0, 2.0))
            over = after >= 1.95
            rows.append({"run": run, "x": x, "u": u, "r": -1.0, "end": int(over)})
            x = after
        rows.append({"run": run, "x": x, "u": 0, "r": 0.0, "end": 0})
    pd.DataFrame(rows).to_csv("rows.csv", index=False)
    command = "train my_corridor:Corridor-v0 --from-data rows.csv"
    return [*command.split(), "--state", "x", "--input", "u", "--run", "run"]


def test_rewards_and_ends_of_a_table_tell_cost_and_goal(corridor: list[str]) -> None:
    found = figures(*corridor, "--reward", "r", "--terminated", "end")
    assert found["model"]["learned_cost_error"] < 0.1
    assert found["model"]["learned_goal_recall"] == 1.0
    # To the right always, from 0 to 1.8: 11 steps in the mean. At random 60 and more.
    assert found["best"]["policy_return"] > -13
    blind = figures(*corridor, "--reward", "r", "--out", "blind.npz")
    assert blind["model"]["learned_goal_recall"] is None
    # Without a goal all steps are alike, whatever is done.
    assert blind["rows"][0]["model_cost"] == pytest.approx(80, rel=0.02)


def test_a_table_without_rewards_does_not_tell_a_cost(corridor: list[str]) -> None:
    said = refused(2, *corridor)
    assert "rows.csv must hold rewards" in said
    assert "add --reward COLUMN" in said
    assert "must have a column 'gain'" in refused(2, *corridor, "--reward", "gain")


@pytest.mark.slow
def test_variables_of_another_package_may_wrap_around(corridor: list[str]) -> None:
    """By the names of columns or by numbers; a corridor bent into a ring of 2 m."""
    found = [
        figures(*corridor, "--reward", "r", *more, "--out", f"ring{i}.npz")
        for i, more in enumerate(([], ["--circular", "x"], ["--circular", "0"]))
    ]
    assert found[1]["best"] | {"file": ""} == found[2]["best"] | {"file": ""}
    assert found[1]["rows"][0]["model_error"] != found[0]["rows"][0]["model_error"]
    shown = invoke(*corridor, "--reward", "r", "--circular", "y")
    assert shown.exit_code == 2
    assert "names or numbers of the variables ('x',), got ['y']" in shown.stderr


DATA = ["train", PENDULUM, "--from-data"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*FEW, "--trials", "3"], "--trials does not go with --interactions"),
        ([*FEW, "--cells", "5,6"], "--cells does not go with"),
        ([*FEW, "--resume", "a.npz"], "--resume does not go with"),
        ([*FEW, "--agent", "max-min"], "--agent max-min looks for one solution"),
        ([*FEW, "--param", "epsilon=5"], "epsilon must lie in [0, 1], got 5"),
        ([*FEW, "--state", "a"], "--state names columns of --from-data"),
        (["train", PENDULUM, "--restart-after", "9"], "belongs to --interactions"),
        (["train", PENDULUM, "--circular", "0"], "belongs to --interactions"),
        ([*FEW, "--circular", "0,"], "--circular must be names of variables"),
        ([*DATA, "no.npz"], "no.npz"),
        ([*DATA, "no.csv", "--state", "a,b"], "needs --input"),
        ([*DATA, "no.csv", "--state", "a,", "--input", "u"], "--state must be names"),
        ([*DATA, "no.npz", "--reward", "r"], "--reward names columns of --from-data"),
        ([*FEW, "--terminated", "e"], "--terminated names columns of --from-data"),
        ([*DATA, "no.csv", "--state", "a", "--input", "u", "--terminated", "e"],
         "--terminated needs --run"),
        ([*DATA, "no.csv", "--state", "a", "--input", "u"], "there is no file no.csv"),
        (["train", "Taxi-v4", "--interactions", "9"], "Box of one axis"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_one_line(
    arguments: list[str], message: str
) -> None:
    assert message in refused(2, *arguments)
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"state": "theta"}, "must have 2 variables and 1 inputs"),
        ({"input": "v"}, "must have a column 'v'"),
        ({"time": "theta"}, "must increase"),
    ],
)
def test_data_of_another_plant(
    change: dict[str, str], message: str, table: Path
) -> None:
    columns = {"state": "theta,omega", "input": "u", **change}
    options = [word for name, value in columns.items() for word in (f"--{name}", value)]
    assert message in refused(2, *DATA, str(table), *options)


def test_another_sampling_time(table: Path) -> None:
    slow = pd.read_csv(table)
    slow["t"] *= 2
    slow.to_csv("slow.csv", index=False)
    columns = ["--state", "theta,omega", "--input", "u", "--time", "t"]
    said = refused(2, *DATA, "slow.csv", *columns)
    assert "sampling time of 0.1 s, as the environment has, got 0.2 s" in said


def test_too_few_steps() -> None:
    shown: Any = invoke("train", PENDULUM, "--interactions", "3")
    assert shown.exit_code == 2
    assert "interactions must be 5 or more to learn from, got 3" in shown.stderr


def test_help_has_an_example_of_each() -> None:
    words = " ".join(invoke("train", "--help").stdout.split())
    assert "acl-gym train acl_gym/Pendulum-v0 --interactions 200" in words
    assert "--from-data recorded.npz" in words
