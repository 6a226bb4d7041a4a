"""The command line: what it prints, what it saves, how it fails."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from typer.testing import CliRunner

from acl_gym import ACL, Crisp, Fuzzy, PolicyEvaluation, QLearning, evaluate_policy_cost
from acl_gym.cli.app import app
from acl_gym.cli.common import AGENTS, parse_settings
from acl_gym.cli.envs import describe, parameters
from acl_gym.cli.train import agent_class, parameter_names
from acl_gym.envs.pendulum import Pendulum
from acl_gym.registration import ENVIRONMENTS

ROOT = Path(__file__).resolve().parents[1]
PENDULUM = "acl_gym/Pendulum-v0"
SMALL = ["train", PENDULUM, "--ants", "10", "--cells", "6,7", "--trials", "5"]
SMALL += ["--evaluate-every", "2"]
COMMANDS = ("train", "evaluate", "envs", "compare")


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), prog_name="acl-gym")


def figures(*arguments: str) -> Any:
    result = invoke(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """In a new interpreter, in another folder."""
    return subprocess.run(
        [sys.executable, "-m", "acl_gym", *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def refused(code: int, *arguments: str) -> str:
    """The one line of an invocation that fails."""
    result = invoke(*arguments)
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("acl-gym: ")
    return str(lines[0])


# --- help ----------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_teaches(command: str) -> None:
    result = invoke(command, "--help")
    assert result.exit_code == 0
    assert "Examples:" in result.stdout
    assert f"acl-gym {command}" in result.stdout
    for option in ("--seed", "--json", "--debug"):
        assert option in result.stdout


def test_help_and_version() -> None:
    bare, asked = invoke(), invoke("--help")
    assert bare.stdout.strip() == asked.stdout.strip()
    assert (bare.exit_code, asked.exit_code) == (2, 0)
    assert "Examples:" in asked.stdout
    assert all(f"\n  {command} " in asked.stdout for command in COMMANDS)
    assert "..." not in asked.stdout.partition("Commands:")[2]
    assert invoke("--version").stdout.startswith("acl-gym 0.")


def test_help_of_compare_lists_what_there_is() -> None:
    from acl_gym.experiments import comparison
    from acl_gym.experiments.contestants import CONTESTANTS, PRESETS

    text = invoke("compare", "--help").stdout
    for name in (*CONTESTANTS, *PRESETS, *comparison.ENVIRONMENTS):
        assert f"  {name}" in text


@pytest.mark.parametrize(
    "arguments", [["--help"], ["train", "--help"], ["evaluate", "--help"], ["envs"]]
)
def test_help_and_list_import_nothing_heavy(arguments: list[str]) -> None:
    code = f"""
import sys
from acl_gym.cli.app import app
try:
    app({arguments!r}, prog_name="acl-gym")
except SystemExit as end:
    assert end.code == 0, end.code
heavy = {{"torch", "numba", "matplotlib", "stable_baselines3"}} & set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr


def test_importing_the_package_does_not_import_the_command_line() -> None:
    code = "import sys, acl_gym; print({'typer', 'rich', 'torch'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    assert done.stdout.strip() == "set()"


def test_the_entry_point_is_there() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    module, _, name = project["scripts"]["acl-gym"].partition(":")
    assert callable(getattr(import_module(module), name))


# --- train and evaluate --------------------------------------------------------


@pytest.mark.parametrize("agent", list(AGENTS))
@pytest.mark.parametrize("ants", ["10", "100"])
def test_a_file_evaluates_to_what_training_ended_with(
    agent: str, ants: str, tmp_path: Path
) -> None:
    out = str(tmp_path / "x.npz")
    arguments = [*SMALL, "--agent", agent, "--ants", ants, "--out", out]
    trained = figures(*arguments, "--max-steps", "60")
    assert [path.name for path in tmp_path.iterdir()] == ["x.npz"]
    assert trained["file"] == out
    assert trained["policy_cost"] == trained["rows"][-1]["policy_cost"]
    evaluated = figures("evaluate", out)
    for name in ("policy_cost", "success_rate"):
        assert evaluated[name] == trained[name]
    assert evaluated["episodes"] == 100
    assert evaluated["max_steps"] == 60
    assert evaluated["cost_min"] <= evaluated["cost_median"] <= evaluated["cost_max"]
    table = invoke("evaluate", out).stdout
    assert f"{trained['policy_cost']:.4f}" in table


