"""Tables and verdicts follow from figures: wins, loses, no difference, too few runs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from acl_gym.experiments.comparison import EXPERIMENTS
from acl_gym.experiments.comparison.compare import experiment_of
from acl_gym.experiments.comparison.tasks import SYSTEMS
from acl_gym.experiments.names import METHODS
from acl_gym.experiments.results import Results, Run
from acl_gym.experiments.rivals import compare
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.tables import (
    TABLES,
    Table,
    number,
    summarise,
    summary,
)

BY_NAME = {experiment.name: experiment for experiment in EXPERIMENTS}


def run(costs: list[float], seed: int = 0, every: float = 1_000.0) -> Run:
    """A run that was evaluated after each second and `every` steps."""
    count = np.arange(1.0, len(costs) + 1)
    rows = pd.DataFrame(
        {
            "env_steps": every * count,
            "seconds": count,
            "policy_cost": costs,
            "success_rate": [1.0 if cost < 60 else 0.5 for cost in costs],
        }
    )
    return Run(rows, np.zeros(1), len(costs), seed=seed)


def made_up(
    experiment: Experiment, cost: Callable[[Study, int], float], runs: int = 10
) -> Results:
    """Runs whose last costs are those of a function of the study and the seed."""
    return Results(
        {
            study.key: [
                run([2 * cost(study, n), cost(study, n)], n) for n in range(runs)
            ]
            for study in experiment.everything
        }
    )


def table(name: str, cost: Callable[[Study, int], float], runs: int = 10) -> Table:
    experiment = BY_NAME[name]
    return TABLES[experiment.table](experiment, made_up(experiment, cost, runs))


def cost_of(study: Study, n: int) -> float:
    """ACL wins against Q(lambda), loses to Q-learning, and is as good as DQN.

    With replay Q-learning is as good as Q(lambda); the returning colony loses to none.
    """
    if study.method in ("planning", "returning"):
        return 10.0 + 0.01 * n * (study.method == "returning")
    q = 13.0 if study.settings.get("trace_decay", 0) else 11.0
    return (q if study.method == "q-learning" else 12.0) + 0.01 * n


VERDICTS = {"Q-learning": "loses", "Q(λ)": "wins", "Q-learning, replay": "wins"}
"""Of ACL against the methods with a table."""


def verdict(own: Any, others: Any) -> str:
    return compare("", "cost", ("ACL", "DQN"), (own, others)).verdict


def test_the_verdict_is_that_of_the_interval() -> None:
    rng = np.random.default_rng(0)
    low, high = rng.normal(10, 1, 30), rng.normal(20, 1, 30)
    found = compare("here", "cost", ("ACL", "DQN"), (high, low)).as_json()
    assert {**found, "ratio": 0, "low": 0, "high": 0} == {
        **{"where": "here", "measure": "cost", "method": "ACL", "rival": "DQN"},
        **{"verdict": "loses", "ratio": 0, "low": 0, "high": 0},
    }
    assert 1.8 < found["low"] < found["ratio"] < found["high"] < 2.2
    assert verdict(low, high) == "wins"
    assert verdict(low, rng.normal(10, 1, 30)) == "no difference"
    assert verdict(low, low * (1 + 1e-9)) == "no difference"
    assert verdict(low[:4], high[:4]) == "undecided"


def test_what_is_never_reached_is_lost_to_what_is() -> None:
    never, soon = np.full(10, math.inf), np.arange(1.0, 11.0)
    assert verdict(never, soon) == "loses"
    assert verdict(soon, never) == "wins"
    assert verdict(never, never) == "neither"
    found = compare("", "steps", ("ACL", "DQN"), (never, soon)).as_json()
    assert json.loads(json.dumps(found, allow_nan=False))["ratio"] is None


def test_a_system() -> None:
    found = table("versus-pendulum", cost_of)
    assert [row[0] for row in found.rows] == [each.label for each in METHODS.values()]
    last = {
        (each["method"], each["rival"]): each["verdict"]
        for each in found.comparisons
        if each["measure"] == "cost of the last policy"
    }
    assert last == {
        **{("ACL", rival): said for rival, said in VERDICTS.items()},
        **{("ACL", name): "no difference" for name in ("DQN", "PPO", "A2C")},
        **{
            ("Returning ACL", each.label): "wins"
            for each in METHODS.values()
            if each.label != "Returning ACL"
        },
    }
    row = dict(zip(found.headings, found.rows[0], strict=True))
    assert row["Interactions to 25%"] == "2,000"
    assert row["Interactions to 10%"] == "never (0 of 10)"
    assert row["Range"] == "12 to 12.09"
    assert row["Broke down"] == "none"
    assert "seconds to within 10% of J*" in {e["measure"] for e in found.comparisons}


def test_the_overview() -> None:
    found = table("versus", cost_of)
    assert [row[0] for row in found.rows] == list(BY_NAME["versus"].options["rows"])
    # ACL has six rivals, the returning colony ACL as well; a cost and four times.
    assert len(found.comparisons) == 4 * (6 + 7) * 5
    times = [e for e in found.comparisons if e["measure"].endswith("the reference")]
    assert len({each["measure"] for each in times}) == 4
    at_25 = [e for e in times if e["measure"].startswith("interactions to within 25%")]
    verdicts = [e["verdict"] for e in at_25 if e["method"] == "ACL"]
    assert verdicts == ["no difference", "wins", "wins", *["no difference"] * 3] * 4
    # Of ACL's rivals Q-learning alone comes within 10%, in some of its runs.
    at_10 = [e for e in times if e["measure"].startswith("interactions to within 10%")]
    assert {
        e["verdict"] for e in at_10 if (e["method"], e["rival"]) == ("ACL", "DQN")
    } == {"neither"}


@pytest.mark.parametrize(
    "name", ["cells", "noise", "partial", "episode-costs", "slots"]
)
def test_several_tasks(name: str) -> None:
    found = table(f"versus-{name}", cost_of)
    rows = BY_NAME[f"versus-{name}"].options["rows"]
    assert [row[0] for row in found.rows[: len(rows)]] == list(rows)
    assert {len(row) for row in found.rows} == {len(found.headings)}
    wanted = {("ACL", rival): said for rival, said in VERDICTS.items()}
    if name == "slots":  # where the methods that remember do not take part
        del wanted["ACL", "Q-learning, replay"]
    else:
        longer = "ACL with 4 times the interactions"
        wanted |= {(longer, rival): said for (_, rival), said in wanted.items()}
        names = ("ACL", *VERDICTS)
        wanted |= {("Returning ACL", name): "wins" for name in names}
        heading = found.headings.index("Q(λ)")
        assert "\nACL wins, 0.9" in found.rows[0][heading]
    assert {
        (each["where"], each["method"], each["rival"]): each["verdict"]
        for each in found.comparisons
    } == {(where, *pair): said for where in rows for pair, said in wanted.items()}


def test_what_the_most_slots_cost() -> None:
    found = table("versus-slots", lambda study, n: 10.0 + abs(study.slots - 100))
    assert found.rows[-1][:2] == [
        "1600 slots over the best number",
        "151 [151, 151] times that of 100 slots",
    ]


def test_orders() -> None:
    experiment = BY_NAME["versus-order"]
    runs = {}
    for label, (forth, back) in experiment.options["pairs"].items():
        n = forth.make_partition().n_cells
        same, other = np.tile([1.0, 0.0, 0.0], n), np.tile([1.0, 0.0, 0.0], n)
        other[: 3 * (n // 2)] = np.tile([0.0, 1.0, 0.0], n // 2)
        differs = label == "Q-learning"
        for study, tables, cost in (
            (forth, [same] * 10, 10.0),
            (back, [other if differs else same] * 4 + [same] * 6, 10.0 + differs),
        ):
            made = [run([cost]) for _ in tables]
            runs[study.key] = [
                Run(r.rows, t, 1.0) for r, t in zip(made, tables, strict=True)
            ]
    found = TABLES["order"](experiment, Results(runs))
    rows = {row[0]: row[1:] for row in found.rows}
    assert rows["ACL"] == ["10 of 10", "0%", "0% (at most 0%)"]
    assert rows["Q-learning"] == ["6 of 10", "0%", "10% (at most 10%)"]


def compared(
    *costs: list[float], system: str = "pendulum"
) -> tuple[Experiment, Results]:
    """One agent with runs of these costs; J* is 40."""
    experiment = experiment_of(SYSTEMS[system], "quick", ["dqn"])
    (study,) = experiment.studies.values()
    fine = next(iter(experiment.references.values()))
    own = {study.key: [run(each, n) for n, each in enumerate(costs)]}
    return experiment, Results({fine.key: [run([40.0])], **own})


def test_figures_of_the_summary_computed_by_hand() -> None:
    # Within 25% of 40 is 50, within 10% is 44.
    (entry,) = summarise(
        *compared(
            [90.0, 50.0, 44.0, 48.0], [60.0, 51.0, 43.0, 46.0], [49.0, 41, 70, 56]
        )
    )
    assert (entry["agent"], entry["label"], entry["seeds"]) == ("dqn", "DQN", 3)
    medians = {k: v["median"] for k, v in entry.items() if isinstance(v, dict)}
    assert medians == pytest.approx(
        {
            **{"final_policy_cost": 48.0, "best_policy_cost": 43.0},
            **{"final_gap_percent": 20.0, "best_gap_percent": 7.5},
            **{"final_success_rate": 1.0, "best_success_rate": 1.0},
            **{"env_steps": 4000, "seconds": 4.0},
            # First at or below 50: evaluations 2, 3, 1; at or below 44: 3, 3, 2.
            **{"env_steps_to_25": 2000, "seconds_to_25": 2.0},
            **{"env_steps_to_10": 3000, "seconds_to_10": 3.0},
        }
    )
    # Of three values the interval of the median is their range.
    cost, steps = entry["final_policy_cost"], entry["env_steps_to_25"]
    assert (cost["low"], cost["high"]) == (46.0, 56.0)
    assert (steps["low"], steps["high"], steps["reached"]) == (1000, 3000, 3)


def test_success_of_the_last_and_of_the_best_policy() -> None:
    (entry,) = summarise(*compared([90.0, 45.0, 70.0]))
    assert entry["final_success_rate"]["median"] == 0.5
    assert entry["best_success_rate"]["median"] == 1.0
    assert entry["best_policy_cost"] == {"median": 45.0, "low": None, "high": None}


def test_marks_never_reached_are_none_and_counted() -> None:
    experiment, results = compared([45.0], [90.0], [80.0])
    (entry,) = summarise(experiment, results)
    none = {"median": None, "high": None}
    assert entry["env_steps_to_25"] == {**none, "low": 1000, "reached": 1}
    assert entry["seconds_to_10"] == {**none, "low": None, "reached": 0}
    json.dumps(entry, allow_nan=False)
    shown = summary(experiment, results)
    row = dict(zip(shown.headings, shown.rows[0], strict=True))
    assert row["25%\nsteps"] == "–\n1k–never\n1 of 3"
    assert row["training\nsteps"] == "1k\n1k–1k"
    brief = summary(experiment, results, brief=True)
    row = dict(zip(brief.headings, brief.rows[0], strict=True))
    assert "training\nsteps" not in row
    assert row["last\ncost"] == "80.0\n45.0–90.0"
    assert row["25%\nsteps"] == "–\n1 of 3"
    assert row["10%\ntime s"] == "never"
    assert row["last\nabove"] == "+100%"
    assert shown.best == []  # of one method none is the best


def test_the_best_of_a_column_is_emphasised() -> None:
    agents = ["acl-crisp", "q-crisp", "q-lambda-crisp", "dqn"]
    experiment = experiment_of(SYSTEMS["row"], "quick", agents)
    costs = {"ACL": 6.0, "Q-learning": 5.0, "Q(λ)": 5.0, "DQN": 7.0}
    of_study = {study.key: costs[label] for label, study in experiment.studies.items()}
    results = made_up(experiment, lambda study, n: of_study.get(study.key, 5.0), 2)
    shown = summary(experiment, results)
    assert {row for row, column in shown.best if column == 1} == {1, 2}
    # Not those of the success, which is the same.
    assert {column for _, column in shown.best} == {1, 2, 4, 5, 7, 8, 9, 10}


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        *[("env_steps", v, t) for v, t in ((1.909e6, "1.91M"), (487_200, "487k"))],
        *[("env_steps", v, t) for v, t in ((999_600, "1M"), (900.0, "900"))],
        *[("seconds", v, t) for v, t in ((0.333, "0.33"), (4.8, "4.8"), (140, "140"))],
        *[
            ("cost", v, t)
            for v, t in ((9.99, "9.99"), (19.999, "20.0"), (1204, "1204.0"))
        ],
        *[("success_rate", v, t) for v, t in ((1.0, "100%"), (0.9962, "99.6%"))],
        *[("gap_percent", v, t) for v, t in ((-1.25, "−1.2%"), (184.2, "+184%"))],
        ("seconds_to_10", None, "never"),
    ],
)
def test_numbers(key: str, value: float | None, text: str) -> None:
    assert number(key, value) == text
