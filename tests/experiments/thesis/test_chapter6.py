"""The claims of chapter 6 decide what they say, on results made by hand."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from acl_gym.experiments import outcome, report, reproduce
from acl_gym.experiments.claims import Claim
from acl_gym.experiments.results import Results, Run
from acl_gym.experiments.swarms.measures import (
    SOLVED,
    least_values,
    mean_ranks,
    settling_steps,
    solved,
)
from acl_gym.experiments.swarms.study import SwarmStudy
from acl_gym.experiments.swarms.tables import SWARM_TABLES
from acl_gym.experiments.thesis import CLAIMS, chapter6
from tests.experiments.synthetic import make_results

BY_NAME = {claim.name: claim for claim in CLAIMS}
EXPERIMENTS = {each.name: each for each in chapter6.EXPERIMENTS}


def runs_of(study: SwarmStudy, **measures: Any) -> list[Run]:
    """Three runs in which each measure is a number, or a value for each row."""
    points = study.curve_points() or [study.steps]
    rows = {name: np.zeros(len(points)) + value for name, value in measures.items()}
    frame = pd.DataFrame({"env_steps": np.array(points, dtype=np.float64), **rows})
    table = np.random.default_rng(0).random(2 * chapter6.AGENTS)
    return [Run(frame, table, 1.0, "", seed) for seed in range(3)]


def swarm(study: SwarmStudy, **measures: Any) -> dict[str, list[Run]]:
    whole = {"drift": 0.0, "centre_speed": 0.0, "size": 1.0, "rms": 0.5, "parts": 1.0}
    return {study.key: runs_of(study, **{**whole, **measures})}


def parts(claim: str, *found: dict[str, list[Run]]) -> dict[str, bool]:
    merged = {key: runs for each in found for key, runs in each.items()}
    judged = BY_NAME[claim].judge(Results(merged))
    assert judged["verdict"] != "undecided"
    return {part["statement"]: part["holds"] for part in judged["parts"]}


def test_one_part_is_cohesive_and_two_are_not() -> None:
    radius = chapter6.SYMMETRIC["radius 2"]
    whole = [swarm(study) for study in chapter6.SYMMETRIC.values()]
    assert all(parts("C24", *whole).values())
    found = parts("C24", *whole, swarm(radius, parts=2.0))
    assert [name for name, holds in found.items() if not holds] == [
        "radius 2: at least nine of ten runs end as one part"
    ]


@pytest.mark.parametrize(("drift", "stands"), [(9e-13, True), (1.1e-12, False)])
def test_symmetric_links_keep_the_centre(drift: float, stands: bool) -> None:
    channels = [swarm(study, drift=drift) for study in chapter6.SYMMETRIC.values()]
    assert set(parts("C25", *channels).values()) == {stands}


@pytest.mark.parametrize(("drift", "moves"), [(9e-4, False), (1.1e-3, True)])
def test_one_way_links_move_the_centre(drift: float, moves: bool) -> None:
    channels = [swarm(study, drift=drift) for study in chapter6.ONE_WAY.values()]
    assert set(parts("C26", *channels).values()) == {moves}


def test_the_letter_is_a_step_late_to_the_bit() -> None:
    split = swarm(chapter6.LATE[0])
    letter, late = (
        swarm(study, drift=0.01) for study in (chapter6.LETTER, chapter6.LATE[1])
    )
    assert list(parts("C27", split, letter, late).values()) == [True, True, True]
    nearly = swarm(chapter6.LATE[1], drift=0.01 + 1e-15)
    assert list(parts("C27", split, letter, nearly).values()) == [True, False, True]
    large = swarm(chapter6.LETTER, drift=0.0, rms=0.51)
    assert list(parts("C27", split, large, split, late).values()) == [False] * 3


def test_late_swarms_rest_or_travel() -> None:
    rests = {steps: swarm(study) for steps, study in chapter6.LATE.items()}
    assert all(parts("C28", *rests.values()).values())
    early = np.where(np.arange(101) < 75, 30.0, 0.0)  # at rest in the last quarter
    settled = swarm(chapter6.LATE[4], centre_speed=early)
    assert all(parts("C28", *rests.values(), settled).values())
    travels = swarm(chapter6.LATE[5], centre_speed=0.02, parts=2.0)
    found = parts("C28", *rests.values(), travels)
    assert [name[:12] for name, holds in found.items() if not holds] == [
        "5 steps late"
    ] * 2
    pulses = swarm(chapter6.LATE[3], rms=0.5 + 0.014 * (np.arange(101) % 2))
    found = parts("C28", *rests.values(), pulses)
    assert all(found.values())
    pulses = swarm(chapter6.LATE[3], rms=0.5 + 0.027 * (np.arange(101) % 2))
    found = parts("C28", *rests.values(), pulses)
    assert [name for name, holds in found.items() if not holds] == [
        "3 steps late: over the last quarter the rms distance swings by at most 5% in "
        "nine of ten runs"
    ]


def foragers(**misses: float) -> list[dict[str, list[Run]]]:
    """All foraging swarms, with a miss for each channel; 0.5 where nothing is said."""
    return [
        swarm(study, miss=misses.get(label, 0.5), centre_miss=misses.get("centre", 0.1))
        for row in chapter6.FORAGING.values()
        for label, study in row.items()
    ]


def test_foraging_is_held_against_agents_alone() -> None:
    assert set(parts("C29", *foragers(nobody=2.0)).values()) == {True}
    assert set(parts("C29", *foragers(nobody=2.0, everyone=2.5)).values()) == {False}
    assert set(parts("C30", *foragers(nobody=2.0)).values()) == {True}
    found = parts("C30", *foragers(nobody=2.0, centre=1.5))
    assert {holds for name, holds in found.items() if "the centre" in name} == {False}
    assert {holds for name, holds in found.items() if "than alone" in name} == {True}


def particle_swarms(**values: float) -> list[dict[str, list[Run]]]:
    """All particle swarms of fig6.optimum, with a value for each channel; 1 otherwise."""
    return [
        {study.key: runs_of(study, value=values.get(label.replace(" ", "_"), 1.0))}
        for row in chapter6.SWARMS.values()
        for label, study in row.items()
    ]


def test_particles_are_held_against_particles_alone() -> None:
    assert set(parts("C31", *particle_swarms(nobody=9.0)).values()) == {True}
    found = parts("C31", *particle_swarms(nobody=9.0, ring=10.0))
    assert {name.split(",")[1].split(":")[0] for name in found} == {
        " everyone",
        " ring",
    }
    assert all(holds == (", everyone" in name) for name, holds in found.items())


def test_the_printed_order_has_to_solve_sphere() -> None:
    for value, holds in ((1e-11, True), (1e-9, False)):
        studies = [
            {study.key: runs_of(study, value=value)}
            for study in chapter6.ORDERS.values()
        ]
        assert set(parts("C32", *studies).values()) == {holds}


def test_channels_of_particle_swarms() -> None:
    names = [label.replace(" ", "_") for label in chapter6.SWARMS["sphere"]]
    all_solve = particle_swarms(**dict.fromkeys(names, 1e-20))
    assert set(parts("C33", *all_solve).values()) == {True}
    worse = particle_swarms(**{**dict.fromkeys(names, 1e-20), "ring": 3.0})
    found = parts("C33", *worse)
    assert [name.split(":")[0] for name, holds in found.items() if not holds] == [
        *("sphere, ring", "rastrigin, ring")
    ]


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, [True, True]),
        ({"differing": 1.0}, [False, True]),
        ({"learned": 0.0}, [False, True]),
        ({"same_draws": 0.0}, [True, False]),
    ],
)
def test_one_level_that_differs_decides(
    changed: dict[str, float], expected: list[bool]
) -> None:
    same = {"entries": 9.0, "learned": 5.0, "differing": 0.0, "same_draws": 1.0}
    studies = [
        {study.key: runs_of(study, **{**same, **changed})}
        for study in chapter6.COLONIES.values()
    ]
    assert list(parts("C34", *studies).values()) == expected * 4


@pytest.mark.parametrize("claim", [BY_NAME[f"C{n}"] for n in (24, 28, 30, 32, 33)])
def test_what_was_tried_is_reported(claim: Claim) -> None:
    chosen = [each for each in chapter6.EXPERIMENTS if claim.name in each.claims]
    runs: dict[str, list[Run]] = {}
    for each in chosen:
        runs |= make_results(each)._runs
    for attempt in claim.tried:
        assert "nan" not in attempt(Results(runs)).found


def test_settling_and_solved() -> None:
    study = chapter6.aggregation()
    rms = np.where(np.arange(101) < 40, 2.0, 1.0)
    rms[60] = 1.04  # within 5% of the end
    results = Results(swarm(study, rms=rms))
    assert settling_steps(results, study).tolist() == [800.0] * 3
    particle = chapter6.particles("sphere")
    for value, share in ((0.0, 1.0), (SOLVED, 0.0)):
        results = Results({particle.key: runs_of(particle, value=value)})
        assert solved(results, particle) == share
        assert least_values(results, particle).tolist() == [SOLVED] * 3


def test_ranks_by_hand() -> None:
    functions = ("sphere", "rastrigin")
    rows = {
        function: {
            str(seed): chapter6.particles(function, inertia=seed) for seed in (1, 2, 3)
        }
        for function in functions
    }
    values = {"sphere": (1e-20, 1e-15, 3.0), "rastrigin": (5.0, 4.0, 6.0)}
    results = Results(
        {
            study.key: runs_of(study, value=value)
            for function in functions
            for study, value in zip(
                rows[function].values(), values[function], strict=True
            )
        }
    )
    # 1.5, 1.5, 3 and 2, 1, 3
    assert mean_ranks(results, rows).tolist() == [1.75, 1.25, 3.0]


def test_tables_have_a_row_for_each_channel() -> None:
    for name, rows in (
        *(("fig6.centre", 12), ("fig6.delays", 8), ("fig6.colony", 4)),
        *(("fig6.foraging", 5), ("fig6.optimum", 16)),
    ):
        experiment = EXPERIMENTS[name]
        table = SWARM_TABLES[experiment.table](experiment, make_results(experiment))
        assert len(table.rows) == rows
        assert all(len(row) == len(table.headings) for row in table.rows)


def test_the_report_shows_swarms_by_their_own_measures(tmp_path: Path) -> None:
    experiment = EXPERIMENTS["fig6.delays"]
    found = outcome.summary(experiment, make_results(experiment))
    assert found["measures"][0] == {
        "key": "size",
        "name": "distance of the outermost agent from the centre",
        "logarithmic": False,
    }
    assert {each["key"] for each in found["measures"]} == {
        *("size", "rms", "drift", "centre_speed", "parts")
    }
    path = tmp_path / "report.html"
    report.write_report(
        path,
        title="A report",
        experiments=[json.loads(json.dumps(found, allow_nan=False))],
        figures=tmp_path,
        command="acl-gym",
        made={},
    )
    page = path.read_text()
    options = re.findall(r'<option value="(\w+)"( data-logarithmic)?>', page)
    assert ("drift", "") in options
    assert "In the end: distance of the outermost agent from the centre" in page
    curves = (tmp_path / "curves" / "fig6.delays.js").read_text()
    assert '"unit":"step"' in curves
    optimum = EXPERIMENTS["fig6.order"]
    assert outcome.summary(optimum, make_results(optimum))["measures"] == [
        {"key": "value", "name": "least value so far", "logarithmic": True}
    ]


@pytest.mark.slow
def test_two_experiments_from_runs_to_report(tmp_path: Path) -> None:
    names = ["fig6.order", "fig6.colony"]
    found, was_there = reproduce.reproduce(names, 3, tmp_path, workers=2)
    assert not was_there
    verdicts = {each["claim"]: each["verdict"] for each in found["claims"]}
    assert verdicts["C32"] == "does not hold"
    assert verdicts["C34"] == "holds"
    assert verdicts["C1"] == "undecided"
    for name in names:
        assert (tmp_path / "figures" / f"{name}.png").is_file()
    assert reproduce.reproduce(names, 3, tmp_path, workers=2)[1]
