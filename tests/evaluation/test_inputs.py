"""Evaluation where actions are real inputs."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from acl_gym import (
    ActionGrid,
    FunctionCost,
    PolicyEvaluation,
    Quadratic,
    ReturningACL,
    Steps,
    VectorEnvAdapter,
    WaitingVectorEnv,
    evaluate_policy_cost,
)
from acl_gym.evaluation import actions_in, record_trajectory
from acl_gym.policies import InterpolatedPolicy


class Feedback:
    """A proportional controller of the thesis's pendulum near the top."""

    def __init__(self, gain: float = 0.5, dtype: Any = np.float64) -> None:
        self.gain, self.dtype = gain, dtype

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        error = observation[:, :1] - np.pi
        torque = -self.gain * error - 0.1 * observation[:, 1:]
        return np.clip(torque, -0.8, 0.8).astype(self.dtype), None


class Fixed:
    """Returns the same whatever it sees."""

    def __init__(self, found: Any) -> None:
        self.found = found

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        return self.found


def pendulum(num_envs: int = 1, **options: Any) -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs, continuous=True, **options)


@pytest.fixture(scope="module")
def policy() -> InterpolatedPolicy:
    agent = ReturningACL(ActionGrid(pendulum(5), 5), seed=0)
    return agent.learn(total_timesteps=3_000).interpolated_policy()


def by_hand(model: Any, states: np.ndarray, max_steps: int) -> np.ndarray:
    """Costs of the episodes, in single environments."""
    env, costs = gym.make("acl_gym/Pendulum-v0", continuous=True), []
    for state in states:
        observation, _ = env.reset(options={"state": state})
        cost, over, steps = 0.0, False, 0
        while not over and steps < max_steps:
            torque = model.predict(observation[None], deterministic=True)[0][0]
            observation, reward, over, _, _ = env.step(torque)
            cost, steps = cost - reward, steps + 1
        costs.append(cost)
    return np.array(costs)


def test_costs_are_those_of_single_environments(policy: InterpolatedPolicy) -> None:
    states = np.random.default_rng(0).uniform([0, -5], [6, 5], (6, 2))
    for model in (policy, Feedback(), Feedback(dtype=np.float32)):
        result = evaluate_policy_cost(model, pendulum(), states, max_steps=40)
        np.testing.assert_allclose(result.costs, by_hand(model, states, 40), rtol=1e-12)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_every_mode_of_autoreset(mode: str, policy: InterpolatedPolicy) -> None:
    """Slots that finish early are stepped on with what they had."""
    envs = SyncVectorEnv(
        [lambda: gym.make("acl_gym/Pendulum-v0", continuous=True)] * 6,
        autoreset_mode=gym.vector.AutoresetMode(mode),
    )
    found = evaluate_policy_cost(policy, envs, seed=4, max_steps=50)
    waiting = WaitingVectorEnv.make("acl_gym/Pendulum-v0", 6, continuous=True)
    wanted = evaluate_policy_cost(policy, waiting, seed=4, max_steps=50)
    np.testing.assert_array_equal(found.costs, wanted.costs)
    np.testing.assert_array_equal(found.lengths, wanted.lengths)
    assert len(set(found.lengths.tolist())) > 1


def test_a_fine_grid_comes_to_the_same_as_rounding_by_hand() -> None:
    """A policy over a grid, evaluated without it, sets what the grid would have set."""
    agent = ReturningACL(ActionGrid(pendulum(5), 5), seed=0)
    agent.learn(total_timesteps=1_000)
    values = agent.env.values

    class Rounded:
        def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
            return values[agent.predict(observation)[0]], None

    found = evaluate_policy_cost(Rounded(), pendulum())
    wanted = evaluate_policy_cost(agent, agent.env)
    np.testing.assert_array_equal(found.costs, wanted.costs)


