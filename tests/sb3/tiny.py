"""A DQN that learns in no time, and what tests ask of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces

from acl_gym.sb3.dqn import DQNSettings

PENDULUM = "acl_gym/Pendulum-v0"
FEATURES = spaces.Box(-1, 1, (3,), np.float32)
TINY = DQNSettings(
    num_envs=4,
    learning_starts=40,
    batch_size=16,
    net_arch=(16,),
    max_episode_steps=20,
    reward_scale=0.5,
)


def parameters(model: Any) -> np.ndarray:
    vector = torch.nn.utils.parameters_to_vector(model.policy.parameters())
    return vector.detach().numpy()
