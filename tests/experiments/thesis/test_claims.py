"""Every claim is decided by its own experiments, and what it measures is right."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
import pandas as pd
import pytest

from acl_gym.evaluation import record_trajectory
from acl_gym.experiments.claims import IN_PART, NOT, Claim
from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.results import Results, Run
from acl_gym.experiments.study import Study
from acl_gym.experiments.swarms.study import SwarmStudy
from acl_gym.experiments.systems import (
    free_states,
    grid_1d,
    grid_2d,
    grid_optimum,
    navigation,
    pendulum,
    two_state,
)
from acl_gym.experiments.thesis import (
    CLAIMS,
    EXPERIMENTS,
    chapter3_claims,
    chapter4,
    chapter5_measures,
    theory,
)
from acl_gym.planning.value_iteration import value_iteration
from tests.experiments.synthetic import make_swarm_run

SEEDS, TRIALS = 3, 25
MEASURES = (
    *("policy_cost", "success_rate", "sensitivity", "policy_variation"),
    *("level_q", "level_best", "level_second", "lowest_level", "highest_level"),
    "discount",
)


_TABLES: dict[str, int] = {}


def table_size(study: Study) -> int:
    """Entries of what is learned; it takes a moment to find out for large systems."""
    name = str((study.task.env_id, study.task.env, study.cells))
    if name not in _TABLES:
        n_actions = study.task.make_system_env(1).single_action_space.n
        _TABLES[name] = int(study.make_partition().n_cells * n_actions)
    return _TABLES[name]


def invented(study: Any) -> list[Run]:
    """Runs of a study that was never run: any numbers, always the same."""
    if isinstance(study, SwarmStudy):
        return [make_swarm_run(study, seed) for seed in range(SEEDS)]
    rng = np.random.default_rng(zlib.crc32(study.key.encode()))
    runs = []
    for seed in range(SEEDS):
        rows = {name: rng.uniform(0.1, 1.0, TRIALS) for name in MEASURES}
        table = rng.random(table_size(study))
        runs.append(Run(pd.DataFrame(rows), table, 1.0, seed=seed))
    return runs


def results_of(names: list[str]) -> Results:
    """Invented results of the experiments of these names alone."""
    chosen = [each for each in EXPERIMENTS if each.name in names]
    studies = {study.key: study for each in chosen for study in each.everything}
    return Results({key: invented(study) for key, study in studies.items()})


def made(study: Study, table: Any = (0.0,), **measures: Any) -> dict[str, list[Run]]:
    """Runs of one study by its key: its `measures`, and the same table in each."""
    first = np.atleast_2d(next(iter(measures.values())))
    runs = []
    for seed in range(len(first)):
        rows = {name: np.atleast_2d(each)[seed] for name, each in measures.items()}
        runs.append(Run(pd.DataFrame(rows), np.ravel(table), 1.0, seed=seed))
    return {study.key: runs}


def of(study: Study, table: Any = (0.0,), **measures: Any) -> Results:
    """Results of one study, see `made`."""
    return Results(made(study, table, **measures))


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda each: each.name)
def test_a_claim_is_decided_by_its_own_experiments_alone(claim: Claim) -> None:
    own = [each.name for each in EXPERIMENTS if claim.name in each.claims]
    found = claim.judge(results_of(own))
    assert found["verdict"] != "undecided"
    assert json.loads(json.dumps(found)) == found
    assert all(part["statement"] and part["measured"] for part in found["parts"])
    assert claim.judge(Results({}))["verdict"] == "undecided"


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda each: each.name)
def test_what_was_tried_needs_its_experiments(claim: Claim) -> None:
    own = [each.name for each in EXPERIMENTS if claim.name in each.claims]
    beside = [each.name for each in EXPERIMENTS if claim.name in each.explains]
    everything = [attempt(results_of([*own, *beside])) for attempt in claim.tried]
    assert all(each.what and each.found for each in everything)
    found = claim.judge(results_of(own))
    if beside and found["verdict"] in (IN_PART, NOT):
        assert len(found["tried"]) < len(everything), "its trials are not looked at"


def test_claims_are_those_of_the_thesis_and_all_but_plain_ones_were_looked_into() -> (
    None
):
    assert [claim.name for claim in CLAIMS] == [f"C{n}" for n in range(1, 35)]
    assert {claim.name for claim in CLAIMS if not claim.tried} == {
        *("C1", "C2", "C3", "C17", "C21"),
        *("C25", "C26", "C27", "C29", "C31", "C34"),
    }


@pytest.mark.parametrize(
    ("late", "verdicts"),
    [
        ([5.0] * 20, ("does not hold", "holds")),
        ([5.0] * 19 + [6.0], ("holds", "does not hold")),
    ],
)
def test_convergence_on_the_1d_grid(late: list[float], verdicts: Any) -> None:
    costs = [9.0, *late]
    for claim, study, verdict in zip(
        CLAIMS, (grid_1d(global_decay=0.0), grid_1d()), verdicts, strict=False
    ):
        assert claim.judge(of(study, policy_cost=[costs] * 3))["verdict"] == verdict


def test_the_optimal_policy_of_a_grid_costs_the_optimum() -> None:
    study = grid_2d()
    optimum = value_iteration(study.task.make_system_env(1))
    each_action = np.eye(optimum.action_values.shape[1])
    best = each_action[optimum.policy.best_actions()]
    costs = chapter3_claims.exact_costs(of(study, best, policy_cost=[1.0]), study)
    assert costs == pytest.approx([grid_optimum(study)])
    assert costs == pytest.approx([9.99], abs=0.005)
    n_states = len(optimum.values)
    assert len(free_states(study)) == n_states - 1
    lost = each_action[np.zeros(n_states, dtype=int)]
    found = chapter3_claims.exact_costs(of(study, lost, policy_cost=[1.0]), study)
    assert found.tolist() == [np.inf]


def test_agreement_of_runs() -> None:
    actions = np.array([[0, 1, 2, 3], [0, 1, 2, 0], [0, 1, 1, 0]])
    # Runs 0 and 1 agree in 3 cells of 4, 1 and 2 in 3, 2 and 0 in 2.
    assert chapter3_claims.agreement(actions) == pytest.approx(8 / 12)


def test_trials_of_a_fall() -> None:
    costs = [100.0, 60.0, 20.0, 5.0] + [0.0] * 20
    fuzzy = made(navigation("time", "fuzzy"), policy_cost=[costs])
    crisp = made(navigation("time", "crisp"), policy_cost=[costs[::-1]])
    results = Results({**fuzzy, **crisp})
    assert chapter4.trials_of_fall(results, "time") == [4, 1]
    assert chapter4.trials_of_fall(results, "time", share=0.5) == [3, 1]


def test_the_damping_on_the_paths_is_that_of_one_path_after_the_other() -> None:
    study = navigation("time", "fuzzy")
    table = np.random.default_rng(0).random(table_size(study))
    results = of(study, table, policy_cost=[1.0])
    policy = restore_policy(study, results.runs(study)[0])
    env = study.task.make_system_env(1)
    paths = [
        record_trajectory(policy, env, state, max_steps=150).states[:-1]
        for state in study.task.evaluation_states()
    ]
    met = np.concatenate(paths)
    expected = env.system.damping(met[:, 0], met[:, 2]).mean()
    assert chapter4.mean_damping(policy, study) == pytest.approx(expected)


def policy_of(rule: Any, study: Study) -> Any:
    """A table whose action in a cell is `rule(theta, omega)` + 1."""
    theta, omega = np.meshgrid(*study.make_partition().centres, indexing="ij")
    return np.eye(3)[np.asarray(rule(theta, omega) + 1, dtype=int).ravel()]


def test_the_structure_of_policies() -> None:
    study = pendulum("crisp")
    drives = policy_of(lambda theta, omega: np.sign(omega), study)
    same, low, away, none, slow = chapter5_measures.structure(
        of(study, drives, policy_cost=[1.0]), study
    )[:, 0]
    # All pairs but those on both sides of omega = 0, which is a row of cells.
    assert same == pytest.approx(1 - 2 * 40 / (40 * 41 + 40 * 40))
    assert (low, away, none, slow) == (1.0, 0.0, 0.0, 0.0)
    still = policy_of(lambda theta, omega: 0 * omega, study)
    found = chapter5_measures.structure(of(study, still, policy_cost=[1.0]), study)
    assert found[:, 0].tolist() == [1.0, 0.0, 0.0, 1.0, 0.0]
    brakes = policy_of(
        lambda theta, omega: np.where(np.abs(omega) <= 3.0, -np.sign(omega), 0), study
    )
    found = chapter5_measures.structure(of(study, brakes, policy_cost=[1.0]), study)
    assert found[4, 0] == 1.0
    assert 0.0 < found[2, 0] < 1.0
    assert found[3, 0] == 1.0


def test_how_a_policy_swings_up(monkeypatch: pytest.MonkeyPatch) -> None:
    study = pendulum("fuzzy")
    results = of(study, np.zeros(40 * 41 * 3), policy_cost=[1.0])

    class Path:
        states = np.array(
            [[0.0, 0.0], [0.3, 2.0], [0.2, -3.0], [2.0, 5.0], [3.1, 1.0], [3.2, 0.1]]
        )

    monkeypatch.setattr(chapter5_measures, "record_trajectory", lambda *_, **__: Path)
    seconds, turns = chapter5_measures.best_swing_up(results, study)
    assert (seconds, turns) == (pytest.approx(0.4), 2)
    Path.states = Path.states[:4]
    assert chapter5_measures.swing_ups(results, study) == [(np.inf, 2)]


def test_runs_that_keep_the_optimal_action() -> None:
    study = two_state(1)
    late = np.ones((3, theory.LIMIT))
    second = late * 0.5
    second[1, 0], second[2, -1] = 2.0, 1.0
    before = np.zeros((3, 1))
    results = of(
        study,
        level_best=np.hstack([before, late]),
        level_second=np.hstack([before + 1, second]),
    )
    assert theory.kept(results, study).tolist() == [True, False, False]