def test_costs_of_complete_solutions_see_the_inputs(policy: InterpolatedPolicy) -> None:
    states = np.random.default_rng(1).uniform([0, -5], [6, 5], (7, 2))
    options: dict[str, Any] = {"states": states, "max_steps": 30}
    stage = evaluate_policy_cost(policy, pendulum(), **options)
    weighed = Quadratic(
        goal=(np.pi, 0.0),
        state_weight=(1.0, 0.1),
        inputs=((-0.8,), (0.8,)),
        input_weight=(0.05,),
    )
    found = evaluate_policy_cost(policy, pendulum(), cost=weighed, **options)
    np.testing.assert_allclose(found.costs, stage.costs, rtol=1e-9)
    lengths = evaluate_policy_cost(policy, pendulum(), cost=Steps(), **options)
    np.testing.assert_array_equal(lengths.costs, stage.lengths)

    def effort(episode: Any) -> float:
        assert episode.actions.shape == (len(episode.stage_costs), 1)
        return float(np.abs(episode.actions).sum())

    spent = evaluate_policy_cost(
        policy, pendulum(), cost=FunctionCost(effort), **options
    )
    assert (spent.costs <= 0.8 * spent.lengths + 1e-12).all()
    assert (spent.costs > 0.0).any()


def test_trajectories_and_maps(policy: InterpolatedPolicy) -> None:
    path = record_trajectory(policy, pendulum(), np.zeros(2))
    assert path.actions.shape == (len(path.costs), 1)
    torques, _ = policy.predict(path.states[:-1])
    np.testing.assert_array_equal(path.actions, torques)
    states = np.random.default_rng(0).uniform([0, -9], [6, 9], (20, 2))
    np.testing.assert_array_equal(
        actions_in(policy, pendulum(), states), policy.predict(states)[0]
    )


def test_the_callback_evaluates_and_keeps_the_best() -> None:
    agent = ReturningACL(ActionGrid(pendulum(5), 3), seed=0)
    watched = PolicyEvaluation(
        pendulum(), every=1, policy=lambda each: each.interpolated_policy()
    )
    agent.learn(total_timesteps=2_000, callback=watched)
    costs = [row["policy_cost"] for row in agent.history]
    assert watched.best is not None
    assert watched.best.cost == min(costs)
    again = evaluate_policy_cost(watched.best_policy, pendulum())
    assert again.cost == min(costs)


def test_stable_baselines3_evaluates_it(policy: InterpolatedPolicy) -> None:
    evaluation = pytest.importorskip("stable_baselines3.common.evaluation")
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    adapted = VectorEnvAdapter(pendulum(3, max_episode_steps=40))
    single = vec_env.DummyVecEnv(
        [lambda: gym.make("acl_gym/Pendulum-v0", continuous=True, max_episode_steps=40)]
    )
    for env in (adapted, single):
        returns, lengths = evaluation.evaluate_policy(
            policy, env, n_eval_episodes=4, return_episode_rewards=True, warn=False
        )
        assert len(returns) == 4
        assert max(lengths) <= 40
        assert max(returns) < 0.0


@pytest.mark.parametrize(
    ("found", "match"),
    [
        ((np.zeros(2, dtype=np.int64), None), "interpolated_policy"),
        ((np.full((2, 1), np.nan), None), "within"),
        ((np.full((2, 1), 0.81), None), r"\[-0.8, 0.8\], got 0.81"),
        ((np.zeros((2, 2)), None), r"shape \(2, 1\)"),
        ((np.zeros(3), None), r"shape \(2, 1\)"),
        (np.zeros((2, 1)), r"\(actions, state\)"),
        (("ab", None), "floats"),
    ],
)
def test_what_a_model_must_not_return(found: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        evaluate_policy_cost(Fixed(found), pendulum(), np.zeros((2, 2)))


def test_inputs_of_one_axis_may_be_a_row() -> None:
    result = evaluate_policy_cost(
        Fixed((np.zeros(2), None)), pendulum(), np.ones((2, 2)), max_steps=5
    )
    assert result.lengths.tolist() == [5, 5]


def test_numbered_actions_refuse_it_with_a_remedy(policy: InterpolatedPolicy) -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1)
    with pytest.raises(ValueError, match="continuous=True"):
        evaluate_policy_cost(policy, env)
    with pytest.raises(ValueError, match="ActionGrid"):
        ReturningACL(pendulum(), seed=0)
