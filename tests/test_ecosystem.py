"""Around our environments and agents: Stable-Baselines3's and Gymnasium's own tools."""

from __future__ import annotations

import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from acl_gym import (
    ACL,
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    VectorEnvAdapter,
    evaluate_policy_cost,
)

PENDULUM = "acl_gym/Pendulum-v0"
BOTH = pytest.mark.parametrize("kind", [ACL, QLearning])


def make(kind: type = ACL, env: Any = None) -> Any:
    env = gym.make_vec(PENDULUM, num_envs=10) if env is None else env
    grid = Fuzzy.from_box(env.single_observation_space, (6, 7), circular=[0])
    parameters = {"tau0": 1e-6} if kind is ACL else {}
    return kind(env, grid, max_steps=30, seed=0, **parameters)


# --- Stable-Baselines3's evaluate_policy ---------------------------------------


@BOTH
def test_evaluate_policy_on_single_environments(kind: type) -> None:
    """Returns are -J of the same initial states."""
    agent = make(kind).learn(trials=10)
    started = []

    def single() -> Any:
        env = gym.make(PENDULUM, max_episode_steps=40)
        reset = env.reset

        def noted(**keywords: Any) -> Any:
            observation, info = reset(**keywords)
            started.append(observation)
            return observation, info

        env.reset = noted  # type: ignore[method-assign]
        return Monitor(env)

    vec_env = DummyVecEnv([single] * 3)
    vec_env.seed(0)
    returns, lengths = evaluate_policy(
        agent, vec_env, n_eval_episodes=3, return_episode_rewards=True
    )
    expected = evaluate_policy_cost(
        agent, gym.make_vec(PENDULUM, num_envs=3), np.array(started[:3]), max_steps=40
    )
    np.testing.assert_allclose(sorted(returns), sorted(-expected.costs), rtol=1e-4)
    assert sorted(lengths) == sorted(expected.lengths)


@BOTH
def test_evaluate_policy_on_the_adapter(kind: type) -> None:
    agent = make(kind).learn(trials=10)
    env = gym.make_vec(
        PENDULUM, num_envs=5, autoreset_mode="Disabled", max_episode_steps=40
    )
    vec_env = VecMonitor(VectorEnvAdapter(env))
    vec_env.seed(3)
    first = gym.make_vec(PENDULUM, num_envs=5).reset(seed=3)[0]
    returns, lengths = evaluate_policy(
        agent, vec_env, n_eval_episodes=5, return_episode_rewards=True
    )
    expected = evaluate_policy_cost(
        agent, gym.make_vec(PENDULUM, num_envs=5), first, max_steps=40
    )
    np.testing.assert_allclose(sorted(returns), sorted(-expected.costs), rtol=1e-4)
    assert sorted(lengths) == sorted(expected.lengths)


# --- Gymnasium's wrappers ------------------------------------------------------


class Film:
    """Stands in for moviepy, which is heavy: keeps what would have been encoded."""

    films: list[tuple[list[np.ndarray], float, str]]

    def __init__(self, frames: list[np.ndarray], fps: float) -> None:
        self.frames, self.fps = frames, fps

    def write_videofile(self, path: str, **options: Any) -> None:
        self.films.append((list(self.frames), self.fps, path))


@pytest.fixture
def films(
    monkeypatch: pytest.MonkeyPatch,
) -> list[tuple[list[np.ndarray], float, str]]:
    Film.films = []
    clip = types.ModuleType("moviepy.video.io.ImageSequenceClip")
    clip.ImageSequenceClip = Film  # type: ignore[attr-defined]
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, clip.__name__, clip)
    monkeypatch.setattr(sys.modules["moviepy"], "video", None, raising=False)
    return Film.films


