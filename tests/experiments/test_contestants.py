"""Every contestant runs, on a budget too small to learn anything."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acl_gym.experiments import contestants
from acl_gym.experiments.contestants import CONTESTANTS, ENVIRONMENT, PRESETS, Preset

TINY = Preset(seeds=1, trials=2, dqn_steps=160, dqn_every=80, optimum_cells=(20, 21))


@pytest.mark.parametrize("agent", CONTESTANTS)
def test_a_run_says_how_it_went(agent: str) -> None:
    told: list[float] = []
    run = contestants.run(agent, ENVIRONMENT, 3, TINY, told.append)
    assert json.loads(json.dumps(run)) == run, "a result must survive JSON"
    assert (run["agent"], run["seed"]) == (agent, 3)
    steps = [row["env_steps"] for row in run["rows"]]
    seconds = [row["seconds"] for row in run["rows"]]
    assert steps == sorted(set(steps))
    assert seconds == sorted(seconds)
    assert seconds[0] > 0
    cheapest = min(run["rows"], key=lambda row: row["policy_cost"])
    assert run["best"] == cheapest
    shape = np.shape(run["policy_map"])
    assert shape == (161, 160)
    assert set(np.unique(run["policy_map"])) <= {0, 1, 2}
    path = run["trajectory"]
    assert path["theta"][0] == path["omega"][0] == path["cost"][0] == 0.0
    assert len(path["time"]) == len(path["theta"]) == len(path["torque"]) + 1
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)
    assert run["parameters"]


def test_a_run_is_a_function_of_its_seed() -> None:
    def figures(seed: int) -> list[float]:
        run = contestants.run("q-fuzzy", ENVIRONMENT, seed, TINY, lambda _: None)
        return [row["policy_cost"] for row in run["rows"]]

    assert figures(0) == figures(0) != figures(1)


def test_the_reference_holds_the_optimum_and_the_coarse_policy() -> None:
    preset = Preset(
        seeds=1, trials=1, dqn_steps=1, dqn_every=1, optimum_cells=(100, 101)
    )
    reference = contestants.find_reference(ENVIRONMENT, preset)
    assert reference["optimal_cost"] == pytest.approx(39.0, abs=0.7)
    assert reference["success_rate"] == 1.0
    # On the agents' own cells even dynamic programming fails from most states.
    assert reference["coarse"]["policy_cost"] > 1.2 * reference["optimal_cost"]
    assert reference["coarse"]["success_rate"] < 0.6
    assert reference["trajectory"]["reached"]


def test_budgets_are_what_the_report_promises() -> None:
    assert PRESETS["full"].seeds >= 10
    assert PRESETS["full"].dqn_steps >= 200_000
    assert PRESETS["quick"].trials == PRESETS["full"].trials == 100


def test_only_the_pendulum_is_drawn() -> None:
    with pytest.raises(TypeError, match="environment of acl_gym"):
        contestants.make_env("CartPole-v1", 1)
