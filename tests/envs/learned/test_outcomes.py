"""Cost and ends of episodes learned from what was recorded."""

from __future__ import annotations

import copy

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import Transitions
from acl_gym.envs.learned.outcomes import LearnedCost, LearnedGoal, can_be_learned
from tests.envs.learned.recordings import line, pendulum


def test_the_cost_of_the_pendulum_is_that_of_the_next_state() -> None:
    cost = LearnedCost(pendulum(120))
    assert cost.of_next_state
    assert cost.error < 1e-3  # it is quadratic
    env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=10)
    other = Transitions.record(env, 200, seed=9)
    assert other.rewards is not None
    found = cost(
        other.states.T.copy(), other.next_states.T.copy(), other.inputs.T.copy()
    )
    assert np.abs(found + other.rewards).max() < 0.05  # of up to 18
    assert copy.deepcopy(cost) is cost


def test_gymnasium_rewards_the_state_that_a_step_begins_in() -> None:
    data = Transitions.record(gym.make("Pendulum-v1"), 200, seed=0)
    cost = LearnedCost(data)
    assert not cost.of_next_state
    assert cost.error < 1e-3


def test_without_rewards_there_is_nothing_to_learn() -> None:
    with pytest.raises(ValueError, match="a cost can be learned from rewards only"):
        LearnedCost(Transitions(**line()))


def test_too_few_rewards_are_called_too_few() -> None:
    with pytest.raises(
        ValueError, match="from 5 steps or more, got 3; record more, or"
    ):
        LearnedCost(pendulum(60)[:3])


def test_ends_behind_thresholds_are_found() -> None:
    """A pole has fallen beyond 12 degrees, a cart has left beyond 2.4."""
    env = gym.make("CartPole-v1")
    data = Transitions.record(env, 1_000, seed=0)
    goal = LearnedGoal(data)
    assert goal.n_ends == int(np.asarray(data.terminated).sum())
    assert goal.recall > 0.8
    assert goal.precision is not None
    assert goal.precision > 0.8
    angles = np.radians([0.0, 5.0, 13.0, -13.0, 20.0])
    x = np.zeros((4, 5))
    x[2] = angles
    assert goal(x).tolist() == [False, False, True, True, True]
    assert copy.deepcopy(goal) is goal


def test_without_ends_there_is_nothing_to_learn() -> None:
    none = Transitions(**line(), terminated=np.zeros(40))
    for data in (
        none,
        Transitions(**line()),
        Transitions(**line(), terminated=np.ones(40)),
    ):
        assert not can_be_learned(data)
        with pytest.raises(ValueError, match="a goal can be learned only where"):
            LearnedGoal(data)
