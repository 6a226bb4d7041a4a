"""The command line: what it prints, what it saves, how it fails."""

from __future__ import annotations

import csv
import inspect
import json
import os
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import acl_gym
from acl_gym import (
    ACL,
    Crisp,
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    ReturningACL,
    evaluate_policy_cost,
)
from acl_gym.cli.agents import AGENTS
from acl_gym.cli.agents import parameters as declared
from acl_gym.cli.envs import describe, parameters
from acl_gym.cli.errors import BadArgumentError
from acl_gym.cli.settings import agent_with, parse_settings
from acl_gym.envs import ENVIRONMENTS
from acl_gym.envs.pendulum import Pendulum
from acl_gym.utils.parameters import parameters_of
from tests.cli.runner import (
    COMMANDS,
    MODULE,
    PENDULUM,
    ROOT,
    SMALL,
    figures,
    invoke,
    refused,
    run,
)

# --- help ----------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_teaches(command: str) -> None:
    result = invoke(command, "--help")
    assert result.exit_code == 0
    assert "Examples:" in result.stdout
    assert f"acl-gym {command}" in result.stdout
    for option in ("--json", "--debug"):
        assert option in result.stdout
    assert ("--seed" in result.stdout) is (command != "report")


def test_help_and_version() -> None:
    bare, asked = invoke(), invoke("--help")
    assert bare.stdout.strip() == asked.stdout.strip()
    assert (bare.exit_code, asked.exit_code) == (2, 0)
    assert "Examples:" in asked.stdout
    assert all(f"\n  {command} " in asked.stdout for command in COMMANDS)
    assert "..." not in asked.stdout.partition("Commands:")[2]
    assert invoke("--version").stdout.startswith("acl-gym 0.")


def test_help_of_compare_lists_what_there_is() -> None:
    from acl_gym.experiments.comparison.tasks import BY_ENV_ID, SYSTEMS
    from acl_gym.experiments.names import PRESETS

    text = invoke("compare", "--help").stdout
    for name in (*SYSTEMS["pendulum"].agents, *PRESETS, *BY_ENV_ID):
        assert f"  {name}" in text


