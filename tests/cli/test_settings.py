"""Values of options as text."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acl_gym.agents.q_learning import TRACES
from acl_gym.cli.agents import CHOICES, parameters
from acl_gym.cli.errors import BadArgumentError
from acl_gym.cli.settings import parse_parameters, parse_settings, parse_value
from acl_gym.colony.costs import (
    Cost,
    Overshoot,
    Quadratic,
    SettlingTime,
    Steps,
)
from acl_gym.colony.deposits import InverseCost, Rank, Return
from acl_gym.colony.schedules import Exponential, Harmonic, Linear
from acl_gym.colony.selection import RULES
from acl_gym.colony.update_rules import as_update
from tests.cli.runner import invoke


def parsed(text: str) -> Any:
    (value,) = parse_parameters("--param", [text], parameters("acl")).values()
    return value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("0.5", 0.5),
        ("1e-3", 1e-3),
        *((word, True) for word in ("true", "True", "TRUE", " true ")),
        *((word, False) for word in ("false", "False", "FALSE")),
        *((word, None) for word in ("null", "None", "none")),
        ("[1, 2]", [1, 2]),
        ("(1, 2)", [1, 2]),
        ("[True, false]", "refused"),
        ("[True, None]", [True, None]),
        ("[true, null]", [True, None]),
        ("word", "word"),
        ('"yes"', "yes"),
        ("", ""),
        ("S.#", "S.#"),
    ],
)
def test_values(text: str, value: Any) -> None:
    if value == "refused":
        with pytest.raises(BadArgumentError, match="must be a list"):
            parse_value("--env-arg x", text)
        return
    found = parse_value("--env-arg x", text)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize("word", ["yes", "No", "ON", "off", "F"])
def test_other_words_for_true_and_false_are_refused(word: str) -> None:
    """As texts all of them would count as true."""
    with pytest.raises(BadArgumentError, match="must be true or false"):
        parse_settings("--env-arg", [f"is_slippery={word}"])


@pytest.mark.parametrize(
    "text",
    ["NaN", "[Infinity]", "1e999", "[" * 30 + "]" * 30, "[" * 10**5, "{1: 2", "{1}"],
)
def test_values_that_no_file_could_hold(text: str) -> None:
    with pytest.raises(BadArgumentError):
        parse_value("--env-arg x", text)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("deposit=rank:5", Rank(5)),
        ("deposit=Rank", Rank()),
        ("deposit=return", Return()),
        ("deposit=inverse-cost:20", InverseCost(20)),
        ("epsilon=linear:0.3:0.01:50", Linear(0.3, 0.01, 50)),
        ("epsilon=linear:0.3:trials=50:end=0.01", Linear(0.3, 0.01, 50)),
        ("alpha=exponential:1:1.1", Exponential(1, 1.1)),
        ("alpha=harmonic:0.6:10", Harmonic(0.6, 10)),
        ("beta=2", 2),
        ("tabu=TRUE", True),
        ("selection=boltzmann", "boltzmann"),
        ("cost=none", None),
        ("cost=steps", Steps()),
        ("cost=settling_time:0:3.14:0.1", SettlingTime(0, 3.14, 0.1)),
        ("cost=quadratic:[0,0]:[1,1e+2]", Quadratic((0, 0), (1, 100.0))),
        (
            "cost=settling_time:0:3.14+2*overshoot:0:3.14:period=6.28+0.1",
            SettlingTime(0, 3.14) + 2.0 * Overshoot(0, 3.14, 6.28) + 0.1,
        ),
    ],
)
def test_objects(text: str, value: Any) -> None:
    assert parsed(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "deposit=rnak:5",
            r"choose from .*rank\[:EXPONENT=1\.0\]\. Did you mean 'rank'",
        ),
        ("deposit=5", "choose from inverse_cost"),
        ("deposit=rank:-1", "exponent must lie in"),
        ("deposit=rank:1:2", r"must be rank\[:EXPONENT"),
        ("deposit=rank:exponent=1:exponent=2", r"must be rank\[:EXPONENT"),
        ("deposit=rank:strength=2", r"must be rank\[:EXPONENT"),
        ("epsilon=lineer:1:0:5", "Did you mean 'linear'"),
        ("epsilon=linear:1", "must be linear:START:END:TRIALS, got 'linear:1'"),
        ("epsilon=linear:1:0:5.5", "trials must be an integer"),
        ("global_decay=linear:1:0:5", ""),
        ("cost=2", "must name a cost"),
        ("cost=x*steps", "a number before"),
        ("cost=-1*steps", "factor must lie in"),
        ("cost=quadratic:[0,0", "must close its brackets"),
        ("cost=settling", "Did you mean 'settling_time'"),
        ("tabu=1", "true or false"),
        ("selection=boltzman", "Did you mean 'boltzmann'"),
        ("epsilom=1", "Did you mean 'epsilon'"),
    ],
)
def test_what_is_wrong_is_said(text: str, message: str) -> None:
    if text.startswith("global_decay"):  # no schedule: the agent itself refuses a text
        assert parsed(text) == "linear:1:0:5"
        return
    with pytest.raises(BadArgumentError, match=message):
        parsed(text)


def test_costs_of_the_command_line_cost_what_they_say() -> None:
    cost = parsed("cost=2*steps+0.5")
    assert isinstance(cost, Cost)

    class Three:
        lengths = np.array([3, 5])

        def __len__(self) -> int:
            return 2

    assert cost(Three()).tolist() == [6.5, 10.5]  # type: ignore[arg-type]


def test_choices_are_those_that_there_are() -> None:
    assert set(CHOICES["selection"]) == set(RULES)
    assert CHOICES["traces"] == TRACES
    for name in CHOICES["update"]:
        assert as_update(name) is not None
    with pytest.raises(ValueError, match="update") as error:
        as_update("no such rule")
    assert all(repr(name) in str(error.value) for name in CHOICES["update"])
    assert str(error.value).count("'") == 2 * len(CHOICES["update"]) + 2


def test_help_lists_what_exists() -> None:
    text = invoke("train", "--help").stdout
    for each in (
        "linear:START:END:TRIALS",
        "rank[:EXPONENT=1.0]",
        "settling_time:VARIABLE:TARGET",
        "trace_decay",
        "local_decay",
        "Parameters of --agent q-learning",
    ):
        assert each in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("name", ["heuristic", "initial"])
@pytest.mark.parametrize("agent", ["acl", "returning"])
def test_what_only_arrays_and_functions_can_say_is_refused(
    agent: str, name: str
) -> None:
    with pytest.raises(BadArgumentError, match=f"has no '{name}'; choose from"):
        parse_parameters("--param", [f"{name}=1"], parameters(agent))
    assert parameters(agent)["beta"].scheduled
