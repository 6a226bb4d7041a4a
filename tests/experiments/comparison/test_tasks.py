"""Tasks as data: every method runs on every one, with the settings of the thesis."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from acl_gym.agents.q_learning import QLearning
from acl_gym.agents.returning import ReturningACL
from acl_gym.colony.episodes import Episodes
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.experiments.comparison import EXPERIMENTS
from acl_gym.experiments.comparison.experiments import LONG
from acl_gym.experiments.comparison.tasks import (
    ON_POLICY,
    PLAIN,
    SYSTEMS,
    TASKS,
    is_tuned,
    tuned,
    tuned_settings,
)
from acl_gym.experiments.episode_costs import EPISODE_COSTS, Peak, Switches
from acl_gym.experiments.methods import make_agent, restore_policy, run
from acl_gym.experiments.names import (
    FORGETTING,
    METHODS,
    NETWORKS,
    PRESETS,
    REMEMBERING,
    TABLE_METHODS,
    agent_names,
    agents_called,
)
from acl_gym.experiments.reproduce import chosen
from acl_gym.experiments.results import Run
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.study import Study
from acl_gym.partitions import Crisp, Discrete, Fuzzy

BY_NAME = {experiment.name: experiment for experiment in EXPERIMENTS}
PAIRS = [(name, method) for name, task in TASKS.items() for method in task.methods]
AGENTS = [(name, agent) for name, system in SYSTEMS.items() for agent in system.agents]


def brief_run(study: Study) -> Run:
    brief = study.brief()
    found = run(brief, 0)
    assert found.failure == ""
    assert np.all(np.diff(found.rows["env_steps"]) > 0)
    highest = brief.task.highest_cost * (1 + 1e-12)
    assert found.rows["policy_cost"].between(0, highest).all()
    return found


@pytest.mark.parametrize(("name", "method"), PAIRS)
def test_every_method_runs_on_every_task(name: str, method: str) -> None:
    found, again = (brief_run(tuned(name, method)) for _ in range(2))
    assert found.rows["policy_cost"].equals(again.rows["policy_cost"])
    assert np.array_equal(found.table, again.table)


@pytest.mark.parametrize(("name", "agent"), AGENTS)
def test_every_agent_of_the_command_runs(name: str, agent: str) -> None:
    brief_run(SYSTEMS[name].study(agent, "quick"))


def test_systems_are_those_of_the_thesis() -> None:
    kinds = {"fuzzy": Fuzzy, "crisp": (Crisp, Discrete)}
    found = {}
    for name, system in SYSTEMS.items():
        studies = {each: system.study(each, "quick") for each in system.agents}
        env = system.colony.task.make_system_env(1)
        for agent, (_, method, kind) in system.agents.items():
            if method not in FORGETTING:
                continue
            study, partition = studies[agent], studies[agent].make_partition()
            assert isinstance(partition, kinds[kind])
            partition.check_space(env.single_observation_space)
            assert study.task.longest_evaluation == study.settings["max_steps"]
            found[name] = (partition.n_cells, study.slots, study.trials)
            if (
                method == "acl" and name != "grid"
            ):  # the thesis names no tabu list there
                assert study.settings == system.colony.settings
    assert found == {
        "pendulum": (1640, 250, 100),
        "navigation": (729, 200, 200),
        "row": (10, 9, 100),
        "grid": (87, 86, 200),
    }


def test_settings_of_dqn_are_some_of_it() -> None:
    from acl_gym.sb3.dqn import LONG_RUN, DQNSettings

    pendulum = SYSTEMS["pendulum"]
    for preset, wanted in (("quick", DQNSettings()), ("full", LONG_RUN)):
        assert DQNSettings(**pendulum.study("dqn", preset).settings) == wanted
    navigation = SYSTEMS["navigation"].study("dqn", "full").settings
    assert navigation == {
        "reward_scale": 1.0,
        "exploration_fraction": 0.02,
        "final_learning_rate": 1e-5,
    }
    for name in PLAIN:
        settings = DQNSettings(**tuned(name, "dqn").settings)
        assert settings.final_learning_rate == settings.learning_rate


def test_networks_have_settings_and_take_about_as_long() -> None:
    from acl_gym.sb3.models import MODELS

    for name, task in PLAIN.items():
        steps = {method: tuned(name, method).steps for method in NETWORKS}
        assert steps == {
            "dqn": task.dqn_steps,
            "ppo": ON_POLICY * task.dqn_steps,
            "a2c": ON_POLICY * task.dqn_steps,
        }
        for method in NETWORKS:
            MODELS[method].settings(**tuned(name, method).settings)


def test_the_returning_colony_has_its_defaults_everywhere() -> None:
    """But for the longest walk, which is that of the system, and where cells are given."""
    for name, task in TASKS.items():
        study = tuned(name, "returning")
        agent = make_agent(replace(study, slots=2), 0)
        assert isinstance(agent, ReturningACL)
        plain = ReturningACL(
            task.task.make_env(2), agent.partition, max_steps=agent.max_steps, seed=0
        )
        wanted = {**plain.parameters(), "grows": study.kind == "growing"}
        assert agent.parameters() == wanted
        assert (study.kind == "growing") == (not task.system.finite and not task.cells)
        assert not is_tuned(name, "returning")


def test_a_policy_of_a_partition_that_has_grown_is_restored(tmp_path: Path) -> None:
    study = SYSTEMS["pendulum"].study("returning", "smoke")
    job, store = Job(study, 0), Store(tmp_path)
    store.write(job, run(study, 0), {})
    found = store.read(job)
    assert found is not None
    policy = restore_policy(study, found)
    assert policy.partition.n_cells > study.make_partition().n_cells
    env, states = study.task.evaluation_env()
    cost = evaluate_policy_cost(policy, env, states).cost
    # Ties, where nothing was tried yet, are broken in another order.
    assert cost == pytest.approx(found.rows["policy_cost"].iloc[-1], rel=0.05)


def test_names_of_agents() -> None:
    names = agent_names(finite=False)
    assert agents_called("acl", names) == ["acl-fuzzy", "acl-crisp"]
    assert agents_called("returning", names) == ["returning"]
    assert {"returning-fuzzy", "returning-crisp", *REMEMBERING, *NETWORKS} < set(names)
    assert agents_called("returning", agent_names(finite=True)) == ["returning-crisp"]
    assert agents_called("sarsa", names) == []


def test_a_kind_of_partition_may_have_settings_of_its_own() -> None:
    rates = {
        agent: SYSTEMS["navigation"].study(agent, "quick").settings["learning_rate"]
        for agent in ("q-fuzzy", "q-crisp", "q-lambda-fuzzy", "q-lambda-crisp")
    }
    assert list(rates.values()) == [0.3, 0.1, 0.3, 0.1]


def test_an_agent_that_a_system_does_not_have() -> None:
    with pytest.raises(ValueError, match="agent must be one of 'acl-crisp'"):
        SYSTEMS["row"].study("acl-fuzzy", "quick")


def test_budgets_are_what_the_help_promises() -> None:
    assert PRESETS["full"] >= 10
    assert SYSTEMS["pendulum"].budgets["full"].dqn_steps >= 200_000
    for system in SYSTEMS.values():
        assert set(system.budgets) == set(PRESETS)


def test_references_are_exact_on_the_grids_and_near_the_optimum_else() -> None:
    costs = {
        name: run(SYSTEMS[name].reference("smoke"), 0).rows["policy_cost"].iloc[-1]
        for name in ("row", "grid", "pendulum")
    }
    assert costs["row"] == 5.0
    assert costs["grid"] == pytest.approx(859 / 86)
    assert costs["pendulum"] == pytest.approx(39.0, abs=0.7)
    # On the agents' own cells even dynamic programming fails from most states.
    coarse = run(SYSTEMS["pendulum"].planned([40, 41]), 0).rows.iloc[-1]
    assert coarse["policy_cost"] > 1.2 * costs["pendulum"]
    assert coarse["success_rate"] < 0.6


def test_what_makes_a_task_harder_is_all_that_differs() -> None:
    plain, partial = PLAIN["navigation"], TASKS["navigation-hidden"]
    assert partial.task.make_partition("fuzzy").n_cells == 9 * 3 * 9
    assert {**asdict(partial.task), "perturbations": {}} == asdict(plain.task)
    slippery = TASKS["grid-p0.5"].study("acl", {})
    assert slippery.settings["max_steps"] == 2 * SYSTEMS["grid"].max_steps
    assert len(slippery.task.evaluation_states()) == 3 * 86
    for name, cost in EPISODE_COSTS.items():
        study = TASKS[f"pendulum-{name}"].study("acl", {})
        assert study.task.highest_cost == cost.ceiling
        assert make_agent(study, 0).cost == cost.cost  # type: ignore[attr-defined]
        assert study.settings["tau0"] == 1e-3


def test_costs_of_whole_episodes() -> None:
    episodes = Episodes(
        observations=np.array(
            [[[0.0, 1.0]], [[0.0, -5.0]], [[0.0, 2.0]], [[0.0, 9.0]]]
        ),
        actions=np.array([[0], [1], [0]]),
        stage_costs=np.ones((3, 1)),
        lengths=np.array([2]),
        terminated=np.array([False]),
    )
    assert Switches()(episodes).tolist() == [1.0]
    assert Peak(1)(episodes).tolist() == [5.0]
    assert EPISODE_COSTS["switches"].cost(episodes)[0] == pytest.approx(0.2 + 0.5)


def test_a_run_that_breaks_down_costs_the_most(monkeypatch) -> None:
    def overflow(agent: QLearning) -> None:
        if agent.trials == 2:
            raise ValueError("values have overflowed")

    study = replace(tuned("row", "q"), steps=500)
    run(study, 0)  # compiled, and none fails by itself
    monkeypatch.setattr(QLearning, "_check_values", overflow)
    found = run(study, 0)
    assert found.failure == "values have overflowed"
    assert found.rows["policy_cost"].iloc[-1] == study.task.highest_cost == 50.0
    assert found.rows["success_rate"].iloc[-1] == 0.0
    assert np.all(np.diff(found.rows["env_steps"]) > 0)


def test_the_order_of_ants_does_not_matter_and_that_of_q_learning_does() -> None:
    tables = {}
    for method in ("acl", "q"):
        study = TASKS["pendulum-10x11"].study(method, {"slots": 40, "max_steps": 60})
        study = replace(study, steps=6_000)
        both = [study, replace(study, reversed_slots=True)]
        tables[method] = [run(each, 1).table for each in both]
    np.testing.assert_allclose(*tables["acl"], rtol=1e-9)
    assert not np.allclose(*tables["q"], rtol=1e-3)


def test_experiments_of_the_tuned_comparison() -> None:
    harder = ("cells", "noise", "partial", "episode-costs")
    names = [*PLAIN, *harder, "slots", "order"]
    assert list(BY_NAME) == ["versus", *(f"versus-{name}" for name in names)]
    assert [each.name for each in chosen(["comparison"])] == list(BY_NAME)
    assert len(BY_NAME["versus"].everything) == 4 * (len(METHODS) + 1)
    assert BY_NAME["versus"].text.count("with the defaults") == 1
    for name in PLAIN:
        found = BY_NAME[f"versus-{name}"]
        assert list(found.studies) == [each.label for each in METHODS.values()]
        assert {each.most_runs for each in found.studies.values()} == {None}
    for name in (*harder, "slots", "order"):
        found = BY_NAME[f"versus-{name}"]
        assert {each.most_runs for each in found.everything} == {10}
    for name in harder:
        for row in BY_NAME[f"versus-{name}"].options["rows"].values():
            short, long = row["acl"], row[LONG]
            assert long == replace(short, steps=4 * short.steps)
            assert {
                row[m].task for m in TABLE_METHODS if row[m].task != short.task
            } == set()
    assert set(tuned_settings()) == set(TASKS)