def test_help_and_list_import_nothing_heavy() -> None:
    code = """
import sys
from acl_gym.cli.app import app
for arguments in ["--help"], ["train", "--help"], ["evaluate", "--help"], ["envs"]:
    try:
        app(arguments, prog_name="acl-gym")
    except SystemExit as end:
        assert end.code == 0, end.code
    heavy = {"torch", "numba", "matplotlib", "stable_baselines3"} & set(sys.modules)
    assert not heavy, (arguments, heavy)
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


@pytest.mark.parametrize(
    "agent", [name for name, kind in AGENTS.items() if not kind.seeks_best]
)
@pytest.mark.parametrize("ants", ["10", "100"])
def test_a_file_evaluates_to_what_training_ended_with(
    agent: str, ants: str, tmp_path: Path
) -> None:
    out = str(tmp_path / "x.npz")
    arguments = [*SMALL, "--agent", agent, "--ants", ants, "--out", out]
    trained = figures(*arguments, "--max-steps", "60")
    assert {path.name for path in tmp_path.iterdir()} == {"x.npz", "x-best.npz"}
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
    assert lines[4].startswith("Saved Pendulum-v0.npz. To evaluate it again: acl-gym")
    best = min(
        (row for row in rows if "policy_cost" in row), key=lambda r: r["policy_cost"]
    )
    assert lines[5] == (
        f"The best policy, after trial {best['trial']} with a cost of "
        f"{best['policy_cost']:.4f}: Pendulum-v0-best.npz"
    )


def test_quiet_prints_nothing() -> None:
    result = invoke(*SMALL, "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_partitions_and_cells() -> None:
    kinds = {"auto": "Fuzzy(6 x 7", "fuzzy": "Fuzzy(6 x 7", "crisp": "Crisp(6 x 7"}
    for kind, start in kinds.items():
        found = figures(*SMALL, "--partition", kind, "--trials", "1")
        assert found["partition"].startswith(start)
        assert "circular=[0]" in found["partition"]
    few = ["train", PENDULUM, "--ants", "2", "--trials", "1"]
    for agent, cells in (("acl", "40 x 41"), ("returning", "10 x 9")):
        default = figures(*few, "--agent", agent)
        assert default["partition"] == f"Fuzzy({cells} cells, circular=[0])"
    one = figures(*SMALL, "--cells", "5", "--trials", "1")
    assert one["partition"] == "Fuzzy(5 x 5 cells, circular=[0])"


def test_threads_are_set_and_change_nothing() -> None:
    results = []
    for threads in range(min(2, os.cpu_count() or 1), 0, -1):
        found = figures(*SMALL, "--threads", str(threads))
        assert acl_gym.get_num_threads() == threads
        results.append((found["policy_cost"], found["env_steps"]))
    assert len(set(results)) == 1
    assert "at most" in refused(2, *SMALL, "--threads", "9999")


@pytest.mark.parametrize(
    ("env_id", "partition"),
    [
        ("acl_gym/GridSearch1D-v0", "Discrete"),
        ("CartPole-v1", "Fuzzy(7 x 7 x 7 x 7 cells"),
        ("FrozenLake-v1", "Discrete"),
    ],
)
def test_any_environment_gets_a_partition(env_id: str, partition: str) -> None:
    arguments = ["train", env_id, "--ants", "5", "--trials", "2", "--max-steps", "20"]
    found = figures(*arguments, "--agent", "q-learning")
    assert found["partition"].startswith(partition)


def test_an_environment_of_a_module_in_this_folder(tmp_path: Path) -> None:
    """It is random, so evaluations share their random numbers; it has its own T."""
    (tmp_path / "my_corridor.py").write_text(MODULE)
    arguments = ["train", "my_corridor:Corridor-v0", "--ants", "10", "--cells", "11"]
    arguments += ["--trials", "4", "--param", "tau0=0.001", "--env-arg", "slip=0.2"]
    done = run(*arguments, "--out", "c.npz", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    trained = json.loads(done.stdout)
    assert trained["parameters"]["max_steps"] == 80
    refused = run("evaluate", "c.npz", "--json", cwd=tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "add --env-id my_corridor:Corridor-v0" in refused.stderr
    again = run(
        *("evaluate", "c.npz", "--json", "--env", "my_corridor:Corridor-v0"),
        cwd=tmp_path,
    )
    assert again.returncode == 0, again.stderr
    evaluated = json.loads(again.stdout)
    assert evaluated["policy_cost"] == trained["policy_cost"]
    assert (evaluated["episodes"], evaluated["max_steps"]) == (100, 80)


def test_evaluation_options_are_followed(tmp_path: Path) -> None:
    out = str(tmp_path / "x.npz")
    figures(*SMALL, "--out", out)
    found = figures("evaluate", out, "--episodes", "7", "--seed", "3")
    assert (found["episodes"], found["seed"]) == (7, 3)
    states = Pendulum().sample_states(np.random.default_rng(3), 7).T
    env = gym.make_vec(PENDULUM, num_envs=7)
    expected = evaluate_policy_cost(ACL.load(out), env, states)
    assert found["policy_cost"] == expected.cost
    assert found["mean_length"] == expected.lengths.mean()
    assert figures("evaluate", out, "--episodes", "7", "--seed", "4") != found
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
            assert row[head], f"the docstring of {row['id']} lacks {head}"


@pytest.mark.parametrize("env_id", list(ENVIRONMENTS))
def test_every_parameter_is_explained(env_id: str) -> None:
    found = figures("envs", env_id)
    assert found["parameters"]
    for each in found["parameters"]:
        assert each["meaning"], f"{env_id}: no meaning given for {each['name']}"
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


@pytest.mark.usefixtures("short_runs")
def test_compare_prints_results_as_json(tmp_path: Path) -> None:
    out = tmp_path / "results"
    arguments = ["compare", "--preset", "smoke", "--agents", "q-crisp", "--seeds", "2"]
    arguments += ["--seed", "5", "--workers", "1", "--out", str(out)]
    results = figures(*arguments)
    assert results == json.loads((out / "results.json").read_text())
    assert {row["seed"] for row in results["rows"]} == {5, 6}
    command = (
        f"acl-gym compare --env {PENDULUM} --preset smoke --agents q-crisp --seeds 2"
    )
    assert f"{command} --seed 5" in (out / "report.html").read_text()


# --- the parts -----------------------------------------------------------------


def test_values_are_json_where_they_are() -> None:
    texts = ["a=1", "b=0.5", "c=true", "d=[1, 2]", "e=word", "f=", "g=x=y", 'h="1"']
    assert parse_settings("--param", texts) == {
        **{"a": 1, "b": 0.5, "c": True, "d": [1, 2], "e": "word", "f": "", "g": "x=y"},
        "h": "1",
    }


def test_the_default_is_the_returning_colony() -> None:
    found = figures("train", PENDULUM, "--trials", "2", "--max-steps", "30")
    assert (found["agent"], found["ants"]) == ("returning", 5)
    agent = ReturningACL(gym.make_vec(PENDULUM, num_envs=5), max_steps=30, seed=0)
    agent.learn(trials=2)
    loaded = ReturningACL.load(found["file"])
    assert loaded.table.tobytes() == agent.table.tobytes()
    other = figures("train", PENDULUM, "--agent", "acl", "--trials", "1")
    assert (other["agent"], other["ants"]) == ("acl", 250)


@pytest.mark.parametrize(
    ("texts", "agent"),
    [
        ([], "returning"),
        (["epsilon=0.3"], "returning"),
        (["schedule=asynchronous"], "returning"),
        (["deposit=rank:5"], "acl"),
        (["epsilon=0.3", "tabu=true"], "acl"),
        (["epsilon=linear:0.3:0.01:50"], "acl"),
        (["schedule=asynchronous", "deposit=rank:5"], "acl"),
        (["epsilon=0.3", "trace_decay=0.5"], "q-learning"),
    ],
)
def test_parameters_choose_the_agent(texts: list[str], agent: str) -> None:
    assert agent_with("--param", texts) == agent


def test_parameters_that_no_agent_takes_together() -> None:
    with pytest.raises(BadArgumentError, match="no agent takes all of tabu, replay"):
        agent_with("--param", ["tabu=true", "replay=5"])
    with pytest.raises(BadArgumentError, match="Did you mean 'trace_decay'"):
        agent_with("--param", ["trace_decy=0.5"])


def test_an_agent_that_parameters_have_chosen_is_named() -> None:
    shown = invoke(*SMALL[:-2], "--param", "selection=boltzmann")
    assert shown.exit_code == 0, shown.output
    assert "note: these parameters are those of --agent acl." in shown.stderr
    shown = invoke(*SMALL[:-2], "--param", "epsilon=0.3")
    assert "note:" not in shown.stderr


@pytest.mark.parametrize("agent", list(AGENTS))
def test_every_parameter_in_a_file_can_be_set(agent: str) -> None:
    """What an agent saves is what `--param` takes, less options, arrays and functions."""
    kind = AGENTS[agent].load()
    grid = Crisp([[0.0, 1.0]])
    saved = set(kind(None, grid, n_actions=2).parameters())
    saved -= {"max_steps", "seed", "heuristic", "initial"}
    assert saved == set(declared(agent))
    signature = inspect.signature(kind).parameters
    for name, each in declared(agent).items():
        assert each.default == signature[name].default
        if name in parameters_of(kind):
            number = parameters_of(kind)[name]
            assert (each.range, each.scheduled) == (
                number.range.in_words(),
                number.scheduled,
            )
