"""The cost of a policy, against plain loops over the single environment."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import ACL, Crisp, Fuzzy, QLearning, evaluate_policy_cost
from acl_gym.colony.pheromone import mean_sensitivity
from acl_gym.evaluation import PolicyCost, actions_in, record_trajectory
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import Chain, chains

PENDULUM = "acl_gym/Pendulum-v0"
GOAL = {"goal_bounds": (1.0, 4.0)}
UPRIGHT = math.pi


def pendulums(num_envs: int, **parameters: Any) -> VectorEnv:
    return gym.make_vec(PENDULUM, num_envs=num_envs, **{**GOAL, **parameters})


class PushAlong:
    """Pushes in the direction of motion; keeps what it is asked."""

    def __init__(self, first_action: int = 0) -> None:
        self.first_action = first_action
        self.batches: list[int] = []

    def predict(self, observation: Any, *, deterministic: bool = False) -> Any:
        assert deterministic
        self.batches.append(len(observation))
        return (observation[:, 1] > 0) * 2 + self.first_action, None


class Always:
    """Always the same action."""

    def __init__(self, action: int) -> None:
        self.action = action

    def predict(self, observation: Any, *, deterministic: bool = False) -> Any:
        return np.full(len(observation), self.action), None


def plain_episode(
    model: Any, state: np.ndarray, max_steps: int
) -> tuple[float, bool, int, list[np.ndarray], list[int], list[float]]:
    env = gym.make(PENDULUM, **GOAL)
    observation, _ = env.reset(options={"state": state})
    states, actions, costs, reached = [observation], [], [], False
    while not reached and len(actions) < max_steps:
        action = int(model.predict(observation[None], deterministic=True)[0][0])
        observation, reward, reached, _, _ = env.step(action)
        states.append(observation)
        actions.append(action)
        costs.append(-float(reward))
    return sum(costs), reached, len(actions), states, actions, costs


STATES = np.random.default_rng(3).uniform([0, -9], [6.28, 9], (15, 2))


@pytest.mark.parametrize("max_steps", [1, 12])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_costs_are_those_of_plain_episodes(max_steps: int, mode: str) -> None:
    env = pendulums(4, autoreset_mode=mode)
    result = evaluate_policy_cost(PushAlong(), env, STATES, max_steps=max_steps)
    plain = [plain_episode(PushAlong(), state, max_steps) for state in STATES]
    costs, success, lengths = zip(*(episode[:3] for episode in plain), strict=True)
    np.testing.assert_allclose(result.costs, costs, rtol=1e-9)
    assert result.success.tolist() == list(success)
    assert result.lengths.tolist() == list(lengths)
    assert result.cost == pytest.approx(sum(costs) / 15)
    assert result.success_rate == sum(success) / 15
    assert 0 < result.success_rate < 1


def test_finished_episodes_are_not_asked_about() -> None:
    model = PushAlong()
    result = evaluate_policy_cost(model, pendulums(1), STATES, max_steps=12)
    walking = [int((result.lengths > t).sum()) for t in range(12)]
    assert model.batches == walking
    assert walking[0] == 15 > walking[-1]


def test_a_hand_made_case() -> None:
    """Upright and still, without torque: the goal after one step, at no cost."""
    states = np.array([[UPRIGHT, 0.0], [0.0, 0.0]])
    env = gym.make_vec(PENDULUM, num_envs=2)
    result = evaluate_policy_cost(Always(1), env, states, max_steps=20)
    # It hangs still for 20 steps, each costing the square of pi.
    assert result.costs == pytest.approx([0.0, 20 * math.pi**2])
    assert result.success.tolist() == [True, False]
    assert result.lengths.tolist() == [1, 20]
    assert result.cost == pytest.approx(10 * math.pi**2)
    assert result.success_rate == 0.5


def test_the_environment_itself_is_left_alone() -> None:
    """Fewer or more slots than states: a copy is evaluated, not what the user holds."""
    env = pendulums(4)
    first, _ = env.reset(seed=0)
    evaluate_policy_cost(PushAlong(), env, STATES, max_steps=5)
    np.testing.assert_array_equal(env.unwrapped.states, first)


def test_the_environments_own_states_and_length_are_the_default() -> None:
    env = gym.make_vec(PENDULUM, num_envs=3)
    result = evaluate_policy_cost(Always(1), env)
    states = env.unwrapped.system.evaluation_states()
    assert len(states) == len(result.costs) == 100
    assert result.lengths.max() == 300
    again = evaluate_policy_cost(Always(1), env, states, max_steps=300)
    np.testing.assert_array_equal(result.costs, again.costs)


def test_limits_of_the_environment_count() -> None:
    result = evaluate_policy_cost(
        Always(1), pendulums(1, max_episode_steps=7), STATES, max_steps=50
    )
    assert result.lengths.max() == 7
    assert not result.success[result.lengths == 7].all()


def test_a_wrapped_environment_needs_a_slot_for_each_state() -> None:
    expected = evaluate_policy_cost(PushAlong(), pendulums(1), STATES, max_steps=9)
    wrapped = RecordEpisodeStatistics(pendulums(15))
    result = evaluate_policy_cost(PushAlong(), wrapped, STATES, max_steps=9)
    np.testing.assert_array_equal(result.costs, expected.costs)
    for slots in (14, 16):
        wrong = RecordEpisodeStatistics(pendulums(slots))
        with pytest.raises(ValueError, match=rf"each of the 15 states, got {slots}"):
            evaluate_policy_cost(PushAlong(), wrong, STATES)


def test_states_cannot_be_set_in_foreign_environments() -> None:
    for env in (chains(15), pendulums(15, vectorization_mode="sync")):
        with pytest.raises(ValueError, match=r"only be set .*got SyncVectorEnv; leave"):
            evaluate_policy_cost(Always(1), env, STATES)


def test_a_foreign_environment_starts_where_its_seed_says() -> None:
    results = [
        evaluate_policy_cost(Always(6), chains(30, first_action=5), seed=seed)
        for seed in (4, 4, 5)
    ]
    starts = [Chain().reset(seed=4 + slot)[0][0] for slot in range(30)]
    np.testing.assert_array_equal(results[0].costs, 5 - np.array(starts))
    np.testing.assert_array_equal(results[0].lengths, results[0].costs)
    np.testing.assert_array_equal(results[0].costs, results[1].costs)
    assert (results[0].costs != results[2].costs).any()
    np.testing.assert_array_equal(results[0].returns, -results[0].costs)
    assert results[0].success is results[0].success_rate is None


def test_a_foreign_environment_is_left_after_300_steps() -> None:
    result = evaluate_policy_cost(Always(0), chains(2), seed=0)
    assert result.lengths.tolist() == [300, 300]
    assert result.mean_return == -300.0


@pytest.mark.parametrize(
    "states",
    [
        [[0.0, 0.0, 0.0]],
        [[math.nan, 0.0]],
        [[0.0, 20.0]],
        [0.0, 0.0],
        np.empty((0, 2)),
        [["a", "b"]],
    ],
)
def test_bad_states(states: Any) -> None:
    with pytest.raises(ValueError, match=r"state|slot|num_envs|omega"):
        evaluate_policy_cost(Always(1), pendulums(3), states)


@pytest.mark.parametrize(
    ("max_steps", "error"), [(0, ValueError), (-1, ValueError), (1.5, TypeError)]
)
def test_bad_length(max_steps: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="max_steps"):
        evaluate_policy_cost(Always(1), pendulums(3), STATES, max_steps=max_steps)


def test_a_single_environment_is_refused() -> None:
    with pytest.raises(TypeError, match="VectorEnv"):
        evaluate_policy_cost(Always(1), gym.make(PENDULUM), STATES)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", [None, "policy", ACL, 3.0])
def test_what_cannot_predict_is_refused_at_once(model: Any) -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1)
    with pytest.raises(TypeError, match="model must be an agent or a policy with"):
        evaluate_policy_cost(model, env)
    with pytest.raises(TypeError, match="model must be an agent or a policy with"):
        record_trajectory(model, env, np.zeros(2))
    with pytest.raises(TypeError, match="model must be an agent or a policy with"):
        actions_in(model, env, np.zeros((1, 2)))


def test_the_result_cannot_be_changed() -> None:
    result = PolicyCost(np.ones(2), None, np.ones(2, dtype=int), -np.ones(2))
    with pytest.raises(AttributeError):
        result.costs = np.zeros(2)  # type: ignore[misc]


# --- trajectories and actions --------------------------------------------------


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_trajectory_is_the_plain_episode(mode: str) -> None:
    env = pendulums(1, autoreset_mode=mode)
    for state in STATES[:6]:
        trajectory = record_trajectory(PushAlong(), env, state, max_steps=12)
        _, reached, length, states, actions, costs = plain_episode(
            PushAlong(), state, 12
        )
        assert trajectory.success == reached
        assert trajectory.states.shape == (length + 1, 2)
        np.testing.assert_allclose(trajectory.states, states, rtol=1e-9, atol=1e-9)
        assert trajectory.actions.tolist() == actions
        np.testing.assert_allclose(trajectory.costs, costs, rtol=1e-9)


def test_bad_environments_for_a_trajectory() -> None:
    with pytest.raises(ValueError, match="one slot, got 2"):
        record_trajectory(PushAlong(), pendulums(2), STATES[0])
    with pytest.raises(TypeError, match="of acl_gym"):
        record_trajectory(PushAlong(), chains(1), STATES[0])
    with pytest.raises(TypeError, match="of acl_gym"):
        actions_in(PushAlong(), chains(15), STATES)


def test_actions_in_some_states() -> None:
    actions = actions_in(PushAlong(), pendulums(15), STATES)
    np.testing.assert_array_equal(actions, (STATES[:, 1] > 0) * 2)


# --- measures of a row ---------------------------------------------------------


@given(
    st.integers(1, 8),
    st.integers(2, 5),
    st.floats(0.1, 20.0),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=60)
def test_sensitivity_is_that_of_the_equation(
    n_cells: int, n_actions: int, alpha: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    tau = np.exp(rng.normal(scale=3.0, size=(n_cells, n_actions)))
    tau[rng.random(n_cells) < 0.3] = 0.5  # ties: sensitivity 1
    policy = tau.argmax(axis=1)
    expected = reference.sensitivity(tau, alpha)
    assert mean_sensitivity(tau, policy, alpha) == pytest.approx(expected, rel=1e-12)
    assert mean_sensitivity.py_func(tau, policy, alpha) == pytest.approx(expected)
    assert 0.0 <= expected <= 1.0


def test_sensitivity_at_its_ends() -> None:
    grid = Crisp([np.arange(3.0)])
    colony = ACL(None, grid, n_actions=3)
    policy = colony.policy.best_actions()
    assert colony.measures(policy) == {"sensitivity": 1.0}
    colony.set_table(np.tile([1e-200, 1.0, 1e-300], (3, 1)))
    assert colony.measures(colony.policy.best_actions())["sensitivity"] == 0.0
    lone = ACL(None, grid, n_actions=1)
    assert lone.measures(lone.policy.best_actions()) == {"sensitivity": 0.0}


@pytest.mark.parametrize("kind", [ACL, QLearning])
def test_policy_variation_and_sensitivity_of_every_trial(kind: type) -> None:
    env = pendulums(10)
    grid = Fuzzy.from_box(env.single_observation_space, (5, 6), circular=[0])
    parameters = {"tau0": 1e-6, "alpha": 2.5} if kind is ACL else {}
    agent = kind(env, grid, max_steps=25, seed=1, **parameters)
    policies, tables = [agent.predict(grid.cell_states())[0]], []

    def note(agent: Any, row: dict[str, float]) -> None:
        policies.append(agent.predict(grid.cell_states())[0])
        tables.append(agent.table.copy())

    agent.learn(trials=8, callback=note)
    for k, row in enumerate(agent.history):
        changed = sum(policies[k + 1] != policies[k])
        assert row["policy_variation"] == pytest.approx(changed / 30)
        if kind is ACL:
            expected = reference.sensitivity(tables[k], 2.5)
            assert row["sensitivity"] == pytest.approx(expected, rel=1e-12)
        else:
            assert "sensitivity" not in row
    assert agent.history[0]["policy_variation"] > 0


def test_rewards_that_are_no_costs_are_shown_as_returns() -> None:
    returns = np.array([1.0, 3.0])
    result = PolicyCost(-returns, None, np.array([4, 20]), returns)
    assert repr(result) == "PolicyCost(mean_return=2, 2 episodes of 4 to 20 steps)"
    page = result._repr_html_()
    assert "lowest 1, median 2, highest 3" in page
    assert "cost" not in page
    steps = replace(result, costs=np.array([4.0, 20.0]))  # with a cost of the user
    assert "cost=12" in repr(steps)


def test_a_cost_says_what_it_is() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1)
    agent = ACL(env, seed=0)
    result = replace(
        evaluate_policy_cost(agent, env, np.zeros((1, 2)), max_steps=1),
        costs=np.array([1.0, 3.0]),
        success=np.array([True, False]),
        lengths=np.array([4, 20]),
    )
    line = "PolicyCost(cost=2, success_rate=50%, 2 episodes of 4 to 20 steps)"
    assert repr(result) == line
    page = result._repr_html_()
    assert "lowest 1, median 2, highest 3" in page
    assert ">50%<" in page
    one = replace(result, lengths=np.array([1]))
    assert repr(one).endswith(" 1 episode of 1 step)")
    none = replace(
        result, **dict.fromkeys(("costs", "success", "lengths"), np.empty(0))
    )
    assert repr(none) == "PolicyCost(no episodes)"
    assert "no episodes" in none._repr_html_()