def test_record_video_of_a_single_environment(films: Any, tmp_path: Path) -> None:
    env = wrappers.RecordVideo(
        gym.make(PENDULUM, render_mode="rgb_array", max_episode_steps=7),
        str(tmp_path / "videos"),
        episode_trigger=lambda episode: True,
        disable_logger=True,
    )
    for episode in range(2):
        env.reset(seed=episode)
        finished = False
        while not finished:
            _, _, terminated, truncated, _ = env.step(2)
            finished = terminated or truncated
    env.close()
    assert len(films) == 2
    for frames, fps, _ in films:
        assert fps == 10
        assert len(frames) == 8
        assert all(f.shape == (480, 480, 3) and f.dtype == np.uint8 for f in frames)
        assert (frames[0] != frames[-1]).any()


def test_record_video_of_a_vector_environment(films: Any, tmp_path: Path) -> None:
    env = vector_wrappers.RecordVideo(
        gym.make_vec(PENDULUM, num_envs=3, render_mode="rgb_array"),
        str(tmp_path / "videos"),
        step_trigger=lambda step: step == 1,
        video_length=4,
        disable_logger=True,
    )
    env.reset(seed=0)
    for _ in range(8):
        env.step(np.array([0, 1, 2]))
    env.close()
    ((frames, _, _),) = films
    assert len(frames) >= 4
    assert all(f.ndim == 3 and f.shape[2] == 3 and f.dtype == np.uint8 for f in frames)
    # Slots side by side in one picture.
    assert frames[0].shape[0] * frames[0].shape[1] >= 3 * 480 * 480


def test_statistics_of_a_single_environment() -> None:
    env = wrappers.RecordEpisodeStatistics(gym.make(PENDULUM, max_episode_steps=9))
    env.reset(seed=0)
    total = 0.0
    for _ in range(9):
        _, reward, _, truncated, info = env.step(2)
        total += reward
    assert truncated
    assert info["episode"]["l"] == 9
    assert info["episode"]["r"] == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@BOTH
def test_learning_on_recorded_statistics_is_learning(kind: type, mode: str) -> None:
    """The wrapper sees the trials, and nothing that is learned changes by a bit."""

    def pendulums() -> Any:
        return gym.make_vec(PENDULUM, num_envs=10, autoreset_mode=mode)

    plain = make(kind, pendulums()).learn(trials=8)
    recorded = vector_wrappers.RecordEpisodeStatistics(pendulums())
    watched = make(kind, recorded).learn(trials=8)
    assert plain.table.tobytes() == watched.table.tobytes()
    assert [{**row, "seconds": 0} for row in plain.history] == [
        {**row, "seconds": 0} for row in watched.history
    ]


def test_statistics_of_a_vector_environment_are_the_ants() -> None:
    env = vector_wrappers.RecordEpisodeStatistics(
        gym.make_vec(PENDULUM, num_envs=10, max_episode_steps=30)
    )
    costs = []
    make(env=env).learn(
        trials=3, callback=lambda a, row: costs.append(row["ants_cost"])
    )
    assert env.episode_count == 30
    returns = np.reshape(env.return_queue, (3, 10))
    np.testing.assert_allclose(-returns.mean(axis=1), costs, rtol=1e-5)


# --- a file is all that a policy needs -----------------------------------------


@BOTH
def test_a_file_alone_predicts_the_same_elsewhere(kind: type, tmp_path: Path) -> None:
    agent = make(kind)
    agent.metadata = {"env": PENDULUM, "note": ["any", 1, 2.5, None, {"deep": True}]}
    agent.learn(trials=10, callback=PolicyEvaluation(agent.env, max_steps=20))
    agent.save(tmp_path / "agent")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "agent.npz").rename(elsewhere / "moved.npz")
    states = np.random.default_rng(1).uniform([0, -9], [6, 9], (500, 2))
    np.save(elsewhere / "states.npy", states)
    code = f"""
import sys, numpy as np
from acl_gym import {kind.__name__} as Agent
agent = Agent.load("moved")
np.save("actions.npy", agent.predict(np.load("states.npy"))[0])
print(agent.metadata)
heavy = {{"torch", "matplotlib", "pygame", "typer"}} & set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=elsewhere,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == repr(agent.metadata)
    expected = agent.predict(states)[0]
    np.testing.assert_array_equal(np.load(elsewhere / "actions.npy"), expected)
