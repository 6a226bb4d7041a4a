"""Stable-Baselines3's DQN on the environments of this package.

`make_dqn` puts the pieces together, with hyperparameters that were found by measuring
(docs/dqn-tuning.md). What it returns is a plain `stable_baselines3.DQN`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from acl_gym.agents.sb3 import VectorEnvAdapter
from acl_gym.callbacks import Row
from acl_gym.envs.wrappers import ScaledVectorObservation, full_turns
from acl_gym.evaluation import evaluate_policy_cost


@dataclass(frozen=True, kw_only=True)
class DQNSettings:
    num_envs: int = 8
    gradient_steps: int = -1
    train_freq: int = 1
    reward_scale: float = 0.1
    discount: float = 0.99
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-3
    batch_size: int = 128
    buffer_size: int = 200_000
    learning_starts: int = 1000
    target_update_interval: int = 200
    tau: float = 1.0
    n_steps: int = 1
    exploration_fraction: float = 0.2
    exploration_initial_eps: float = 1.0
    exploration_final_eps: float = 0.05
    max_grad_norm: float = 10.0
    net_arch: tuple[int, ...] = (64, 64)
    max_episode_steps: int = 300


class ScaledReward(VecEnvWrapper):
    def __init__(self, venv: VecEnv, scale: float) -> None:
        super().__init__(venv)
        self.scale = scale

    def reset(self) -> VecEnvObs:
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, rewards * np.float32(self.scale), dones, infos


def make_dqn(
    env_id,
    settings=DQNSettings(),
    seed=None,
    *,
    circular=None,
    device="cpu",
    **env_kwargs,
):
    env = gym.make_vec(
        env_id,
        num_envs=settings.num_envs,
        autoreset_mode="Disabled",
        max_episode_steps=settings.max_episode_steps,
        **env_kwargs,
    )
    if circular is None:
        circular = full_turns(env.single_observation_space)
    scaled = ScaledVectorObservation(env, circular)
    vec_env: VecEnv = VecMonitor(VectorEnvAdapter(scaled))
    if settings.reward_scale != 1.0:
        vec_env = ScaledReward(vec_env, settings.reward_scale)
    return DQN(
        "MlpPolicy",
        vec_env,
        learning_rate=LinearSchedule(
            settings.learning_rate, settings.final_learning_rate, 1.0
        ),
        buffer_size=settings.buffer_size,
        learning_starts=settings.learning_starts,
        batch_size=settings.batch_size,
        gamma=settings.discount,
        train_freq=settings.train_freq,
        gradient_steps=settings.gradient_steps,
        target_update_interval=settings.target_update_interval,
        tau=settings.tau,
        n_steps=settings.n_steps,
        exploration_fraction=settings.exploration_fraction,
        exploration_initial_eps=settings.exploration_initial_eps,
        exploration_final_eps=settings.exploration_final_eps,
        max_grad_norm=settings.max_grad_norm,
        policy_kwargs={
            "net_arch": list(settings.net_arch),
            "optimizer_kwargs": {"fused": True},
        },
        seed=seed,
        device=device,
    )


class PolicyCostCallback(BaseCallback):
    def __init__(self, env, states=None, *, every=1000, max_steps=None):
        super().__init__()
        self.env = env
        self.states = states
        self.every = every
        self.max_steps = max_steps
        self.history: list[Row] = []
        self.seconds = 0.0
        self.best = None

    def _on_training_start(self):
        self._clock = time.perf_counter()
        self._due = self.num_timesteps + self.every

    def _on_rollout_start(self):
        if self.num_timesteps >= self._due:
            self._evaluate()
            while self._due <= self.num_timesteps:
                self._due += self.every

    def _on_step(self):
        return True

    def _on_training_end(self):
        self._evaluate()

    def _evaluate(self):
        self.seconds += time.perf_counter() - self._clock
        r = evaluate_policy_cost(
            self.model, self.env, self.states, max_steps=self.max_steps
        )
        self.history.append(
            dict(
                env_steps=self.num_timesteps,
                seconds=self.seconds,
                policy_cost=r.cost,
                success_rate=r.success_rate,
            )
        )
        self._clock = time.perf_counter()
