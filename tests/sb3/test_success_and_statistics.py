"""What Stable-Baselines3 reports of our episodes: returns, lengths and successes."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

from acl_gym import VectorEnvAdapter, WaitingVectorEnv
from acl_gym.envs import ENVIRONMENTS
from acl_gym.sb3.callback import PolicyCostCallback
from tests.sb3.vector_envs import MODES, step

ROW = "acl_gym/GridSearch1D-v0"
TINY: dict[type, dict[str, Any]] = {
    DQN: {"learning_starts": 16, "buffer_size": 500},
    PPO: {"n_steps": 16, "batch_size": 16, "n_epochs": 1},
    A2C: {"n_steps": 8},
}


class Always:
    """Takes one action for ever, so that some episodes never reach a goal."""

    def __init__(self, action: int) -> None:
        self.action = action

    def predict(self, observation: Any, *_: Any, **__: Any) -> tuple[Any, None]:
        return np.full(np.shape(observation)[:1] or (1,), self.action), None


# Stable-Baselines3 knows no masks, and one id takes no action that its mask rules out.
@pytest.mark.parametrize(
    "env_id", [each for each in ENVIRONMENTS if "TravellingSalesman" not in each]
)
def test_the_evaluation_loop_of_sb3_comes_to_an_end(env_id: str) -> None:
    env = Monitor(gym.make(env_id))
    model = DQN("MlpPolicy", env, learning_starts=10, buffer_size=50)
    _, lengths = evaluate_policy(model, env, 2, return_episode_rewards=True)
    assert max(lengths) <= gym.spec(env_id).max_episode_steps


@pytest.mark.parametrize("kind", TINY)
@pytest.mark.parametrize("form", ["single", "adapter"])
def test_agents_of_sb3_show_their_episodes(kind: type, form: str) -> None:
    env = gym.make(ROW, max_episode_steps=8)
    if form == "adapter":
        env = VectorEnvAdapter(
            gym.make_vec(
                ROW, num_envs=2, autoreset_mode="Disabled", max_episode_steps=8
            )
        )
    model = kind("MlpPolicy", env, seed=0, **TINY[kind]).learn(96)
    assert len(model.ep_info_buffer) >= 10
    for info in model.ep_info_buffer:
        assert info["r"] == -info["l"]  # each step costs 1
        assert 1 <= info["l"] <= 8
    assert len(model.ep_success_buffer) == len(model.ep_info_buffer)
    # Some walks arrive within the limit and some do not.
    assert 0 < np.mean(model.ep_success_buffer) < 1


def test_eval_callback_shows_successes(tmp_path: Any) -> None:
    callback = EvalCallback(
        Monitor(gym.make(ROW, max_episode_steps=9)),
        n_eval_episodes=6,
        eval_freq=32,
        log_path=str(tmp_path),
        verbose=0,
    )
    model = PPO("MlpPolicy", gym.make(ROW), seed=0, **TINY[PPO])
    model.learn(32, callback=callback)
    found = np.load(tmp_path / "evaluations.npz")
    assert found["successes"].shape == (1, 6)
    reached = found["ep_lengths"] < 9
    # A walk of 9 steps may arrive with the last one; a shorter one has arrived.
    assert (found["successes"] >= reached).all()


@pytest.mark.parametrize("mode", MODES)
def test_success_through_the_adapter(mode: str) -> None:
    env = VectorEnvAdapter(
        gym.make_vec(ROW, num_envs=3, autoreset_mode=mode, max_episode_steps=3)
    )
    env.set_options({"state": [8, 7, 0]})
    env.reset()
    assert "is_success" not in step(env, [1, 1, 1])[3][1]
    _, _, dones, infos = step(env, [1, 1, 1])
    assert dones[1]
    assert infos[1]["is_success"]
    _, _, dones, infos = step(env, [1, 0, 1])
    assert dones[2]
    assert not infos[2]["is_success"]
    assert infos[2]["episode"]["l"] == 3
    assert infos[2]["TimeLimit.truncated"]


@pytest.mark.parametrize("mode", MODES)
def test_the_adapter_counts_as_vec_monitor_does(mode: str) -> None:
    def make() -> VectorEnvAdapter:
        return VectorEnvAdapter(
            gym.make_vec(ROW, num_envs=4, autoreset_mode=mode, max_episode_steps=7)
        )

    ours, monitored = make(), VecMonitor(make())
    rng, episodes = np.random.default_rng(0), 0
    for each in (ours, monitored):
        each.seed(3)
        each.reset()
    for _ in range(60):
        actions = rng.integers(2, size=4)
        mine, theirs = step(ours, actions)[3], step(monitored, actions)[3]
        for info, other in zip(mine, theirs, strict=True):
            assert ("episode" in info) == ("episode" in other)
            if "episode" in info:
                episodes += 1
                for key in "rl":
                    assert info["episode"][key] == other["episode"][key]
                assert info["episode"]["t"] >= 0
    assert episodes > 30
    ours.reset()
    assert step(ours, rng.integers(2, size=4))[3][0].get("episode", {"l": 1})["l"] == 1


class Lasts(gym.Env[Any, Any]):
    """Ends by itself after some steps."""

    observation_space, action_space = gym.spaces.Discrete(50), gym.spaces.Discrete(2)

    def __init__(self, length: int) -> None:
        self.length = length

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[int, Any]:
        super().reset(seed=seed)
        self.t = 0
        return 0, {}

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        self.t += 1
        return self.t, -1.0, self.t >= self.length, False, {}


@pytest.mark.parametrize("waiting", [False, True])
def test_statistics_of_slots_that_walk_on_survive_resets(waiting: bool) -> None:
    slots = [lambda: Lasts(3), lambda: Lasts(7)]
    env = (
        WaitingVectorEnv(slots)
        if waiting
        else gym.vector.SyncVectorEnv(
            slots, autoreset_mode=gym.vector.AutoresetMode.DISABLED
        )
    )
    recorder = RecordEpisodeStatistics(env)
    adapter = VectorEnvAdapter(recorder)
    adapter.reset()
    for _ in range(21):
        step(adapter, [0, 0])
    assert sorted(recorder.length_queue) == [3] * 7 + [7] * 3
    assert list(recorder.return_queue) == [-each for each in recorder.length_queue]


def test_the_cost_callback_refuses_the_environment_of_the_model() -> None:
    env = gym.make_vec(ROW, num_envs=9, autoreset_mode="Disabled")
    model = DQN("MlpPolicy", VecMonitor(VectorEnvAdapter(env)), buffer_size=50)
    with pytest.raises(ValueError, match="another environment than the one"):
        model.learn(8, callback=PolicyCostCallback(env))


def test_the_cost_callback_reports_returns_of_other_environments() -> None:
    make = gym.vector.SyncVectorEnv
    learning = make(
        [lambda: Lasts(3)], autoreset_mode=gym.vector.AutoresetMode.DISABLED
    )
    model = DQN(
        "MlpPolicy",
        VectorEnvAdapter(learning),
        buffer_size=50,
        learning_starts=4,
        seed=0,
    )
    callback = PolicyCostCallback(make([lambda: Lasts(5)] * 2))
    model.learn(8, callback=callback)
    row = callback.history[-1]
    assert set(row) == {"env_steps", "seconds", "policy_cost", "policy_return"}
    assert row["policy_return"] == -row["policy_cost"] == -5.0
