"""The experiments are those of the thesis, with the parameters of its tables."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from acl_gym.experiments.study import Experiment
from acl_gym.experiments.systems import (
    grid_1d,
    grid_2d,
    navigation,
    pendulum,
    planned,
)
from acl_gym.experiments.thesis import CLAIMS, EXPERIMENTS, RUNS
from acl_gym.experiments.thesis.common import FEWER

FIGURES = [
    *("fig3.3", "fig3.4", "fig3.6", "fig3.7", "fig3.8", "fig3.9"),
    *(f"fig3.{n}" for n in range(11, 15)),
    *(f"fig4.{n}" for n in range(6, 15)),
    *(f"fig5.{n}" for n in range(2, 18)),
    *("fig6.centre", "fig6.delays", "fig6.foraging", "fig6.optimum"),
    *("fig6.order", "fig6.colony"),
]
BESIDE = {
    *("row-choices", "row-orders", "world-choices"),
    *("navigation-rules", "navigation-long"),
    *("omega-max", "local-update", "pendulum-long", "fuzzy-ants"),
}
BY_NAME = {each.name: each for each in EXPERIMENTS}


def values(name: str, parameter: str) -> list[float]:
    return [study.settings[parameter] for study in BY_NAME[name].studies.values()]


def ants(name: str) -> list[int]:
    return [study.slots for study in BY_NAME[name].studies.values()]


def test_every_figure_is_there_and_what_was_tried_beside_them() -> None:
    names = [each.name for each in EXPERIMENTS]
    assert [name for name in names if name.startswith("fig")] == FIGURES
    assert len(names) == len(set(names))
    assert set(names) == {*FIGURES, *BESIDE}
    assert RUNS == 30


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each.name)
def test_experiments_decide_or_explain_claims_that_there_are(
    experiment: Experiment[Any],
) -> None:
    known = {claim.name for claim in CLAIMS}
    assert {*experiment.claims, *experiment.explains} <= known
    assert bool(experiment.explains) == (experiment.name in BESIDE)


def test_sweeps_are_those_of_the_thesis() -> None:
    assert values("fig3.6", "global_decay") == [0, 0.1, 0.2, 0.5, 0.9, 1]
    assert values("fig3.8", "local_decay") == [0.01, 0.05, 0.1, 0.2, 0.5, 0.9]
    for name in ("fig5.2", "fig5.4"):
        assert values(name, "global_decay") == [0, 0.001, 0.01, 0.1, 0.5, 1]
        assert values(name, "local_decay") == [0.01] * 6
    for name in ("fig5.7", "fig5.9"):
        assert values(name, "local_decay") == pytest.approx(
            [0, 0.001, 0.01, 0.1, 0.5, 1], abs=1e-5
        )
        assert values(name, "global_decay") == [0.1] * 6
    for name in ("fig5.12", "fig5.14"):
        assert ants(name) == [100, 250, 500, 1000, 1500, 2000]
    assert ants("fig3.9") == [1, 5, 9]
    assert ants("fig3.14") == [17, 86, 56, 278, 128, 640]
    studies = BY_NAME["fig3.11"].studies.values()
    chances = [study.task.env["transition_probability"] for study in studies]
    assert chances == [0.5, 0.7, 0.9, 1.0]


def test_labels_say_what_is_varied() -> None:
    last = list(BY_NAME["fig5.7"].studies)[-1]
    assert last == "gamma = 1"
    assert list(BY_NAME["fig3.14"].studies)[:2] == ["11x11, 20%", "11x11, 100%"]
    assert list(BY_NAME["fig5.17"].studies)[-1] == "N = 64, M = 624"
    assert "crisp, local update once an ant, gamma = 0.1" in (
        BY_NAME["local-update"].studies
    )


@pytest.mark.parametrize(("name", "share"), [("fig5.16", 0.6), ("fig5.17", 0.15)])
def test_partitions_and_their_ants(name: str, share: float) -> None:
    """60% of the states for crisp ants, 15% for fuzzy (§5.3.4)."""
    for study, n in zip(BY_NAME[name].studies.values(), (16, 32, 64), strict=True):
        assert study.cells == (n, n + 1)
        assert study.slots == round(share * n * (n + 1))


def test_tables_4_1_and_5_2() -> None:
    study = pendulum("crisp")
    assert study.settings == {
        "tau0": 1e-4,
        "epsilon": 0.1,
        "alpha": 3.0,
        "selection": "max_boltzmann",
        "max_steps": 300,
        "global_decay": 0.1,
        "local_decay": 0.01,
    }
    assert (study.slots, study.trials, study.cells) == (250, 100, (40, 41))
    study = navigation("quadratic", "fuzzy")
    assert (study.slots, study.trials, study.cells) == (200, 200, "regular")
    assert navigation("time", "fuzzy").cells == "damping"
    assert (grid_1d().slots, grid_2d().slots) == (9, 86)


@pytest.mark.parametrize("claim", ["C11", "C12"])
def test_what_is_compared_with_fuzzy_q_iteration_has_it_as_reference(
    claim: str,
) -> None:
    deciding = [each for each in EXPERIMENTS if claim in each.claims]
    cost = {"C11": "quadratic", "C12": "time"}[claim]
    for each in deciding:
        found = each.references["fuzzy Q-iteration"]
        assert found.key == planned(navigation(cost, "fuzzy")).key


def test_what_takes_long_beside_the_thesis_has_fewer_runs() -> None:
    by_runs = {
        name: {study.most_runs for study in BY_NAME[name].studies.values()}
        for name in (*FIGURES, *BESIDE)
    }
    long = {name for name, most in by_runs.items() if most == {FEWER}}
    assert long == {
        *("navigation-long", "omega-max", "local-update"),
        *("pendulum-long", "fuzzy-ants"),
    }
    assert all(most == {None} for name, most in by_runs.items() if name not in long)


def test_what_is_shared_is_run_once() -> None:
    chosen = [BY_NAME[name] for name in ("fig5.4", "fig5.5", "fig5.14")]
    keys = {study.key for each in chosen for study in each.everything}
    assert len(keys) == 6 + 5


def test_a_key_is_what_a_study_depends_on() -> None:
    study = pendulum("fuzzy")
    assert study.key == replace(pendulum("fuzzy"), most_runs=3).key
    others = [
        pendulum("crisp"),
        pendulum("fuzzy", 251),
        pendulum("fuzzy", local_decay=0.02),
        pendulum("fuzzy", cells=(40, 43)),
        replace(study, trials=99),
        replace(study, task=replace(study.task, env={"omega_max": 10.0})),
        replace(study, task=replace(study.task, evaluation_steps=100)),
        study.with_settings(update="once_per_ant"),
        planned(study),
    ]
    assert len({study.key, *(each.key for each in others)}) == 1 + len(others)
    assert json.loads(json.dumps(study.inputs))["task"]["env_id"] == study.task.env_id
