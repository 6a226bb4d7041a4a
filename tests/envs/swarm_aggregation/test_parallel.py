"""The view for PettingZoo."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

pytest.importorskip("pettingzoo")

from acl_gym.envs.swarm_aggregation import SwarmAggregationVectorEnv
from acl_gym.envs.swarm_aggregation.parallel import parallel_env

with warnings.catch_warnings():
    # It imports games whose modules warn that they are old.
    warnings.simplefilter("ignore", DeprecationWarning)
    from pettingzoo.test import parallel_api_test, parallel_seed_test


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"num_agents": 1},
        {"num_agents": 4, "followers": 3, "sensing_radius": 1.0, "max_cycles": 7},
        {"num_agents": 3, "continuous": True, "point_mass": True},
    ],
)
def test_pettingzoo_accepts_it(parameters: dict[str, Any]) -> None:
    parallel_api_test(parallel_env(**parameters), num_cycles=250)
    parallel_seed_test(lambda: parallel_env(**parameters), num_cycles=40)


def test_it_is_a_view_of_the_vector_environment() -> None:
    view = parallel_env(5, max_cycles=6, followers=2)
    env = SwarmAggregationVectorEnv(
        5, max_episode_steps=6, autoreset_mode="Disabled", followers=2
    )
    mine, infos = view.reset(seed=2)
    theirs, _ = env.reset(seed=2)
    assert view.agents == view.possible_agents == [f"agent_{i}" for i in range(5)]
    assert infos == {agent: {} for agent in view.agents}
    rng = np.random.default_rng(0)
    for step in range(6):
        for i, agent in enumerate(view.possible_agents):
            np.testing.assert_array_equal(mine[agent], theirs[i])
        row = rng.integers(0, 5, 5)
        # In any order of the names.
        chosen = {f"agent_{i}": row[i] for i in rng.permutation(5)}
        mine, rewards, terminated, truncated, infos = view.step(chosen)
        theirs, *others, told = env.step(row)
        for mapping, array in zip(
            (rewards, terminated, truncated), others, strict=True
        ):
            assert list(mapping.values()) == array.tolist()
        assert infos["agent_3"] == {
            "distance": told["distance"][3],
            "collisions": told["collisions"][3],
        }
        np.testing.assert_array_equal(view.state(), env.states)
        assert bool(view.agents) is (step < 5)
    with pytest.raises(ResetNeeded, match="no agents are in the world"):
        view.step({})


def test_states_and_actions() -> None:
    view = parallel_env(2)
    seen, _ = view.reset(options={"state": [[0.0, 0.0], [1.0, 1.0]], "other": 3})
    assert seen["agent_1"][:2].tolist() == [1.0, 1.0]
    for actions in ({"agent_0": 1}, {"agent_0": 1, "agent_1": 1, "agent_2": 1}):
        with pytest.raises(ValueError, match="one for each of 2 agents"):
            view.step(actions)
    with pytest.raises(ValueError, match=r"actions must lie in 0\.\.4"):
        view.step({"agent_0": 1, "agent_1": 9})
    assert view.action_space("agent_0") is not view.action_space("agent_1")
    assert view.observation_space("agent_0") == view.observation_space("agent_1")
    with pytest.raises(ValueError, match="max_cycles must be at least 1"):
        parallel_env(2, max_cycles=0)


def test_what_is_of_the_wrong_kind() -> None:
    view = parallel_env(3)
    with pytest.raises(TypeError, match="reset options must be a dict, got 3"):
        view.reset(options=3)
    view.reset(seed=0)
    with pytest.raises(TypeError, match="actions must be a dict with one for each"):
        view.step(None)
    with pytest.raises(TypeError, match="actions must be alike for all agents"):
        view.step({"agent_0": 0, "agent_1": [0, 1], "agent_2": 0})
    with pytest.raises(TypeError, match="no parameter 'num_envs'; use num_agents"):
        parallel_env(3, num_envs=3)
    with pytest.raises(TypeError, match="no parameter 'autoreset_mode'; use reset"):
        parallel_env(3, autoreset_mode="NextStep")


def test_a_picture() -> None:
    pytest.importorskip("pygame")
    view = parallel_env(3, render_mode="rgb_array")
    view.reset(seed=0)
    assert view.render().shape == (480, 480, 3)
    view.close()
