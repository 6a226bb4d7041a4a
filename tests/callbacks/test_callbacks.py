"""Callbacks in all their forms, and the one that evaluates the policy."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import VectorEnv

from acl_gym import (
    ACL,
    Callback,
    Crisp,
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    evaluate_policy_cost,
)
from acl_gym.callbacks import as_callbacks
from tests.agents.reference_colony import chains

PENDULUM = "acl_gym/Pendulum-v0"
STATES = np.random.default_rng(0).uniform([0, -9], [6, 9], (12, 2))
BOTH = pytest.mark.parametrize("kind", [ACL, QLearning])


def pendulums(num_envs: int = 10) -> VectorEnv:
    return gym.make_vec(PENDULUM, num_envs=num_envs)


def make(kind: type = ACL, **parameters: float) -> Any:
    env = pendulums()
    grid = Fuzzy.from_box(env.single_observation_space, (6, 7), circular=[0])
    if kind is ACL:
        parameters = {"tau0": 1e-6, **parameters}
    return kind(env, grid, max_steps=30, seed=0, **parameters)


def test_every_form_becomes_a_list() -> None:
    one, other = Callback(), Callback()
    assert as_callbacks(None) == []
    assert as_callbacks([]) == []
    assert as_callbacks(one) == [one]
    assert as_callbacks((one, [other, None])) == [one, other]
    assert as_callbacks(iter([one, other])) == [one, other]
    (wrapped,) = as_callbacks(lambda agent, row: row["trial"] < 3)
    assert wrapped.on_trial_end(make(), {"trial": 2}) is not False
    assert wrapped.on_trial_end(make(), {"trial": 3}) is False


@pytest.mark.parametrize("callback", [1, 2.5, [None, 1], "early", b"stop"])
def test_everything_else_is_a_type_error(callback: Any) -> None:
    with pytest.raises(TypeError, match=r"callback must be .* or a list of those"):
        as_callbacks(callback)


@BOTH
@pytest.mark.parametrize("every", [1, 3])
def test_it_adds_the_cost_of_the_policy_every_few_trials_and_at_the_end(
    kind: type, every: int
) -> None:
    expected = []
    evaluation = PolicyEvaluation(pendulums(), STATES, every=every, max_steps=25)

    def note(agent: Any, row: dict[str, float]) -> None:
        expected.append(evaluate_policy_cost(agent, pendulums(), STATES, max_steps=25))

    agent = make(kind).learn(trials=7, callback=[note, evaluation])
    for trial, (row, result) in enumerate(zip(agent.history, expected, strict=True), 1):
        if trial % every == 0 or trial == 7:
            assert row["policy_cost"] == result.cost
            assert row["success_rate"] == result.success_rate
        else:
            assert "policy_cost" not in row
            assert "success_rate" not in row


@BOTH
def test_it_keeps_the_best_policy(kind: type) -> None:
    evaluation = PolicyEvaluation(pendulums(), STATES, max_steps=25)
    agent = make(kind).learn(trials=12, callback=evaluation)
    costs = [row["policy_cost"] for row in agent.history]
    assert evaluation.best is not None
    assert evaluation.best_policy is not None
    assert evaluation.best.cost == min(costs) < costs[-1]
    again = evaluate_policy_cost(
        evaluation.best_policy, pendulums(), STATES, max_steps=25
    )
    np.testing.assert_array_equal(again.costs, evaluation.best.costs)
    agent.set_table(evaluation.best_policy.table)
    back = evaluate_policy_cost(agent, pendulums(), STATES, max_steps=25)
    np.testing.assert_array_equal(back.costs, evaluation.best.costs)


def test_another_policy_of_the_agent_can_be_evaluated() -> None:
    """Also one that draws: it has a generator of its own, and learning is the same."""
    quiet, watched = make(), make()
    quiet.learn(trials=6)
    evaluation = PolicyEvaluation(
        pendulums(),
        STATES,
        max_steps=25,
        policy=lambda colony: colony.soft_policy(seed=3),
    )
    costs = []

    def note(agent: Any, row: dict[str, float]) -> None:
        soft = agent.soft_policy(seed=3)
        costs.append(evaluate_policy_cost(soft, pendulums(), STATES, max_steps=25).cost)

    watched.learn(trials=6, callback=[evaluation, note])
    assert quiet.table.tobytes() == watched.table.tobytes()
    assert [row["policy_cost"] for row in watched.history] == costs
    assert evaluation.best is not None
    assert evaluation.best.cost == min(costs)


def test_of_equally_good_policies_the_first_is_kept() -> None:
    """Without decay and deposit the policy, and so its cost, stays as it is."""
    agent = make(ACL, local_decay=0.0, global_decay=0.0)
    evaluation = PolicyEvaluation(pendulums(), STATES, max_steps=25)
    kept = []
    agent.learn(
        trials=3, callback=[evaluation, lambda *_: kept.append(evaluation.best)]
    )
    assert kept[0] is kept[1] is kept[2]
    assert len({row["policy_cost"] for row in agent.history}) == 1


@BOTH
def test_evaluating_does_not_change_what_is_learned(kind: type) -> None:
    quiet, watched = make(kind), make(kind)
    quiet.learn(trials=8)
    watched.learn(trials=8, callback=PolicyEvaluation(pendulums(), STATES))
    assert quiet.table.tobytes() == watched.table.tobytes()
    for row, other in zip(quiet.history, watched.history, strict=True):
        assert {**row, "seconds": 0} == {
            key: 0 if key == "seconds" else other[key] for key in row
        }


@BOTH
def test_it_may_evaluate_where_the_agent_learns(kind: type) -> None:
    """The very environment, also with as many slots as there are states."""
    quiet, watched, sized = make(kind), make(kind), make(kind)
    quiet.learn(trials=6)
    watched.learn(trials=6, callback=PolicyEvaluation(watched.env, STATES))
    sized.learn(trials=6, callback=PolicyEvaluation(sized.env, STATES[:10]))
    assert quiet.table.tobytes() == watched.table.tobytes() == sized.table.tobytes()


def test_by_default_it_takes_states_and_length_of_the_environment() -> None:
    evaluation = PolicyEvaluation(pendulums())
    make().learn(trials=1, callback=evaluation)
    assert evaluation.best is not None
    assert evaluation.best.costs.shape == (100,)
    assert evaluation.best.lengths.max() == 300


def test_on_a_foreign_environment_it_starts_from_random_states() -> None:
    agent = ACL(chains(4), Crisp([np.arange(6.0)]), tau0=1e-3, max_steps=20, seed=0)
    agent.learn(trials=40, callback=PolicyEvaluation(chains(9), every=20, max_steps=20))
    row = agent.history[-1]
    assert row["policy_return"] == -row["policy_cost"]
    assert "success_rate" not in row
    assert 1.0 <= row["policy_cost"] <= 5.0


def test_a_run_with_it_is_a_function_of_the_seed_on_a_foreign_environment() -> None:
    """The record of a seeded run must not hang on the evaluation's random states."""
    costs = []
    for _ in range(2):
        agent = ACL(chains(4), Crisp([np.arange(6.0)]), tau0=1e-3, max_steps=9, seed=0)
        agent.learn(trials=6, callback=PolicyEvaluation(chains(9), max_steps=9))
        costs.append([row["policy_cost"] for row in agent.history])
    assert costs[0] == costs[1]


