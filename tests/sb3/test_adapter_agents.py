"""Monitors and agents of Stable-Baselines3 on environments behind the adapter."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

import acl_gym
from acl_gym.sb3.adapter import VectorEnvAdapter
from tests.sb3.vector_envs import MODES, pendulums, step

# --- monitors and statistics ---------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
def test_monitor_agrees_with_returns_by_hand(mode: str) -> None:
    env = VecMonitor(VectorEnvAdapter(pendulums(5, mode, max_episode_steps=7)))
    env.seed(0)
    env.reset()
    returns, lengths, finished = np.zeros(5), np.zeros(5, dtype=int), 0
    rng = np.random.default_rng(1)
    for _ in range(30):
        _, rewards, dones, infos = env.step(rng.integers(3, size=5))
        returns += rewards
        lengths += 1
        for slot in np.flatnonzero(dones):
            episode = infos[slot]["episode"]
            assert episode["r"] == pytest.approx(returns[slot], rel=1e-6)
            assert episode["l"] == lengths[slot]
            returns[slot] = lengths[slot] = 0
            finished += 1
        assert all(("episode" in infos[i]) == dones[i] for i in range(5))
    assert finished == env.episode_count >= 20


@pytest.mark.parametrize("mode", MODES)
def test_gymnasiums_statistics_come_through(mode: str) -> None:
    env = VectorEnvAdapter(
        RecordEpisodeStatistics(pendulums(3, mode, max_episode_steps=4))
    )
    env.seed(0)
    env.reset()
    total = np.zeros(3)
    for _ in range(4):
        _, rewards, dones, infos = step(env)
        total += rewards
    assert dones.all()
    for slot, info in enumerate(infos):
        assert info["episode"]["r"] == pytest.approx(total[slot])
        assert info["episode"]["l"] == 4


# --- the agents of Stable-Baselines3 -------------------------------------------------


class Push:
    """Always the same action: what `evaluate_policy` asks of a model, and no more."""

    def predict(
        self,
        observation: np.ndarray,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[np.ndarray, Any]:
        return np.full(len(observation), 2), state


@pytest.mark.parametrize("mode", MODES)
def test_evaluate_policy(mode: str) -> None:
    env = VectorEnvAdapter(pendulums(4, mode, max_episode_steps=10))
    monitored = VecMonitor(env)
    monitored.seed(2)
    rewards, lengths = evaluate_policy(
        Push(), monitored, n_eval_episodes=8, return_episode_rewards=True
    )
    assert lengths == [10] * 8
    monitored.seed(2)
    env.reset()
    by_hand = np.zeros(4)
    for _ in range(10):
        by_hand += step(env, 2)[1]
    np.testing.assert_allclose(rewards[:4], by_hand, rtol=1e-6)


def test_our_agents_under_evaluate_policy() -> None:
    env = pendulums(4, max_episode_steps=15)
    partition = acl_gym.Crisp.from_box(env.single_observation_space, (6, 5), [0])
    agent = acl_gym.ACL(env, partition, max_steps=15, seed=0).learn(trials=1)
    mean, _ = evaluate_policy(agent, VecMonitor(VectorEnvAdapter(env)), 6)
    assert mean < 0


@pytest.fixture(params=MODES)
def training_env(request: pytest.FixtureRequest) -> Iterator[VecEnv]:
    env = VecMonitor(VectorEnvAdapter(pendulums(4, request.param, max_episode_steps=9)))
    yield env
    env.close()


def test_dqn_learns_from_the_right_transitions(training_env: VecEnv) -> None:
    model = DQN("MlpPolicy", training_env, learning_starts=40, seed=0, device="cpu")
    model.learn(400)
    assert model.num_timesteps == 400
    assert len(model.ep_info_buffer) == 4 * (400 // 4 // 9)
    buffer = model.replay_buffer
    assert buffer.timeouts[8].tolist() == [1.0] * 4
    assert buffer.dones[8].tolist() == [1.0] * 4
    # Within an episode a next observation is the following one; across a reset not.
    np.testing.assert_array_equal(
        buffer.next_observations[:8], buffer.observations[1:9]
    )
    assert (buffer.next_observations[8] != buffer.observations[9]).all()


def test_ppo_learns(training_env: VecEnv) -> None:
    model = PPO(
        "MlpPolicy", training_env, n_steps=16, batch_size=32, seed=0, device="cpu"
    )
    model.learn(128)
    assert model.num_timesteps == 128
    assert len(model.ep_info_buffer) > 0