def test_it_trains_what_python_trains(tmp_path: Path) -> None:
    trained = figures(
        *SMALL,
        *("--seed", "4", "--param", "epsilon=0.3", "--param", "selection=boltzmann"),
        *("--env-arg", "torques=[-1, 0, 0.5, 1]", "--max-steps", "50"),
        *("--out", str(tmp_path / "x"), "--log", str(tmp_path / "x.csv")),
        *("--tensorboard", str(tmp_path / "board")),
    )
    assert len(list((tmp_path / "board").iterdir())) == 1
    env = gym.make_vec(PENDULUM, num_envs=10, torques=[-1, 0, 0.5, 1])
    grid = Fuzzy.from_box(env.single_observation_space, (6, 7), circular=[0])
    agent = ACL(env, grid, epsilon=0.3, selection="boltzmann", max_steps=50, seed=4)
    agent.learn(trials=5, callback=PolicyEvaluation(env, every=2, max_steps=50))
    loaded = ACL.load(tmp_path / "x.npz")
    assert loaded.table.tobytes() == agent.table.tobytes()
    assert loaded.parameters() == agent.parameters() == trained["parameters"]
    assert trained["env_args"] == {"torques": [-1, 0, 0.5, 1]}
    assert trained["rows"] == loaded.history
    assert [row.get("policy_cost") for row in trained["rows"]] == [
        row.get("policy_cost") for row in agent.history
    ]
    with (tmp_path / "x.csv").open() as file:
        log = list(csv.DictReader(file))
    assert [float(row["seconds"]) for row in log] == [
        row["seconds"] for row in trained["rows"]
    ]


def test_the_table_has_the_evaluated_rows_and_the_last() -> None:
    shown = invoke(*SMALL)
    assert shown.exit_code == 0
    rows = figures(*SMALL)["rows"]
    lines = shown.stdout.splitlines()
    assert lines[0].split()[:3] == ["trial", "steps", "seconds"]
    assert [line.split()[0] for line in lines[1:4]] == ["2", "4", "5"]
    assert f"{rows[-1]['policy_cost']:.4f}" in lines[3]
    assert "not saved" in lines[4]


