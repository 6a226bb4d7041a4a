"""The ant algorithms of chapter 2 on the command line."""

import json
from pathlib import Path
from typing import Any

import pytest

from acl_gym.cli.settings import agent_with
from acl_gym.envs.graph import load_instance
from tests.cli.runner import invoke

SALESMAN = "acl_gym/TravellingSalesman-v0"
AGENTS = ["ant-system", "ant-colony-system", "max-min"]


def figures(*arguments: str) -> dict[str, Any]:
    shown = invoke(*arguments, "--json")
    assert shown.exit_code == 0, shown.output
    found: dict[str, Any] = json.loads(shown.stdout)
    return found


@pytest.mark.parametrize("agent", AGENTS)
def test_a_tour_is_found_kept_and_improved(agent: str, tmp_path: Path) -> None:
    """The nearest-neighbour tour of eil51 from city 0 is 511 long, a random one 1,600."""
    file = str(tmp_path / "tour.npz")
    begin = figures(
        *("train", SALESMAN, "--agent", agent, "--env-arg", "instance=eil51"),
        *("--trials", "15", "--out", file),
    )
    assert begin["agent"] == agent
    assert begin["ants"] == (10 if agent == "ant-colony-system" else 51)
    found = begin["solution"]
    assert found["cost"] == min(r["trial_best_cost"] for r in begin["rows"])
    assert 426 <= found["cost"] < 800
    assert found["steps"] == 51
    assert load_instance("eil51").length(found["tour"]) == found["cost"]
    assert "best_cost" not in begin  # beside `best`, which is of the policies
    more = figures("train", "--resume", file, "--trials", "5")
    assert more["trials"] == 20
    assert more["solution"]["cost"] <= found["cost"]
    evaluated = figures("evaluate", file)
    assert evaluated["policy_cost"] == more["policy_cost"]
    assert evaluated["solution"] == more["solution"]


def test_the_best_solution_is_printed(tmp_path: Path) -> None:
    shown = invoke(
        *("train", SALESMAN, "--agent", "ant-system", "--trials", "2", "--ants", "4"),
        *("--param", "local_search=3-opt", "--out", str(tmp_path / "tour.npz")),
    )
    assert shown.exit_code == 0, shown.output
    said = "The best solution of all ants: 48 steps, a cost of 10"
    assert said in shown.stdout
    assert shown.stdout.endswith(", ... and 36 more (--json gives all)\n")
    again = invoke("evaluate", str(tmp_path / "tour.npz"))
    assert shown.stdout[shown.stdout.index(said) :] in again.stdout


def test_a_short_tour_is_printed_as_a_whole(tmp_path: Path) -> None:
    shown = invoke(
        *("train", SALESMAN, "--agent", "max-min", "--trials", "1"),
        *("--env-arg", "distances=[[0,1,9],[9,0,1],[1,9,0]]"),
        *("--env-arg", "start=0", "--out", str(tmp_path / "tour.npz")),
    )
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.endswith("a cost of 3.\nIts tour: 0, 1, 2\n")


NOTE = (
    "note: --agent {} learns a policy that does not see where it has been; --agent max"
)


def test_a_word_where_nobody_has_chosen_the_ants(tmp_path: Path) -> None:
    train = ["train", SALESMAN, "--env-arg", "instance=eil51", "--trials", "1"]
    train += ["--out", str(tmp_path / "tour.npz")]
    assert NOTE.format("returning") in invoke(*train).stderr
    chosen = invoke(*train, "--agent", "returning")
    assert chosen.exit_code == 0, chosen.output
    assert "where it has been" not in chosen.stderr
    assert "where it has been" not in invoke(*train, "--json").stderr


