"""Slots that have finished wait, and nothing else differs from a `SyncVectorEnv`."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from acl_gym import ACL, QLearning, VectorEnvAdapter, WaitingVectorEnv


class Counter(gym.Env):
    """Terminates after so many steps; counts every call of `step`."""

    observation_space = gym.spaces.Discrete(100)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, length: int) -> None:
        self.length = length
        self.calls = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return 0, {"mask": self.length}

    def step(self, action):
        self.calls += 1
        self.time += 1
        return self.time, -1.0, self.time >= self.length, False, {"mask": self.time}


def counters(*lengths: int) -> WaitingVectorEnv:
    return WaitingVectorEnv([lambda n=n: Counter(n) for n in lengths])


def test_finished_slots_stand_still_and_are_not_stepped() -> None:
    env = counters(1, 3)
    env.reset(seed=0)
    seen = [env.step(np.zeros(2, dtype=np.int64)) for _ in range(3)]
    assert [step[0].tolist() for step in seen] == [[1, 1], [1, 2], [1, 3]]
    assert [step[1].tolist() for step in seen] == [[-1, -1], [0, -1], [0, -1]]
    ends = [step[2].tolist() for step in seen]
    assert ends == [[True, False], [False, False], [False, True]]
    assert [each.calls for each in env.envs] == [1, 3]
    assert seen[1][4]["_mask"].tolist() == [False, True]


def test_a_masked_reset_wakes_only_its_slots() -> None:
    env = counters(1, 1, 5)
    env.reset(seed=0)
    env.step(np.zeros(3, dtype=np.int64))
    observation, _ = env.reset(options={"reset_mask": np.array([True, False, False])})
    assert observation.tolist() == [0, 1, 1]
    env.step(np.zeros(3, dtype=np.int64))
    assert [each.calls for each in env.envs] == [2, 1, 2]


def test_what_it_returns_is_not_changed_by_the_next_step() -> None:
    env = counters(5, 5)
    first, _ = env.reset(seed=0)
    second = env.step(np.zeros(2, dtype=np.int64))[0]
    env.step(np.zeros(2, dtype=np.int64))
    assert first.tolist() == [0, 0]
    assert second.tolist() == [1, 1]


@pytest.mark.parametrize("make", [ACL, QLearning])
@pytest.mark.parametrize("env_id", ["FrozenLake-v1", "Taxi-v4", "MountainCar-v0"])
def test_agents_learn_the_same_as_in_a_sync_vector_env(make, env_id) -> None:
    def make_one() -> gym.Env:
        return gym.make(env_id, max_episode_steps=30)

    tables = []
    for env in (
        WaitingVectorEnv([make_one] * 5),
        SyncVectorEnv([make_one] * 5, autoreset_mode=AutoresetMode.DISABLED),
    ):
        rank = {"deposit": "rank"} if make is ACL else {}
        agent = make(env, seed=3, max_steps=30, **rank).learn(trials=4)
        assert agent.num_timesteps > 0
        tables.append(agent.table)
    np.testing.assert_array_equal(tables[0], tables[1])


def test_make_passes_keywords_on() -> None:
    env = WaitingVectorEnv.make("FrozenLake-v1", 3, is_slippery=False)
    env.reset(seed=0)
    # Down, down, right: always there without slipping.
    for action in (1, 1, 2):
        observation = env.step(np.full(3, action))[0]
    assert observation.tolist() == [9, 9, 9]


def test_stable_baselines_can_use_it() -> None:
    env = VectorEnvAdapter(counters(1, 3))
    env.reset()
    for _ in range(3):
        observation, _, done, infos = env.step(np.zeros(2, dtype=np.int64))
    assert done.tolist() == [True, True]
    assert infos[1]["terminal_observation"] == 3
    assert observation.tolist() == [0, 0]


def test_bad_numbers_of_slots_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one environment"):
        WaitingVectorEnv([])
    with pytest.raises(ValueError, match="num_envs"):
        WaitingVectorEnv.make("FrozenLake-v1", 0)
