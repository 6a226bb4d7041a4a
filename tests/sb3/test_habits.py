"""What users of Stable-Baselines3 do every day, on our environments and agents."""

from __future__ import annotations

import re
from collections.abc import Callable
from inspect import signature
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.callbacks import (
    CheckpointCallback,
    EvalCallback,
    StopTrainingOnRewardThreshold,
)
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    SubprocVecEnv,
    VecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

import acl_gym
from acl_gym import ACL, QLearning, VectorEnvAdapter
from acl_gym.envs import ENVIRONMENTS

PENDULUM, GRID = "acl_gym/Pendulum-v0", "acl_gym/GridSearch2D-v0"
LIMIT = 12  # steps an episode, fewer than the ids have: several fit into a run
EVERY_ID = pytest.mark.parametrize("env_id", ENVIRONMENTS)
# Stable-Baselines3 knows no masks, and one id takes no action that its mask rules out.
LENIENT_ID = pytest.mark.parametrize(
    "env_id", [each for each in ENVIRONMENTS if "TravellingSalesman" not in each]
)
ALGORITHMS: list[tuple[Any, dict[str, Any]]] = [
    (PPO, {"n_steps": 16, "batch_size": 16}),
    (A2C, {}),
    (DQN, {"learning_starts": 16, "buffer_size": 500}),
]
EVERY_ALGORITHM = pytest.mark.parametrize(
    ("algorithm", "settings"), ALGORITHMS, ids=[kind.__name__ for kind, _ in ALGORITHMS]
)


def single(env_id: str = PENDULUM, **keywords: Any) -> Any:
    return Monitor(gym.make(env_id, max_episode_steps=LIMIT, **keywords))


def vector(env_id: str = PENDULUM, slots: int = 2) -> VecEnv:
    """Just as `gym.make_vec` makes it."""
    env = gym.make_vec(env_id, num_envs=slots, max_episode_steps=LIMIT)
    return VecMonitor(VectorEnvAdapter(env))


def model(algorithm: Any, env: Any, settings: dict[str, Any]) -> Any:
    return algorithm("MlpPolicy", env, seed=0, device="cpu", **settings)


# --- environments ------------------------------------------------------------------


@LENIENT_ID
@pytest.mark.parametrize("wrapped", [True, False])
def test_the_checker_finds_nothing(env_id: str, wrapped: bool) -> None:
    """Its warnings would be errors here."""
    env = gym.make(env_id, max_episode_steps=LIMIT)
    check_env(env if wrapped else env.unwrapped)


@EVERY_ALGORITHM
@pytest.mark.parametrize("make", [single, vector])
@pytest.mark.parametrize("env_id", [PENDULUM, GRID])
def test_learn_predict_save_evaluate(
    algorithm: Any,
    settings: dict[str, Any],
    make: Callable[..., Any],
    env_id: str,
    tmp_path: Path,
) -> None:
    env = make(env_id)
    agent = model(algorithm, env, settings).learn(64)
    assert agent.num_timesteps >= 64
    assert len(agent.ep_info_buffer) >= 64 // LIMIT - 2
    lengths = [episode["l"] for episode in agent.ep_info_buffer]
    assert 1 <= min(lengths) <= max(lengths) <= LIMIT
    mean, _ = evaluate_policy(agent, env, n_eval_episodes=3)
    assert -np.inf < mean < 0
    observation, _ = gym.make(env_id).reset(seed=1)
    expected = agent.predict(observation, deterministic=True)[0]
    agent.save(tmp_path / "agent")
    loaded = algorithm.load(tmp_path / "agent")
    np.testing.assert_array_equal(
        loaded.predict(observation, deterministic=True)[0], expected
    )


@pytest.mark.parametrize("make", [single, vector])
def test_callbacks(make: Callable[..., Any], tmp_path: Path) -> None:
    evaluation = EvalCallback(
        make(),
        n_eval_episodes=3,
        eval_freq=10,
        log_path=str(tmp_path),
        best_model_save_path=str(tmp_path),
        verbose=0,
    )
    checkpoint = CheckpointCallback(save_freq=10, save_path=str(tmp_path))
    agent = model(DQN, make(), {"learning_starts": 16, "buffer_size": 500})
    agent.learn(60, callback=[evaluation, checkpoint])
    found = np.load(tmp_path / "evaluations.npz")
    assert found["results"].shape == (len(found["timesteps"]), 3)
    assert (found["ep_lengths"] <= LIMIT).all()
    assert evaluation.best_mean_reward == found["results"].mean(axis=1).max()
    DQN.load(tmp_path / "best_model")
    assert len(list(tmp_path.glob("rl_model_*_steps.zip"))) == agent.num_timesteps // (
        10 * agent.n_envs
    )


