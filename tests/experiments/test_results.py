"""What figures, tables and claims ask of results."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from acl_gym.experiments import methods
from acl_gym.experiments.results import MissingRunsError, Results, Run
from acl_gym.experiments.study import Study
from acl_gym.experiments.systems import grid_1d, pendulum

STUDY = replace(grid_1d(), trials=3)
SPACED = replace(grid_1d(), trials=None, steps=100, spacing=2.0)


def made(costs: list[float], steps: list[float], seed: int = 0) -> Run:
    rows = pd.DataFrame(
        {"env_steps": steps, "seconds": np.array(steps) / 10, "policy_cost": costs}
    )
    return Run(rows, np.zeros(1), 1.0, seed=seed, made={"cpu": f"cpu {seed}"})


def results(study: Study, *runs: Run) -> Results:
    return Results({study.key: list(runs)})


def test_values_after_each_trial() -> None:
    found = results(STUDY, made([3, 2, 1], [1, 2, 3]), made([5, 4, 6], [1, 2, 3]))
    assert found.values(STUDY).tolist() == [[3, 2, 1], [5, 4, 6]]
    assert found.last(STUDY).tolist() == [1, 6]
    assert found.best(STUDY).tolist() == [1, 4]
    assert found.best_run(STUDY) == 0


def test_a_policy_counts_until_the_next_evaluation() -> None:
    found = results(SPACED, made([9, 5, 2], [10, 50, 100]))
    at = SPACED.curve_points()
    assert at is not None
    curve = dict(zip(at, found.values(SPACED)[0], strict=True))
    assert curve[1] == 9, "the first one counts from the beginning"
    assert curve[max(step for step in at if step < 50)] == 9
    assert curve[min(step for step in at if step >= 50)] == 5
    assert curve[100] == 2


def test_when_a_policy_was_first_good_enough() -> None:
    found = results(STUDY, made([9, 4, 6], [10, 20, 30]), made([9, 9, 9], [1, 2, 3]))
    assert found.first_within(STUDY, 5.0, "env_steps").tolist() == [20, math.inf]
    assert found.first_within(STUDY, 5.0, "seconds")[0] == 2.0


def test_the_median_run_is_the_cheaper_of_two() -> None:
    runs = [made([cost], [1]) for cost in (4.0, 1.0, 3.0, 2.0)]
    assert results(STUDY, *runs).median_run(STUDY) == 3
    assert results(STUDY, *runs[:3]).median_run(STUDY) == 2


def test_a_long_table_of_all_rows() -> None:
    found = results(STUDY, made([3, 2], [1, 2]), made([5, 4], [1, 2], seed=1))
    table = found.frame({"one": STUDY})
    assert list(table.columns[:3]) == ["study", "method", "seed"]
    assert table["policy_cost"].tolist() == [3, 2, 5, 4]
    assert table["seed"].tolist() == [0, 0, 1, 1]
    assert found.made([STUDY])["cpu"] == ["cpu 0", "cpu 1"]


def test_runs_that_are_missing() -> None:
    with pytest.raises(MissingRunsError, match=r"9 slots, 3 trials.* was not run"):
        Results({}).runs(STUDY)


@pytest.mark.parametrize(
    "study",
    [
        replace(grid_1d(), trials=2),
        replace(pendulum("fuzzy", 5, (8, 9), max_steps=9), trials=2),
        replace(pendulum("crisp", 5, (8, 9)), method="planning", settings={}),
        replace(
            pendulum("crisp", 5, (8, 9), max_steps=9),
            method="q-learning",
            settings={"max_steps": 9},
            trials=2,
        ),
    ],
    ids=["grid", "fuzzy", "planning", "q-learning"],
)
def test_a_policy_is_made_again(study: Study) -> None:
    run = methods.run(study, 0)
    policy = methods.restore_policy(study, run)
    assert policy.table.tobytes() == run.table.tobytes()
    assert policy.table.shape == (study.make_partition().n_cells, policy.n_actions)


@pytest.mark.slow
@pytest.mark.parametrize("system", [grid_1d(), pendulum("fuzzy")], ids=["grid", "box"])
def test_a_network_is_made_again(system: Study) -> None:
    study = replace(
        system,
        method="dqn",
        settings={"learning_starts": 50, "max_episode_steps": 20},
        trials=None,
        steps=200,
        evaluate_every=100,
    )
    run = methods.run(study, 0)
    policy = methods.restore_policy(study, run)
    from acl_gym.evaluation import evaluate_policy_cost

    env = study.task.make_system_env(1)
    again = evaluate_policy_cost(policy, env, max_steps=None, seed=0)
    assert again.cost == pytest.approx(run.rows["policy_cost"].iloc[-1])


def test_a_study_is_named_by_what_it_depends_on() -> None:
    assert STUDY.key != STUDY.with_settings(alpha=2.0).key
    assert STUDY.key == replace(STUDY, most_runs=3).key
    assert "alpha = 3" in str(STUDY)
    assert "9 slots, 3 trials" in str(STUDY)
