"""Verdicts follow from figures: wins, loses, no difference, or too few runs."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from acl_gym.reproduction.catalogue import BY_NAME
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.versus import findings
from acl_gym.reproduction.versus.findings import duel, reached


def run(cost: float, steps: float = 1_000.0, **more: Any) -> dict[str, Any]:
    rows = {
        "env_steps": [steps / 2, steps],
        "seconds": [0.5, 1.0],
        "policy_cost": [2 * cost, cost],
        "success_rate": [0.5, 1.0],
    }
    return {"rows": rows, "seconds": 1.0, "levels": np.zeros(6), "failure": "", **more}


def test_the_verdict_is_that_of_the_interval() -> None:
    rng = np.random.default_rng(0)
    low, high = rng.normal(10, 1, 30), rng.normal(20, 1, 30)
    found = duel("here", "cost", "DQN", low, high)
    assert found.verdict == "wins"
    assert str(found).startswith("here: cost: ACL wins against DQN, 0.4")
    found = duel("", "cost", "DQN", high, low)
    assert (found.verdict, found.as_json()["value"] > 1.8) == ("loses", True)
    assert str(found).startswith("cost: ACL loses to DQN, ")
    assert duel("", "c", "DQN", low, rng.normal(10, 1, 30)).verdict == "no difference"
    assert duel("", "c", "DQN", low, low * (1 + 1e-9)).verdict == "no difference"
    assert duel("", "c", "DQN", low[:4], high[:4]).verdict == "undecided"


def test_what_is_never_reached_is_lost_to_what_is() -> None:
    never, soon = np.full(10, math.inf), np.arange(1.0, 11.0)
    lost = duel("", "steps", "DQN", never, soon)
    assert lost.verdict == "loses"
    assert str(lost) == "steps: ACL loses to DQN."
    assert duel("", "steps", "DQN", soon, never).verdict == "wins"
    both = duel("", "steps", "DQN", never, never)
    assert both.verdict == "neither"
    assert str(both) == "steps: neither ACL nor DQN gets there in most runs."
    for each in (lost, both):
        json.dumps(each.as_json(), allow_nan=False)


def test_when_a_mark_was_reached() -> None:
    assert reached(run(5.0), 5.0, "env_steps") == 1_000.0
    assert reached(run(5.0), 10.0, "seconds") == 0.5
    assert reached(run(5.0), 4.9, "seconds") == math.inf


def made_up(name: str, cost: Any, runs: int = 10) -> Evidence:
    """Runs of an experiment whose last costs are those of a function of the setting."""
    return Evidence(
        {
            study.setting.key: [run(cost(study.setting, n)) for n in range(runs)]
            for study in BY_NAME[name].studies
        }
    )


COSTS = {"acl": 12.0, "q": 11.0, "q-lambda": 13.0, "dqn": 12.0}


def cost_of(setting: Any, n: int) -> float:
    return COSTS.get(getattr(setting, "method", ""), 10.0) + 0.01 * n


def test_a_system() -> None:
    found = findings.system(
        BY_NAME["versus-pendulum"], made_up("versus-pendulum", cost_of)
    )
    assert [row[0] for row in found["rows"]] == ["ACL", "Q-learning", "Q(λ)", "DQN"]
    last = {
        each["rival"]: each["verdict"]
        for each in found["duels"]
        if each["measure"] == "cost of the last policy"
    }
    assert last == {"Q-learning": "loses", "Q(λ)": "wins", "DQN": "no difference"}
    assert found["sentences"][0] == "J* = 10."
    table = dict(zip(found["headings"], found["rows"][0], strict=True))
    assert table["Interactions to 25%"] == "1,000"
    assert table["Interactions to 10%"] == "– (0 of 10)"
    assert table["Range"] == "12 to 12.09"


def test_the_overview() -> None:
    found = findings.overview(BY_NAME["versus"], made_up("versus", cost_of))
    assert [row[0] for row in found["rows"]] == list(BY_NAME["versus"].options["rows"])
    count = "Of 12 duels of ACL: 4 won, 4 without a difference, 4 lost."
    assert found["sentences"][1].startswith("interactions to within 25% of the best")
    assert found["sentences"][0] == f"cost of the last policy: {count}"
    assert len(found["duels"]) == 12 * 5
    json.dumps(found, allow_nan=False)


@pytest.mark.parametrize("name", ["cells", "noise", "partial", "wholes", "slots"])
def test_several_arenas(name: str) -> None:
    experiment = BY_NAME[f"versus-{name}"]
    kind = findings.FINDINGS[experiment.findings]
    found = kind(experiment, made_up(f"versus-{name}", cost_of))
    rows = experiment.options["rows"]
    assert [row[0] for row in found["rows"]] == list(rows)
    assert all(len(row) == len(found["headings"]) for row in found["rows"])
    names = ["ACL"] + ["ACL with 4 times the interactions"] * (name != "slots")
    for each in names:
        count = (
            f"Of {2 * len(rows)} duels of {each}: {len(rows)} won, {len(rows)} lost."
        )
        assert count in found["sentences"]
    assert len(found["duels"]) == 2 * len(rows) * len(names)
    json.dumps(found, allow_nan=False)


def test_orders() -> None:
    def cost(setting: Any, n: int) -> float:
        return 10.0 + (setting.method == "q") * setting.backwards

    evidence = made_up("versus-order", cost)
    experiment = BY_NAME["versus-order"]
    back = experiment.options["pairs"]["Q-learning"][1]
    for each in evidence.runs(back)[:4]:
        each["levels"] = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 0.0])
    found = findings.order(experiment, evidence)
    table = {row[0]: row[1:] for row in found["rows"]}
    assert table["ACL"] == ["10 of 10", "0%", "0% (at most 0%)"]
    assert table["Q-learning"][0] == "6 of 10"
    assert table["Q-learning"][2] == "10% (at most 10%)"
