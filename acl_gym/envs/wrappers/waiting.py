"""Single environments as slots of a vector environment whose finished slots wait."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Self

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from acl_gym.utils import validation


class WaitingVectorEnv(SyncVectorEnv):
    """A `SyncVectorEnv` that steps only the slots that have not finished.

    In a trial, ants wait until the last of them has finished. Meanwhile a
    `SyncVectorEnv` goes on stepping and resetting finished slots; where episodes differ
    much in length, this is most of its work. Here a finished slot is not stepped until it
    is reset: its observation stays as it is, its reward is 0 and both its flags are
    False. An agent learns the same with either.

    Args:
        env_fns: functions that make the environments, one for each slot; their
            observations are arrays or numbers.

    Raises:
        ValueError: there is no slot.

    Example:
        >>> from acl_gym import ACL
        >>> env = WaitingVectorEnv.make("FrozenLake-v1", 20, is_slippery=False)
        >>> colony = ACL(env, deposit="return", seed=0).learn(trials=2)
        >>> colony.trials
        2
    """

    def __init__(self, env_fns: Sequence[Callable[[], gym.Env[Any, Any]]]) -> None:
        if len(env_fns) == 0:
            raise ValueError("env_fns must make at least one environment, got none.")
        super().__init__(env_fns, autoreset_mode=AutoresetMode.DISABLED)
        self._shown: NDArray[Any] = np.empty(0)
        self._finished = np.zeros(self.num_envs, dtype=np.bool_)

    @classmethod
    def make(cls, env_id: str, num_envs: int, **kwargs: Any) -> Self:
        """Make the slots by `gym.make(env_id, **kwargs)`.

        Args:
            env_id: a registered id.
            num_envs: slots, >= 1.
            kwargs: of `gym.make`, such as `max_episode_steps`.
        """
        count = validation.integer("num_envs", num_envs, at_least=1)
        return cls([lambda: gym.make(env_id, **kwargs)] * count)

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start episodes in all slots, or in those of `options["reset_mask"]`."""
        if isinstance(seed, Sequence):
            seed = [validation.seed(each) for each in seed]
        else:
            seed = validation.seed(seed)
        mask = None if options is None else options.get("reset_mask")
        # A copy: the base class takes the mask out, and wrappers around this one would
        # then see a full reset.
        options = None if options is None else dict(options)
        observation, infos = super().reset(seed=seed, options=options)
        if mask is None:
            self._finished[:] = False
            self._shown = np.array(observation)
        else:
            self._finished[mask] = False
            # The base class returns the first observations of the other slots.
            self._shown[mask] = np.asarray(observation)[mask]
        return self._shown.copy(), infos

    def step(
        self, actions: Any
    ) -> tuple[
        NDArray[Any],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Let every slot that has not finished take its action."""
        rewards = np.zeros(self.num_envs)
        terminated = np.zeros(self.num_envs, dtype=np.bool_)
        truncated = np.zeros(self.num_envs, dtype=np.bool_)
        infos: dict[str, Any] = {}
        for slot in np.flatnonzero(~self._finished).tolist():
            (
                self._shown[slot],
                rewards[slot],
                terminated[slot],
                truncated[slot],
                info,
            ) = self.envs[slot].step(actions[slot])
            infos = self._add_info(infos, info, slot)
        self._finished |= terminated | truncated
        return self._shown.copy(), rewards, terminated, truncated, infos
