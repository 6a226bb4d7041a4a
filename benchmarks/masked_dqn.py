"""DQN for tasks with masks: what aco_tsp.py sets beside the ants.

Stable-Baselines3's DQN knows no masks. Here the observation says which actions are
allowed, and the network gives the others a value so low that they are never chosen,
neither by the greedy policy nor in the target.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork

FORBIDDEN = -1e6
"""Value of an action that is not allowed; all others lie far above."""


class CityAndMask(gym.Wrapper[Any, Any, Any, Any]):
    """Observations are the city, one-hot, and the mask: `(2n,)`; rewards are scaled.

    Args:
        env: an environment with n states, n actions and `info["action_mask"]`.
        scale: factor on the rewards.
    """

    def __init__(self, env: gym.Env[Any, Any], scale: float) -> None:
        super().__init__(env)
        space: Any = env.observation_space
        self.n, self.scale = int(space.n), scale
        self.observation_space = gym.spaces.Box(0.0, 1.0, (2 * self.n,), np.float32)
        self.length = 0.0

    def reset(self, **options: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        city, info = self.env.reset(**options)
        self.length = 0.0
        return self._features(city, info), info

    def step(self, action: Any) -> Any:
        city, reward, terminated, truncated, info = self.env.step(int(action))
        self.length -= float(reward)
        if terminated:
            info = {**info, "length": self.length}
        features = self._features(city, info)
        return features, float(reward) * self.scale, terminated, truncated, info

    def _features(self, city: Any, info: dict[str, Any]) -> NDArray[np.float32]:
        features = np.zeros(2 * self.n, np.float32)
        features[city] = 1.0
        features[self.n :] = info["action_mask"]
        return features


class MaskedQNetwork(QNetwork):
    def forward(self, obs: Any) -> torch.Tensor:
        values = super().forward(obs)
        allowed = obs[:, values.shape[1] :] > 0.5
        return torch.where(allowed, values, FORBIDDEN)


class MaskedPolicy(DQNPolicy):
    def make_q_net(self) -> QNetwork:
        arguments = self._update_features_extractor(self.net_args)
        return MaskedQNetwork(**arguments).to(self.device)


class MaskedDQN(DQN):
    """Explores among the actions that are allowed.

    Args:
        seed: the same seed gives the same run.
        arguments: of DQN.
        options: of DQN.
    """

    def __init__(self, *arguments: Any, seed: int, **options: Any) -> None:
        super().__init__(*arguments, seed=seed, **options)
        self.rng = np.random.default_rng(seed)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[np.int64], Any]:
        if deterministic or self.rng.random() >= self.exploration_rate:
            return self.policy.predict(observation, state, episode_start, True)
        allowed = observation[:, observation.shape[1] // 2 :]
        return np.array(
            [self.rng.choice(np.flatnonzero(row)) for row in allowed]
        ), state

    def _sample_action(self, *arguments: Any, **options: Any) -> Any:
        # Before learning starts, too, only allowed actions are drawn.
        actions, _ = self.predict(self._last_obs)
        return actions, actions


class BestTour(BaseCallback):
    """Keeps the length of the shortest tour, and ends the run.

    Args:
        tours: ends after so many.
        seconds: ends after so many of the processor's seconds.
        target: ends with a tour that is no longer than this.
    """

    def __init__(self, tours: int, seconds: float, target: float) -> None:
        super().__init__()
        self.limit, self.seconds, self.target = tours, seconds, target
        self.tours, self.best, self.start = 0, math.inf, time.process_time()

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "length" in info:
                self.tours += 1
                self.best = min(self.best, info["length"])
        late = time.process_time() - self.start >= self.seconds
        return not late and self.tours < self.limit and self.best > self.target


def shortest_tour(
    make: Callable[[], gym.Env[Any, Any]],
    n: int,
    scale: float,
    tours: int,
    seed: int,
    seconds: float = math.inf,
    target: float = -math.inf,
) -> tuple[int, float]:
    """How many tours DQN made while it learned, and the length of the shortest.

    Args:
        make: returns the environment.
        n: its number of cities.
        scale: factor on the rewards.
        tours: the most that it makes, >= 1.
        seed: the same seed gives the same run.
        seconds: limit on the processor's seconds.
        target: length of a tour with which it ends.
    """
    torch.set_num_threads(1)
    best = BestTour(tours, seconds, target)
    model = MaskedDQN(
        MaskedPolicy,
        DummyVecEnv([lambda: CityAndMask(make(), scale)]),
        learning_rate=5e-4,
        buffer_size=50_000,
        learning_starts=min(1_000, 10 * n),
        batch_size=64,
        gamma=1.0,
        train_freq=4,
        target_update_interval=500,
        exploration_fraction=0.3,
        exploration_final_eps=0.05,
        policy_kwargs={"net_arch": [128, 128]},
        seed=seed,
        device="cpu",
    )
    model.learn(tours * n, callback=best)
    return best.tours, float(best.best)
