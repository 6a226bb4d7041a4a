"""Real inputs in a rollout, which by itself takes numbered actions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from acl_gym.colony.episodes import Episodes
from acl_gym.evaluation.predictions import checked_inputs, chosen_actions
from acl_gym.evaluation.rollout import Rollout
from acl_gym.utils.boxes import input_bounds
from acl_gym.utils.typing import FloatArray, IntArray, Predictor

Choice = Callable[[Predictor, Any, Rollout, Any], tuple[IntArray, Any]]
"""What `chosen_actions` is: the actions of a model in the walking slots, and its state."""


class RealInputs(VectorWrapper[Any, Any, Any, Any, Any]):
    """An environment with one action: to set the inputs that were chosen before it.

    So a rollout over numbered actions walks in an environment whose actions are a Box.

    Args:
        env: a vector environment whose actions are a bounded Box of one axis.

    Attributes:
        taken: the inputs of each step since the last full reset, `(num_envs, n_inputs)`.

    Raises:
        ValueError: they are not.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        low, high = input_bounds("the actions of env", env.single_action_space)
        self._low, self._high = low, high
        self._dtype = env.single_action_space.dtype
        self.single_action_space = spaces.Discrete(1)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._inputs = np.tile((low + high) / 2, (self.num_envs, 1))
        self.taken: list[FloatArray] = []

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes."""
        if options is None or "reset_mask" not in options:
            self.taken = []
        return super().reset(seed=seed, options=options)

    def step(self, actions: Any) -> Any:
        """Set the inputs chosen last; those of slots that do not walk stay."""
        inputs = self._inputs.copy()
        self.taken.append(inputs)
        return self.env.step(inputs.astype(self._dtype))

    def choose(
        self, model: Predictor, observation: Any, rollout: Rollout, memory: Any
    ) -> tuple[IntArray, Any]:
        """Keep the inputs that `model` sets in the walking slots, for `step`."""
        found = model.predict(observation, deterministic=True)
        self._inputs[rollout.ants] = checked_inputs(
            found, rollout.ants, self._low, self._high
        )
        return np.zeros(rollout.ants.size, dtype=np.int64), memory

    def with_inputs(self, episodes: Episodes) -> Episodes:
        """The same episodes, their actions the inputs that were set."""
        inputs = np.stack(self.taken)
        inputs.setflags(write=False)
        return replace(episodes, actions=inputs)


def walker(
    env: VectorEnv[Any, Any, Any], max_steps: int
) -> tuple[Rollout, Choice, RealInputs | None]:
    """A rollout in an environment with numbered actions or real inputs.

    Args:
        env: any vector environment.
        max_steps: T.

    Returns:
        The rollout, what chooses its actions, and the wrapper around real inputs, None
        where actions are numbered.

    Raises:
        ValueError: the actions are neither Discrete nor a bounded Box of one axis.
    """
    if not isinstance(env.single_action_space, spaces.Box):
        return Rollout(env, max_steps), chosen_actions, None
    real = RealInputs(env)
    return Rollout(real, max_steps), real.choose, real
