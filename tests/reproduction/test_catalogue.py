"""The experiments are those of the thesis, with the parameters of its tables."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import pytest

from acl_gym.reproduction.catalogue import BY_NAME, EXPERIMENTS, RUNS
from acl_gym.reproduction.claims import CLAIMS
from acl_gym.reproduction.figures import DRAWINGS
from acl_gym.reproduction.outcome import CAPTIONS
from acl_gym.reproduction.reproduce import chosen, settings_of, tasks_for
from acl_gym.reproduction.systems import row, swing, vehicle, world

FIGURES = [
    *("fig3.3", "fig3.4", "fig3.6", "fig3.7", "fig3.8", "fig3.9"),
    *(f"fig3.{n}" for n in range(11, 15)),
    *(f"fig4.{n}" for n in range(6, 15)),
    *(f"fig5.{n}" for n in range(2, 18)),
]


def values(name: str, parameter: str) -> list[float]:
    return [s.setting.colony[parameter] for s in BY_NAME[name].studies]


def test_every_figure_is_there_and_30_runs_of_each() -> None:
    assert [each.name for each in EXPERIMENTS][: len(FIGURES)] == FIGURES
    assert len(BY_NAME) == len(EXPERIMENTS)
    assert RUNS == 30


def test_every_claim_has_its_experiments_and_the_other_way_round() -> None:
    assert [claim.name for claim in CLAIMS] == [f"C{n}" for n in range(1, 24)]
    for claim in CLAIMS:
        assert claim.experiments, claim.name
    known = {claim.name for claim in CLAIMS}
    for each in EXPERIMENTS:
        assert set(each.claims) <= known
        assert each.drawing in DRAWINGS
        assert each.drawing in CAPTIONS


def test_sweeps_are_those_of_the_thesis() -> None:
    assert values("fig3.6", "global_decay") == [0, 0.1, 0.2, 0.5, 0.9, 1]
    assert values("fig3.8", "local_decay") == [0.01, 0.05, 0.1, 0.2, 0.5, 0.9]
    for name in ("fig5.2", "fig5.4"):
        assert values(name, "global_decay") == [0, 0.001, 0.01, 0.1, 0.5, 1]
        assert values(name, "local_decay") == [0.01] * 6
    for name in ("fig5.7", "fig5.9"):
        found = values(name, "local_decay")
        assert found[:5] == [0, 0.001, 0.01, 0.1, 0.5]
        assert found[5] == pytest.approx(1.0, abs=1e-5)
        assert values(name, "global_decay") == [0.1] * 6
    for name in ("fig5.12", "fig5.14"):
        ants = [study.setting.ants for study in BY_NAME[name].studies]
        assert ants == [100, 250, 500, 1000, 1500, 2000]
    assert [s.setting.ants for s in BY_NAME["fig3.9"].studies] == [1, 5, 9]
    probabilities = [
        study.setting.env["transition_probability"]
        for study in BY_NAME["fig3.11"].studies
    ]
    assert probabilities == [0.5, 0.7, 0.9, 1.0]
    assert [s.setting.ants for s in BY_NAME["fig3.14"].studies] == [
        *(17, 86),
        *(56, 278),
        *(128, 640),
    ]


def test_partitions_and_their_ants() -> None:
    """60% of the states for crisp ants, 15% for fuzzy (§5.3.4)."""
    for name, share in (("fig5.16", 0.6), ("fig5.17", 0.15)):
        for study, n in zip(BY_NAME[name].studies, (16, 32, 64), strict=True):
            assert study.setting.cells == (n, n + 1)
            assert study.setting.ants == round(share * n * (n + 1))


def test_tables_4_1_and_5_2() -> None:
    colony = swing("crisp").colony
    assert colony == {
        "tau0": 1e-4,
        "epsilon": 0.1,
        "alpha": 3.0,
        "selection": "max_boltzmann",
        "max_steps": 300,
        "global_decay": 0.1,
        "local_decay": 0.01,
    }
    assert (swing("crisp").ants, swing("crisp").trials) == (250, 100)
    assert swing("crisp").cells == (40, 41)
    setting = vehicle("quadratic", "fuzzy")
    assert (setting.ants, setting.trials) == (200, 200)
    assert setting.cells == "regular"
    assert vehicle("time", "fuzzy").cells == "damping"
    assert (row().ants, world().ants) == (9, 86)


def test_what_is_shared_is_run_once() -> None:
    both = settings_of([BY_NAME["fig5.4"], BY_NAME["fig5.5"], BY_NAME["fig5.14"]])
    assert len(both) == 6 + 5
    tasks = tasks_for(both, range(2))
    assert len({task.name for task in tasks}) == len(tasks) == 22


def test_a_key_is_what_is_in_a_setting() -> None:
    setting = swing("fuzzy")
    assert setting.key == swing("fuzzy").key
    others = [
        swing("crisp"),
        swing("fuzzy", 251),
        swing("fuzzy", local_decay=0.02),
        swing("fuzzy", cells=(40, 43)),
        replace(setting, trials=99),
        replace(setting, env={"omega_max": 10.0}),
        replace(setting, evaluation_steps=100),
    ]
    assert len({setting.key, *(each.key for each in others)}) == 1 + len(others)
    assert json.loads(json.dumps(asdict(setting)))["env_id"] == setting.env_id


def test_names() -> None:
    assert chosen(["all"]) == list(EXPERIMENTS)
    assert [each.name for each in chosen(["fig5.4", "fig3.6"])] == ["fig3.6", "fig5.4"]
    decisive = {each.name for each in chosen(["claims"])}
    assert "fig5.4" in decisive
    assert "fig3.7" not in decisive
    with pytest.raises(ValueError, match=r"must be among all, claims, .* got 'fig9'"):
        chosen(["fig5.4", "fig9"])
