"""Arenas and contests: what is between system and learner, and what a run tells."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym.agents.q_learning import QLearning
from acl_gym.colony.episodes import Episodes
from acl_gym.reproduction import reproduce as reproduction
from acl_gym.reproduction.catalogue import BY_NAME
from acl_gym.reproduction.reproduce import tasks_for
from acl_gym.reproduction.store import ParquetStore
from acl_gym.reproduction.versus.arenas import ARENAS, LABELS, SYSTEMS
from acl_gym.reproduction.versus.contest import COLUMNS, Contest, learn, make_agent
from acl_gym.reproduction.versus.reference import Reference
from acl_gym.reproduction.versus.spaces import METHODS, TABLES, defaults_of
from acl_gym.reproduction.versus.tuned import methods_in
from acl_gym.reproduction.versus.wholes import WHOLES, Peak, Switches
from tests.reproduction.slices import silent

PAIRS = [(name, method) for name in ARENAS for method in methods_in(ARENAS[name])]


def contest(name: str, method: str, **changes: Any) -> Contest:
    settings = {**defaults_of(ARENAS[name], method), **changes}
    return Contest(ARENAS[name], method, settings)


@pytest.mark.parametrize(("name", "method"), PAIRS)
def test_every_method_runs_in_every_arena(name: str, method: str) -> None:
    setting = contest(name, method).brief()
    found = learn(setting, 0, silent)
    rows = found["rows"]
    assert set(rows) == set(COLUMNS)
    assert len({len(values) for values in rows.values()}) == 1
    assert np.all(np.diff(rows["env_steps"]) > 0)
    assert np.isfinite(rows["policy_cost"]).all()
    assert max(rows["policy_cost"]) <= setting.arena.ceiling
    assert found["failure"] == ""
    again = learn(setting, 0, silent)
    assert again["rows"]["policy_cost"] == rows["policy_cost"]
    assert np.array_equal(again["levels"], found["levels"])
    along = setting.along([found, again], "policy_cost")
    assert along.shape == (2, len(setting.positions()))


def test_every_arena_has_a_label_and_tables_fit() -> None:
    assert set(LABELS) == set(ARENAS)
    assert list(SYSTEMS) == ["row", "grid", "navigation", "pendulum"]
    for arena in SYSTEMS.values():
        assert methods_in(arena) == tuple(METHODS)
        assert Reference(arena).text
    with pytest.raises(ValueError, match="without a veil"):
        Reference(ARENAS["pendulum-noise"])


def test_a_key_is_what_is_in_a_contest_but_the_number_of_runs() -> None:
    first = contest("pendulum", "q")
    assert replace(first, most_runs=3).key == first.key
    others = [
        contest("pendulum", "q-lambda"),
        contest("pendulum", "q", epsilon=0.2),
        contest("pendulum-40x41", "q"),
        replace(first, backwards=True),
    ]
    assert len({first.key, *(each.key for each in others)}) == 1 + len(others)
    assert json.loads(json.dumps(first.about)) is not None
    assert "most_runs" not in first.about
    names = [task.name for task in tasks_for([replace(first, most_runs=2)], range(5))]
    assert names == [f"versus-q-{first.key}-{seed}" for seed in (0, 1)]


def test_a_run_that_breaks_down_costs_the_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def overflow(agent: QLearning) -> None:
        if agent.trials == 2:
            raise ValueError("values have overflowed")

    monkeypatch.setattr(QLearning, "_check_values", overflow)
    found = learn(contest("pendulum", "q").brief(), 0, silent)
    assert found["failure"] == "values have overflowed"
    rows = found["rows"]
    assert len(rows["policy_cost"]) == 3
    assert rows["policy_cost"][-1] == ARENAS["pendulum"].ceiling
    assert rows["success_rate"][-1] == 0.0
    assert np.all(np.diff(rows["env_steps"]) > 0)


def test_the_order_of_ants_does_not_matter_and_that_of_q_learning_does() -> None:
    tables = {}
    for method in ("acl", "q"):
        setting = contest("pendulum", method, slots=40, max_steps=60)
        arena = replace(setting.arena, steps=6_000, cells=(10, 11))
        both = [
            learn(replace(setting, arena=arena, backwards=backwards), 1, silent)
            for backwards in (False, True)
        ]
        tables[method] = [found["levels"] for found in both]
    np.testing.assert_allclose(*tables["acl"], rtol=1e-9)
    assert not np.allclose(*tables["q"], rtol=1e-3)


def test_costs_of_whole_solutions() -> None:
    episodes = Episodes(
        observations=np.array(
            [[[0.0, 1.0]], [[0.0, -5.0]], [[0.0, 2.0]], [[0.0, 9.0]]]
        ),
        actions=np.array([[0], [1], [0]]),
        stage_costs=np.ones((3, 1)),
        lengths=np.array([2]),
        success=np.array([False]),
    )
    assert Switches()(episodes).tolist() == [1.0]
    assert Peak(1)(episodes).tolist() == [5.0]
    assert WHOLES["switches"].cost(episodes)[0] == pytest.approx(0.2 + 0.5)
    for name in WHOLES:
        arena = ARENAS[f"pendulum-{name}"]
        assert arena.ceiling == WHOLES[name].ceiling
        agent: Any = make_agent(Contest(arena, "acl", defaults_of(arena, "acl")), 0)
        assert agent.cost == WHOLES[name].cost


def test_experiments_are_those_of_the_issue() -> None:
    names = [name for name in BY_NAME if name.startswith("versus-")]
    overview = BY_NAME["versus"]
    assert len(overview.studies) == 4 * (len(METHODS) + 1)
    assert names == [f"versus-{name}" for name in SYSTEMS] + [
        f"versus-{name}"
        for name in ("cells", "noise", "partial", "wholes", "slots", "order")
    ]
    for name in names[:4]:
        studies = BY_NAME[name].studies
        assert [study.label for study in studies[:-1]] == list(METHODS.values())
        assert all(study.setting.most_runs is None for study in studies[:-1])
    for name in names[4:]:
        assert {s.setting.method for s in BY_NAME[name].studies} == set(TABLES)
        assert {s.setting.most_runs for s in BY_NAME[name].studies} == {10}
    for name in names[4:8]:
        for row in BY_NAME[name].options["rows"].values():
            short, long = row["acl"], row["acl-long"]
            assert long.settings == short.settings
            assert long.arena.steps == 4 * short.arena.steps
            assert all(row[m].arena == short.arena for m in TABLES)


def test_two_runs_of_an_experiment_from_its_name_to_its_findings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = BY_NAME["versus-row"]
    brief = replace(
        whole,
        studies=tuple(
            replace(study, setting=study.setting.brief())
            for study in whole.studies
            if study.label != "DQN"
        ),
    )
    monkeypatch.setattr(reproduction, "EXPERIMENTS", (brief,))
    outcome, evidence = reproduction.reproduce(["versus-row"], 2, tmp_path, workers=1)
    (found,) = outcome["experiments"]
    rows = found["findings"]["rows"]
    assert [row[0] for row in rows] == ["ACL", "Q-learning", "Q(λ)"]
    assert all(len(row) == len(found["findings"]["headings"]) for row in rows)
    assert {each["verdict"] for each in found["findings"]["duels"]} == {"undecided"}
    assert len(list((tmp_path / "tasks").glob("*.parquet"))) == 2 * 3 + 1
    learner = brief.studies[0].setting
    kept, made = evidence.runs(learner)[1], learn(learner, 1, silent)
    assert kept["rows"]["policy_cost"] == made["rows"]["policy_cost"]
    assert kept["levels"].tobytes() == made["levels"].tobytes()


def test_a_run_without_a_table_is_kept_like_the_others(tmp_path: Path) -> None:
    (task,) = tasks_for([contest("row", "dqn").brief()], [0])
    result = task.function(*task.arguments, silent)
    store = ParquetStore(tmp_path)
    store.write(task, result)
    found = store.read(task)
    assert found is not None
    assert found["rows"] == result["rows"]
    assert found["levels"].size == 0