def test_training_stops_at_a_threshold() -> None:
    # No episode of 12 steps costs more than 12 (pi^2 + 0.1 * 9^2) = 216.
    stop = StopTrainingOnRewardThreshold(reward_threshold=-250.0, verbose=0)
    evaluation = EvalCallback(
        single(), stop, n_eval_episodes=1, eval_freq=20, verbose=0
    )
    agent = model(A2C, single(), {}).learn(1_000, callback=evaluation)
    assert agent.num_timesteps == 20


# --- what rl_zoo3 does -------------------------------------------------------------


def test_normalised_observations_are_saved_and_loaded(tmp_path: Path) -> None:
    env = VecNormalize(make_vec_env(single, 2))
    agent = model(PPO, env, {"n_steps": 16, "batch_size": 32}).learn(64)
    env.save(str(tmp_path / "scaling.pkl"))
    again = VecNormalize.load(str(tmp_path / "scaling.pkl"), vector())
    again.training = again.norm_reward = False
    np.testing.assert_array_equal(again.obs_rms.mean, env.obs_rms.mean)
    observations = again.reset()
    assert np.abs(observations).max() <= again.clip_obs
    assert agent.predict(observations)[0].shape == (2,)


@pytest.mark.parametrize("make", [lambda: make_vec_env(single, 2), vector])
def test_stacked_observations(make: Callable[[], VecEnv]) -> None:
    env = VecFrameStack(make(), 3)
    assert env.reset().shape == (2, 6)
    agent = model(DQN, env, {"learning_starts": 16, "buffer_size": 500}).learn(64)
    assert agent.num_timesteps == 64


def test_keywords_of_the_environment() -> None:
    env = make_vec_env(
        f"acl_gym:{PENDULUM}", 2, env_kwargs={"substeps": 2, "max_episode_steps": 5}
    )
    assert [each.substeps for each in env.get_attr("system")] == [2, 2]
    model(A2C, env, {}).learn(20)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["forkserver", "spawn"])
def test_environments_in_processes(start: str) -> None:
    """A process that has imported nothing finds the id by the module in front of it."""
    env = make_vec_env(
        f"acl_gym:{PENDULUM}",
        2,
        env_kwargs={"max_episode_steps": LIMIT},
        vec_env_cls=SubprocVecEnv,
        vec_env_kwargs={"start_method": start},
    )
    env.seed(3)
    first = env.reset()
    here = [gym.make(PENDULUM).reset(seed=3 + slot)[0] for slot in range(2)]
    np.testing.assert_array_equal(first, here)
    agent = model(A2C, env, {}).learn(40)
    assert len(agent.ep_info_buffer) == 2 * (40 // 2 // LIMIT)
    env.close()


# --- our agents --------------------------------------------------------------------


@LENIENT_ID
@pytest.mark.parametrize("kind", [ACL, QLearning])
def test_our_agents_under_evaluate_policy(env_id: str, kind: Any) -> None:
    agent = kind(gym.make_vec(env_id, num_envs=4), seed=0, max_steps=LIMIT)
    agent.learn(trials=2)
    for env in (
        single(env_id),
        vector(env_id),
        make_vec_env(lambda: single(env_id), 2),
    ):
        returns, lengths = evaluate_policy(
            agent, env, n_eval_episodes=3, return_episode_rewards=True
        )
        assert len(returns) == 3
        assert max(returns) <= 0
        assert 1 <= min(lengths) <= max(lengths) <= LIMIT


@pytest.mark.parametrize("kind", [ACL, QLearning])
@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("EvalCallback", "PolicyEvaluation"),
        ("CheckpointCallback", "Checkpoint"),
        ("tensorboard_log", "TensorBoardLog"),
        ("progress_bar", "progress_bar"),
    ],
)
def test_learn_names_what_is_here_instead(kind: Any, theirs: str, ours: str) -> None:
    for name in (theirs, ours):
        assert re.search(rf"\b{name}\b", kind.learn.__doc__), name
    assert hasattr(acl_gym, ours) or ours in signature(kind.learn).parameters


# Tours cost more than the default tau0 is meant for.
@pytest.mark.filterwarnings("ignore::acl_gym.agents.bounds.PheromoneBoundWarning")
@EVERY_ID
@pytest.mark.parametrize("kind", [ACL, QLearning])
@pytest.mark.parametrize("deterministic", [True, False])
def test_actions_have_the_types_of_theirs(
    env_id: str, kind: Any, deterministic: bool
) -> None:
    env = gym.make_vec(env_id, num_envs=4)
    ours = kind(env, seed=0, max_steps=LIMIT)
    theirs = DQN("MlpPolicy", gym.make(env_id), buffer_size=10)
    batch, _ = env.reset(seed=0)
    for observation in (batch, batch[0]):
        mine, other = (
            agent.predict(observation, deterministic=deterministic)[0]
            for agent in (ours, theirs)
        )
        assert isinstance(mine, np.ndarray)
        assert mine.shape == other.shape
        assert mine.dtype == other.dtype == np.int64
