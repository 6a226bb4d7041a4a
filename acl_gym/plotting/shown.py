"""A policy that is drawn beside others."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.plotting.style import ORANGE
from acl_gym.utils.typing import Predictor


@dataclass(frozen=True)
class Shown:
    """A policy with its names.

    Attributes:
        label: what the policy is called.
        title: the same with its cost, in two lines.
        env: the environment on which it is shown, with any number of slots.
        policy: chooses actions in that environment.
        success_rate: of its evaluation, 0..1.
        line: keyword arguments of its lines.
    """

    label: str
    title: str
    env: ControlVectorEnv
    policy: Predictor
    success_rate: float = 0.0
    line: dict[str, Any] = field(default_factory=lambda: {"color": ORANGE})