@pytest.mark.parametrize("every", [2, 5])
def test_after_an_exception_a_row_keeps_the_cost_of_its_own_policy(
    every: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The interrupted trial has decayed the pheromone: not the policy of the row."""
    agent = make(ACL, local_decay=0.9)
    move, kept = agent.rollout.move, []

    def breaking(actions: np.ndarray) -> Any:
        if agent.trials == 2 and agent.rollout.steps == 15:
            raise RuntimeError("half-way through the third trial")
        return move(actions)

    monkeypatch.setattr(agent.rollout, "move", breaking)
    evaluation = PolicyEvaluation(pendulums(), STATES, every=every, max_steps=25)
    keep = lambda agent, row: kept.append(agent.policy.copy())  # noqa: E731
    with pytest.raises(RuntimeError, match="half-way"):
        agent.learn(trials=4, callback=[evaluation, keep])
    assert len(agent.history) == 2
    expected = evaluate_policy_cost(kept[-1], pendulums(), STATES, max_steps=25)
    costs = [row.get("policy_cost") for row in agent.history]
    assert costs == [None, expected.cost if every == 2 else None]


def test_training_that_fails_before_its_first_trial_has_no_row() -> None:
    bad = ACL(chains(2, reward=np.nan), Crisp([np.arange(6.0)]), max_steps=5)
    with pytest.raises(ValueError, match="finite"):
        bad.learn(trials=1, callback=PolicyEvaluation(chains(2)))
    assert bad.history == []


@pytest.mark.parametrize(
    ("every", "error"),
    [(0, ValueError), (-1, ValueError), (1.5, TypeError), ("2", TypeError)],
)
def test_bad_every(every: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="every"):
        PolicyEvaluation(pendulums(), every=every)


@pytest.mark.parametrize(
    ("max_steps", "error"), [(0, ValueError), (1.5, TypeError), ("2", TypeError)]
)
def test_a_bad_length_is_refused_before_training(
    max_steps: Any, error: type[Exception]
) -> None:
    with pytest.raises(error, match="max_steps"):
        PolicyEvaluation(pendulums(), max_steps=max_steps)