def test_quiet_prints_nothing() -> None:
    result = invoke(*SMALL, "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_partitions_and_cells() -> None:
    kinds = {"auto": "Fuzzy(6 x 7", "fuzzy": "Fuzzy(6 x 7", "crisp": "Crisp(6 x 7"}
    for kind, start in kinds.items():
        found = figures(*SMALL, "--partition", kind, "--trials", "1")
        assert found["partition"].startswith(start)
        assert "circular=[0]" in found["partition"]
    whole = figures("train", PENDULUM, "--ants", "2", "--trials", "1")
    assert whole["partition"] == "Fuzzy(40 x 41 cells, circular=[0])"
    one = figures(*SMALL, "--cells", "5", "--trials", "1")
    assert one["partition"] == "Fuzzy(5 x 5 cells, circular=[0])"


MODULE = """
import gymnasium as gym, numpy as np

class Corridor(gym.Env):
    observation_space = gym.spaces.Box(0.0, 2.0, (1,), np.float64)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, slip=0.0, render_mode=None):
        self.slip = slip

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = self.np_random.uniform(0.0, 1.8)
        return np.array([self.x]), {}

    def step(self, action):
        slips = self.np_random.random() < self.slip
        move = 0.1 if (action == 1) != slips else -0.1
        self.x = float(np.clip(self.x + move, 0.0, 2.0))
        return np.array([self.x]), -1.0, self.x >= 1.95, False, {}

gym.register("Corridor-v0", entry_point=Corridor, max_episode_steps=80)
"""


def test_an_environment_of_a_module_in_this_folder(tmp_path: Path) -> None:
    """Random, and so evaluated with the same luck; its own T."""
    (tmp_path / "my_corridor.py").write_text(MODULE)
    arguments = ["train", "my_corridor:Corridor-v0", "--ants", "10", "--cells", "11"]
    arguments += ["--trials", "4", "--param", "tau0=0.001", "--env-arg", "slip=0.2"]
    done = run(*arguments, "--out", "c.npz", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    trained = json.loads(done.stdout)
    assert trained["parameters"]["max_steps"] == 80
    again = run("evaluate", "c.npz", "--json", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    evaluated = json.loads(again.stdout)
    assert evaluated["policy_cost"] == trained["policy_cost"]
    assert (evaluated["episodes"], evaluated["max_steps"]) == (100, 80)


def test_evaluation_as_told(tmp_path: Path) -> None:
    out = str(tmp_path / "x.npz")
    figures(*SMALL, "--out", out)
    told = figures("evaluate", out, "--episodes", "7", "--seed", "3")
    assert (told["episodes"], told["seed"]) == (7, 3)
    states = Pendulum().sample_states(np.random.default_rng(3), 7).T
    env = gym.make_vec(PENDULUM, num_envs=7)
    expected = evaluate_policy_cost(ACL.load(out), env, states)
    assert told["policy_cost"] == expected.cost
    assert told["mean_length"] == expected.lengths.mean()
    assert figures("evaluate", out, "--episodes", "7", "--seed", "4") != told
    short = figures("evaluate", out, "--max-steps", "3")
    assert short["mean_length"] <= 3


def test_a_file_saved_from_python_needs_an_id(tmp_path: Path) -> None:
    env = gym.make_vec(PENDULUM, num_envs=3)
    grid = Crisp.from_box(env.single_observation_space, 4)
    out = str(QLearning(env, grid, seed=0).save(tmp_path / "q"))
    assert "add --env-id" in refused(2, "evaluate", out)
    found = figures("evaluate", out, "--env-id", PENDULUM)
    assert found["policy_cost"] == evaluate_policy_cost(QLearning.load(out), env).cost
    assert found["max_steps"] == 300


# --- envs ----------------------------------------------------------------------


def test_every_environment_is_listed_and_described() -> None:
    rows = figures("envs")
    assert [row["id"] for row in rows] == list(ENVIRONMENTS)
    text = invoke("envs").stdout
    for row in rows:
        assert row["id"] in text
        assert row["description"].endswith(".")
        for head in ("observation", "actions", "thesis"):
            assert row[head], f"the docstring of {row['id']} says nothing of {head}"


@pytest.mark.parametrize("env_id", list(ENVIRONMENTS))
def test_every_parameter_is_explained(env_id: str) -> None:
    found = figures("envs", env_id)
    assert found["parameters"]
    for each in found["parameters"]:
        assert each["meaning"], f"{env_id}: nothing is said of {each['name']}"
    shown = invoke("envs", env_id).stdout
    assert all(each["name"] in shown for each in found["parameters"])
    space = gym.make_vec(env_id, num_envs=1).single_observation_space
    example = np.asarray(found["example"], dtype=space.dtype)
    assert space.contains(example if example.ndim else space.dtype.type(example))


def test_parameters_are_those_of_the_system() -> None:
    by_name = {each["name"]: each for each in parameters(Pendulum)}
    assert by_name["damping"]["default"] == 0.01
    assert by_name["damping"]["meaning"] == "D, kg m^2 / s, >= 0."
    assert by_name["omega_max"]["meaning"].endswith(
        "omega is clipped to it after each step."
    )
    assert describe(PENDULUM)["thesis"] == "§5.2"
    first, other = (figures("envs", PENDULUM, "--seed", seed) for seed in "01")
    assert first["example"] != other["example"]
    assert {**first, "example": None} == {**other, "example": None}


# --- compare -------------------------------------------------------------------


def test_compare_prints_results_as_json(tmp_path: Path) -> None:
    out = tmp_path / "results"
    arguments = ["compare", "--preset", "smoke", "--agents", "q-crisp", "--seeds", "2"]
    arguments += ["--seed", "5", "--workers", "1", "--out", str(out), "--json"]
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    results = json.loads(done.stdout)
    assert results == json.loads((out / "results.json").read_text())
    assert {row["seed"] for row in results["rows"]} == {5, 6}
    assert "python -m acl_gym compare" in (out / "report.html").read_text()


@pytest.mark.parametrize("argument", ["compare", "envs"])
def test_an_interrupted_command_says_what_is_kept(
    argument: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("acl_gym.experiments.comparison.compare", interrupt)
    monkeypatch.setattr("acl_gym.cli.envs.describe", interrupt)
    assert "interrupted; " in refused(130, argument)


# --- errors --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["trian"], "No such command 'trian'. Did you mean 'train'"),
        (["train"], "Missing argument 'ENV_ID'"),
        (["train", PENDULUM, "--trials", "0"], "--trials"),
        (["train", PENDULUM, "--ants", "many"], "--ants"),
        (["train", PENDULUM, "--seed", "-1"], "--seed"),
        (["train", PENDULUM, "--agent", "sarsa"], "'acl', 'q-learning'"),
        (["train", PENDULUM, "--walk"], "No such option: --walk"),
        (["train", "acl_gym/Pendulm-v0"], "Did you mean: `Pendulum`"),
        (["train", "no_such_module:X-v0"], "no_such_module"),
        (["train", "CartPole-v1"], "bounded in every variable"),
        (["train", "FrozenLake-v1"], "Box with one axis"),
        (["train", "Pendulum-v1"], "Discrete actions"),
        ([*SMALL, "--cells", "6,7,8"], "cells must be an int or 2 ints"),
        ([*SMALL, "--cells", "six"], "--cells must be whole numbers"),
        ([*SMALL, "--param", "epsilon"], "--param must be name=value, got 'epsilon'"),
        ([*SMALL, "--param", "speed=1"], "no 'speed'; there are alpha, "),
        ([*SMALL, "--param", "seed=1"], "no 'seed'"),
        ([*SMALL, "--param", "epsilon=1.5"], "epsilon must lie in [0, 1]"),
        ([*SMALL, "--param", "epsilon=high"], "epsilon must be a real number"),
        ([*SMALL, "--param", "alpha=1", "--param", "alpha=2"], "twice"),
        ([*SMALL, "--env-arg", "gravitas=1"], "there are inertia, motor_gain"),
        ([*SMALL, "--env-arg", "mass=-1"], "mass must lie in"),
        ([*SMALL, "--out", "/no/such/folder/x"], "no folder /no/such/folder"),
        ([*SMALL, "--log", "/no/such/folder/x"], "no folder /no/such/folder"),
        ([*SMALL, "--log", str(ROOT / "README.md")], "is not a log"),
        (["evaluate", "/no/such/agent"], "no agent file at /no/such/agent.npz"),
        (["evaluate", str(ROOT / "README.md")], "is not an agent saved by acl-gym"),
        (["envs", "CartPole-v1"], "no environment 'CartPole-v1'; there are"),
        (["compare", "--preset", "huge"], "invalid choice 'huge'"),
        (["compare", "--env", "CartPole-v1"], "invalid choice 'CartPole-v1'"),
        (["compare", "--agents", "sarsa"], "must be among acl-fuzzy"),
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
    arguments = ["train", "my_treat:Treat-v0", "--ants", "3", "--param", "tau0=0.001"]
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


def test_ctrl_c_is_one_line_and_130(tmp_path: Path) -> None:
    """A handler of Python's own, as in a terminal; a shell may have set to ignore it."""
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "from acl_gym.cli import main; main()"
    )
    log = tmp_path / "log.csv"
    arguments = ["train", PENDULUM, "--trials", "1000000", "--log", str(log)]
    with subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        while process.poll() is None:
            if log.exists() and log.stat().st_size > 200:
                process.send_signal(signal.SIGINT)
                break
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == ""
    assert err == "acl-gym: interrupted; what is in files already is kept.\n"


# --- the parts -----------------------------------------------------------------


def test_values_are_json_where_they_are() -> None:
    texts = ["a=1", "b=0.5", "c=true", "d=[1, 2]", "e=word", "f=", "g=x=y", 'h="1"']
    assert parse_settings("--param", texts) == {
        **{"a": 1, "b": 0.5, "c": True, "d": [1, 2], "e": "word", "f": "", "g": "x=y"},
        "h": "1",
    }


@pytest.mark.parametrize("agent", list(AGENTS))
def test_every_parameter_in_a_file_can_be_set(agent: str) -> None:
    """What an agent saves is what `--param` takes, less what has an option."""
    kind = agent_class(agent)
    grid = Crisp([[0.0, 1.0]])
    saved = set(kind(None, grid, n_actions=2).parameters()) - {"max_steps", "seed"}
    assert saved == set(parameter_names(kind))
