"""The models of Stable-Baselines3 by name, as comparisons and searches make them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from acl_gym.sb3.actor_critic import A2CSettings, PPOSettings, make_a2c, make_ppo
from acl_gym.sb3.dqn import DQNSettings, make_dqn


class Model(NamedTuple):
    """A model: the class of its settings, and what makes it of an id, these and a seed."""

    settings: Callable[..., Any]
    make: Callable[..., Any]


MODELS = {
    "dqn": Model(DQNSettings, make_dqn),
    "ppo": Model(PPOSettings, make_ppo),
    "a2c": Model(A2CSettings, make_a2c),
}
"""By the name that commands and files have for each."""
