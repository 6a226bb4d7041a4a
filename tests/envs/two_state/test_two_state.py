"""The system of Figure 3.2, whose few walks are all known."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from acl_gym import ACL, evaluate_policy_cost
from acl_gym.envs.two_state import TwoState, TwoStateVectorEnv, kernels

ENV_ID = "acl_gym/TwoState-v0"


def test_the_single_environment_keeps_gymnasiums_rules() -> None:
    check_env(gym.make(ENV_ID).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("action", [0, 1, 2])
def test_two_steps_lead_to_the_goal(action: int) -> None:
    env = gym.make(ENV_ID)
    seen, info = env.reset(seed=3)
    assert seen == 0
    assert info["action_mask"].tolist() == [True, False, False]
    seen, reward, terminated, truncated, info = env.step(0)
    assert (seen, reward, terminated, truncated) == (1, 0.0, False, False)
    assert info["action_mask"].all()
    seen, reward, terminated, truncated, _ = env.step(action)
    # Two steps are also the limit: both flags.
    assert (seen, reward, terminated, truncated) == (2, -[1, 2, 4][action], True, True)


def test_each_slot_is_like_the_single_environment() -> None:
    env = gym.make_vec(ENV_ID, num_envs=4, costs=(0.5, 0.7, 9.0))
    env.reset(options={"state": [0, 1, 1, 2], "finished": "wait"})
    seen, rewards, terminated, _, _ = env.step(np.array([2, 2, 1, 1]))
    assert seen.tolist() == [1, 2, 2, 2]
    assert rewards.tolist() == [0.0, -9.0, -0.7, 0.0]
    assert terminated.tolist() == [False, True, True, True]


def test_the_kernel_runs_the_same_without_the_compiler() -> None:
    states = np.array([0.0, 1.0, 1.0, 2.0])
    actions, costs = np.array([2, 0, 2, 1]), np.array([0.5, 0.7, 9.0])
    results = []
    for run in (kernels.advance, kernels.advance.py_func):
        arrays = states.copy(), np.empty(4), np.empty(4, dtype=np.bool_)
        run(arrays[0], actions, costs, *arrays[1:])
        results.append(b"".join(array.tobytes() for array in arrays))
    assert results[0] == results[1]


@pytest.mark.parametrize(
    "costs", [(1.0,), (1.0, 1.0), (2.0, 1.0), (0.0, 1.0), (1.0, np.inf), "12", ()]
)
def test_invalid_costs_are_refused(costs: Any) -> None:
    with pytest.raises(ValueError, match="costs must be"):
        TwoState(costs=costs)


@pytest.mark.parametrize("state", [3, -1, 0.5, np.nan, [[0]], "0"])
def test_invalid_states_are_refused(state: Any) -> None:
    env = gym.make(ENV_ID)
    with pytest.raises(ValueError, match="state"):
        env.reset(options={"state": state})


def test_frames_show_where_the_ant_is() -> None:
    pytest.importorskip("pygame")
    env = gym.make(ENV_ID, render_mode="rgb_array")
    env.reset()
    first = env.render()
    env.step(0)
    second = env.render()
    env.step(2)
    third = env.render()
    for one, other in ((first, second), (second, third)):
        assert (one != other).any()
    assert first[240, 72].tolist() == [213, 94, 0]
    assert second[240, 240].tolist() == [213, 94, 0]
    assert third[240, 408].tolist() == [213, 94, 0]


def test_a_colony_finds_the_best_action() -> None:
    env = gym.make_vec(ENV_ID, num_envs=3)
    settings = {"tau0": 1e-2, "max_steps": 2, "local_decay": 0.0}
    colony = ACL(env, seed=0, selection="epsilon_greedy", **settings)
    colony.learn(trials=60)
    assert evaluate_policy_cost(colony, env).cost == 1.0
    levels = colony.pheromone.levels
    assert (levels[0, 1:] == 1e-2).all(), "q has one action"
    assert (levels[2] == 1e-2).all(), "nobody acts in the goal"


def test_other_numbers_of_slots_walk_alike() -> None:
    env = TwoStateVectorEnv(3).with_slots(5)
    seen, _ = env.reset()
    assert seen.tolist() == [0] * 5
