"""Every contestant runs, on a budget too small to learn anything."""

from __future__ import annotations

import json

import gymnasium as gym
import numpy as np
import pytest

from acl_gym.experiments import contestants
from acl_gym.experiments.contestants import CONTESTANTS, PRESETS
from acl_gym.experiments.courses import (
    COURSES,
    GRID_1D,
    GRID_2D,
    NAVIGATION,
    PENDULUM,
    Budget,
)
from acl_gym.experiments.pictures import PICTURES
from acl_gym.partitions import Crisp, Discrete, Fuzzy
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.sb3.dqn import LONG_RUN, DQNSettings

TINY = Budget(
    trials=2,
    dqn_steps=160,
    dqn_every=80,
    reference=lambda: thesis_partition(gym.make("acl_gym/Pendulum-v0"), (20, 21)),
)
EVERY_ONE = [(c, method) for c in COURSES.values() for method in c.methods]


@pytest.mark.parametrize(
    ("course", "agent"), EVERY_ONE, ids=[f"{c.env_id}-{m}" for c, m in EVERY_ONE]
)
def test_a_run_says_how_it_went(course, agent: str) -> None:
    told: list[float] = []
    run = contestants.run(agent, course, 3, TINY, told.append)
    assert json.loads(json.dumps(run)) == run, "a result must survive JSON"
    assert len(json.dumps(run)) < 120_000, "a result must stay small"
    assert (run["agent"], run["seed"]) == (agent, 3)
    assert run["label"] == course.methods[agent]
    steps = [row["env_steps"] for row in run["rows"]]
    seconds = [row["seconds"] for row in run["rows"]]
    assert steps == sorted(set(steps))
    assert seconds == sorted(seconds)
    assert seconds[0] > 0
    cheapest = min(run["rows"], key=lambda row: row["policy_cost"])
    assert run["best"] == cheapest
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)
    settings = course.settings(agent)
    assert settings.items() <= run["parameters"].items()


def picture(course, agent="q-crisp"):
    return contestants.run(agent, course, 3, TINY, lambda _: None)["picture"]


def test_picture_of_the_pendulum() -> None:
    kept = picture(PENDULUM)
    assert np.shape(kept["policy_map"]) == (161, 160)
    assert set(np.unique(kept["policy_map"])) <= {0, 1, 2}
    path = kept["trajectory"]
    assert path["theta"][0] == path["omega"][0] == path["cost"][0] == 0.0
    assert len(path["time"]) == len(path["theta"]) == len(path["torque"]) + 1


def test_picture_of_the_navigation() -> None:
    kept = picture(NAVIGATION)
    assert np.shape(kept["policy_map"]) == (25, 25)
    assert len(kept["trajectories"]) == 8
    starts = {(path["c1"][0], path["c2"][0]) for path in kept["trajectories"]}
    assert starts == {(a, b) for a in (-5, 0, 5) for b in (-5, 0, 5)} - {(0, 0)}
    scene = PICTURES["navigation"].scene(contestants.make_env(NAVIGATION.env_id, 1))
    # Rows are c2, columns c1: the first region of damping lies below the goal.
    row, column = np.unravel_index(np.argmax(scene["damping"]), (81, 81))
    assert (row, column) != (column, row)
    assert scene["damping"][22][40] > 8.0


@pytest.mark.parametrize("course", [GRID_1D, GRID_2D])
def test_picture_of_a_grid(course) -> None:
    reference = contestants.find_reference(course, course.budgets["smoke"])
    kept = reference["picture"]
    scene = PICTURES["grid"].scene(contestants.make_env(course.env_id, 1))
    assert len(kept["policy_map"]) == len(scene["cells"])
    for action, best in zip(kept["policy_map"], scene["optimal_actions"], strict=True):
        assert action in best
    # The mean over the states that are no goal is J*.
    costs = np.array(kept["cost_to_go"])
    assert (costs[scene["goals"]] == 0).all()
    mean = costs.sum() / (costs.size - len(scene["goals"]))
    assert mean == pytest.approx(reference["optimal_cost"], abs=1e-5)
    assert reference["success_rate"] == 1.0


def test_exact_references_of_the_grids() -> None:
    costs = [
        contestants.find_reference(course, course.budgets["quick"])["optimal_cost"]
        for course in (GRID_1D, GRID_2D)
    ]
    assert costs == pytest.approx([5.0, 859 / 86])


def test_a_picture_needs_its_system() -> None:
    env = contestants.make_env(PENDULUM.env_id, 1)
    for kind in ("grid", "navigation"):
        with pytest.raises(TypeError, match="these are pictures of"):
            PICTURES[kind].scene(env)


def test_a_run_is_a_function_of_its_seed() -> None:
    def figures(seed: int) -> list[float]:
        run = contestants.run("q-fuzzy", PENDULUM, seed, TINY, lambda _: None)
        return [row["policy_cost"] for row in run["rows"]]

    assert figures(0) == figures(0) != figures(1)


def test_the_reference_holds_the_optimum_and_the_coarse_policy() -> None:
    reference = contestants.find_reference(PENDULUM, PENDULUM.budgets["smoke"])
    assert reference["optimal_cost"] == pytest.approx(39.0, abs=0.7)
    assert reference["cells"] == [100, 101]
    assert reference["success_rate"] == 1.0
    # On the agents' own cells even dynamic programming fails from most states.
    assert reference["coarse"]["policy_cost"] > 1.2 * reference["optimal_cost"]
    assert reference["coarse"]["success_rate"] < 0.6
    assert reference["picture"]["trajectory"]["reached"]


def test_budgets_are_what_the_report_promises() -> None:
    assert PRESETS["full"] >= 10
    assert PENDULUM.budgets["full"].dqn_steps >= 200_000
    for course in COURSES.values():
        assert set(course.budgets) == set(PRESETS)
        assert set(course.methods) <= set(CONTESTANTS)
        assert course.budgets["quick"].trials == course.budgets["full"].trials >= 100


def test_courses_are_those_of_the_thesis_and_settings_are_whole() -> None:
    assert {
        name: [make().n_cells for make in course.partitions.values()]
        for name, course in COURSES.items()
    } == {
        "acl_gym/Pendulum-v0": [1640, 1640],
        "acl_gym/Navigation-v0": [729, 729],
        "acl_gym/GridSearch1D-v0": [10],
        "acl_gym/GridSearch2D-v0": [87],
    }
    assert [course.slots for course in COURSES.values()] == [250, 200, 9, 86]
    assert [course.max_steps for course in COURSES.values()] == [300, 150, 50, 435]
    kinds = {"fuzzy": (Fuzzy,), "crisp": (Crisp, Discrete)}
    for course in COURSES.values():
        env = contestants.make_env(course.env_id, 1)
        assert env.system.evaluation_steps == course.max_steps
        for name, make in course.partitions.items():
            assert isinstance(make(), kinds[name])
            make().check_space(env.single_observation_space)
        for long_run in (False, True):
            DQNSettings(**course.settings("dqn", long_run=long_run))
    assert DQNSettings(**PENDULUM.dqn_short) == DQNSettings()
    assert DQNSettings(**PENDULUM.dqn_long) == LONG_RUN


def test_a_method_that_a_course_does_not_have() -> None:
    with pytest.raises(ValueError, match="method must be one of"):
        contestants.run("acl-fuzzy", GRID_1D, 0, TINY, lambda _: None)


def test_only_our_own_environments() -> None:
    with pytest.raises(TypeError, match="environment of acl_gym"):
        contestants.make_env("CartPole-v1", 1)