@pytest.mark.parametrize("agent", AGENTS)
def test_a_finite_space_of_another_package(agent: str, tmp_path: Path) -> None:
    found = figures(
        *("train", "CliffWalking-v1", "--agent", agent, "--trials", "8"),
        *("--ants", "40", "--max-steps", "200", "--param", "tabu=true"),
        *("--out", str(tmp_path / "cliff.npz")),
    )
    assert found["ants"] == 40
    assert found["solution"]["cost"] >= 13
    assert set(found["solution"]) == {"cost", "steps"}


@pytest.mark.parametrize("agent", AGENTS)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["acl_gym/Pendulum-v0"], "needs states that are cells, such as Discrete(48), "
         "but acl_gym/Pendulum-v0 has Box"),
        (["CartPole-v1"], "take --agent returning or --agent acl"),
        (["Pendulum-v1"], "Pendulum-v1 must have Discrete actions"),
        ([SALESMAN, "--param", "deposit=rank:5"], "deposit must say of each solution"),
        ([SALESMAN, "--param", "candidates=0"], "candidates must be at least 1"),
        ([SALESMAN, "--param", "local_search=4-opt"], "local_search must be one of"),
        ([SALESMAN, "--env-arg", "instance=att49"], "Did you mean 'att48'?"),
        ([SALESMAN, "--param", "epsilon=0.1"], "--param has no 'epsilon'"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(
    agent: str, arguments: list[str], message: str
) -> None:
    shown = invoke("train", *arguments, "--agent", agent, "--trials", "1")
    assert shown.exit_code == 2
    assert message in shown.stderr
    assert len(shown.stderr.strip().splitlines()) == 1


def test_rewards_that_are_no_costs_ask_for_another_deposit() -> None:
    arguments = ["train", "FrozenLake-v1", "--agent", "ant-system", "--trials", "2"]
    shown = invoke(*arguments, "--out", "lake.npz")
    assert shown.exit_code == 1
    assert "Add --param deposit=return if rewards are never negative." in shown.stderr
    assert "rank" not in shown.stderr
    shown = invoke(*arguments, "--out", "lake.npz", "--param", "deposit=return")
    assert shown.exit_code == 0, shown.output


def test_states_on_a_scale_may_be_made_cells(tmp_path: Path) -> None:
    found = figures(
        *("train", "acl_gym/Navigation-v0", "--agent", "ant-system", "--trials", "1"),
        *("--partition", "crisp", "--ants", "20", "--out", str(tmp_path / "n.npz")),
    )
    assert found["agent"] == "ant-system"


def test_what_is_fixed_cannot_be_changed_and_what_is_not_can(tmp_path: Path) -> None:
    file = str(tmp_path / "tour.npz")
    figures("train", SALESMAN, "--agent", "max-min", "--trials", "1", "--out", file)
    changed = figures(
        *("train", "--resume", file, "--trials", "1", "--param", "patience=7")
    )
    assert changed["parameters"]["patience"] == 7
    shown = invoke("train", "--resume", file, "--param", "tau0=0.5")
    assert shown.exit_code == 2
    assert "tau0" in shown.stderr
    assert "fixed once" in shown.stderr
    shown = invoke("train", "--resume", file, "--param", "deposit=return")
    assert "deposit" in shown.stderr
    assert shown.exit_code == 2


@pytest.mark.parametrize(
    ("texts", "agent"),
    [
        (["elitists=3"], "ant-system"),
        (["q0=0.9", "deposit=return"], "ant-colony-system"),
        (["p_best=none"], "max-min"),
        (["deposit=return"], "acl"),
    ],
)
def test_parameters_that_only_they_have_choose_them(
    texts: list[str], agent: str
) -> None:
    assert agent_with("--param", texts) == agent


def test_help_lists_their_parameters() -> None:
    shown = invoke("train", "--help")
    for agent in AGENTS:
        assert f"Parameters of --agent {agent} with their defaults:" in shown.stdout
    assert "Exponent of the heuristic variables (2.2), >= 0" in " ".join(
        shown.stdout.split()
    )
    assert "Probability to exploit" in shown.stdout
