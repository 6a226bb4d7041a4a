"""Single environments as slots of a vector environment whose finished slots wait."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Self

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from numpy.typing import NDArray

from acl_gym.envs.reset_mask import checked_reset_mask
from acl_gym.envs.wrappers.rows import copied, empty_rows, set_row
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray


class WaitingSlots(VectorEnv[Any, Any, NDArray[Any]]):
    """Base of vector environments whose finished slots wait, at no cost.

    A slot that has finished is not stepped until it is reset: its observation stays as
    it is, its reward is 0 and both its flags are False. Subclasses say how single
    environments are reset and stepped.
    """

    _shown: Any = None
    """Observations of all slots, see `rows`; None before the first reset."""
    _finished: BoolArray

    def _begin(
        self, slots: list[int], seeds: list[int | None], options: dict[str, Any] | None
    ) -> Iterable[tuple[int, Any]]:
        """Reset some single environments.

        Args:
            slots: which, in ascending order.
            seeds: the seed of each of these slots, or None.
            options: what is passed to each of them.

        Returns:
            Each slot with what its environment returned.
        """
        raise NotImplementedError

    def _advance(self, slots: list[int], actions: Any) -> Iterable[tuple[int, Any]]:
        """Step some single environments.

        Args:
            slots: which, in ascending order.
            actions: of all slots.

        Returns:
            Each slot with what its environment returned.
        """
        raise NotImplementedError

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes in all slots, or in those of `options["reset_mask"]`.

        Args:
            seed: slot i is seeded with seed + i; a list has a seed or None for each
                slot; None continues.
            options: `"reset_mask"`, bool array `(num_envs,)`; the others are passed on
                to each slot.

        Returns:
            Observations of all slots, `(num_envs, ...)`, and the infos of those that
            were started.

        Raises:
            TypeError: a seed is not an integer, or the mask no bool array.
            ValueError: a seed is negative, there is not one for each slot, the mask
                does not fit, or an environment does not return what it should.
            ResetNeeded: the first reset has a mask.
        """
        seeds = self._seeds(seed)
        # A copy: wrappers around this one would see a full reset without the mask.
        passed = None if options is None else dict(options)
        mask = checked_reset_mask(
            None if passed is None else passed.pop("reset_mask", None),
            self.num_envs,
            begun=self._shown is not None,
        )
        slots = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        started = slots.tolist()
        if self._shown is None:
            shown = empty_rows(self.single_observation_space, self.num_envs)
        else:
            shown = self._shown
        infos: dict[str, Any] = {}
        for slot, given in self._begin(started, [seeds[i] for i in started], passed):
            observation, info = _parts("reset", given, 2)
            set_row(shown, slot, observation)
            if info:
                infos = self._add_info(infos, info, slot)
        self._shown = shown
        self._finished[slots] = False
        return copied(shown), infos

    def _seeds(self, seed: Any) -> list[int | None]:
        """One seed for each slot."""
        n = self.num_envs
        if not isinstance(seed, Sequence) or isinstance(seed, str):
            first = validation.seed(seed)
            return [None if first is None else first + slot for slot in range(n)]
        if len(seed) != n:
            raise ValueError(
                f"seed must be one number, or a list with one for each of the {n} slots, "
                f"got {len(seed)}."
            )
        return [validation.seed(each) for each in seed]

    def step(
        self, actions: Any
    ) -> tuple[Any, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Let every slot that has not finished take its action.

        Raises:
            ResetNeeded: there was no reset.
            ValueError: an environment does not return what it should.
        """
        shown = self._shown
        if shown is None:
            raise ResetNeeded("call reset before the first step.")
        plain = type(shown) is np.ndarray
        shape = shown.shape[1:] if plain else None
        rewards = np.zeros(self.num_envs)
        terminated = np.zeros(self.num_envs, dtype=np.bool_)
        truncated = np.zeros(self.num_envs, dtype=np.bool_)
        infos: dict[str, Any] = {}
        walking = np.flatnonzero(~self._finished).tolist()
        for slot, given in self._advance(walking, actions):
            if type(given) is not tuple or len(given) != 5:
                given = _parts("step", given, 5)
            try:
                seen, rewards[slot], terminated[slot], truncated[slot], info = given
            except (TypeError, ValueError, OverflowError):
                raise _no_numbers(slot, given) from None
            if plain and type(seen) is np.ndarray and seen.shape == shape:
                shown[slot] = seen  # what is most frequent needs no more checks
            else:
                set_row(shown, slot, seen)
            if info:
                infos = self._add_info(infos, info, slot)
        self._finished |= terminated | truncated
        return copied(shown), rewards, terminated, truncated, infos


def _no_numbers(slot: int, given: Any) -> ValueError:
    """The error for a reward that is no number, or flags that are no booleans."""
    return ValueError(
        "step must return a number as reward, then True or False for terminated and "
        f"truncated, got {', '.join(map(validation.shown, given[1:4]))} in slot {slot}; "
        "check the environment."
    )


class WaitingVectorEnv(WaitingSlots, SyncVectorEnv[Any, Any]):
    """A `SyncVectorEnv` that steps only the slots that have not finished.

    In a trial, ants wait until the last of them has finished. Meanwhile a
    `SyncVectorEnv` goes on stepping and resetting finished slots; where episodes differ
    much in length, this is most of its work. Here a finished slot is not stepped until it
    is reset: its observation stays as it is, its reward is 0 and both its flags are
    False. An agent learns the same with either.

    Args:
        env_fns: functions that make the environments, one for each slot; their
            observations are arrays or numbers, or dicts or tuples of those.

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
        SyncVectorEnv.__init__(self, env_fns, autoreset_mode=AutoresetMode.DISABLED)
        self._finished = np.zeros(self.num_envs, dtype=np.bool_)

    @classmethod
    def make(cls, env_id: str, num_envs: int, **kwargs: Any) -> Self:
        """Make the slots by `gym.make(env_id, **kwargs)`.

        Args:
            env_id: a registered id.
            num_envs: slots, >= 1.
            kwargs: of `gym.make`, such as `max_episode_steps`.
        """
        return cls(made_by_id(env_id, num_envs, kwargs))

    def _begin(
        self, slots: list[int], seeds: list[int | None], options: dict[str, Any] | None
    ) -> Iterable[tuple[int, Any]]:
        for slot, seed in zip(slots, seeds, strict=True):
            yield slot, self.envs[slot].reset(seed=seed, options=options)

    def _advance(self, slots: list[int], actions: Any) -> Iterable[tuple[int, Any]]:
        for slot in slots:
            yield slot, self.envs[slot].step(actions[slot])


def made_by_id(
    env_id: str, num_envs: Any, kwargs: dict[str, Any]
) -> list[Callable[[], gym.Env[Any, Any]]]:
    """The functions that make so many slots by `gym.make(env_id, **kwargs)`.

    Raises:
        TypeError: `num_envs` is not an integer.
        ValueError: it is less than 1.
    """
    count = validation.integer("num_envs", num_envs, at_least=1)
    return [lambda: gym.make(env_id, **kwargs)] * count


def _parts(name: str, given: Any, count: int) -> Any:
    """What a single environment returned, if it has so many parts.

    Raises:
        ValueError: it is no tuple, or has another number of parts.
    """
    if not isinstance(given, (tuple, list)) or len(given) != count:
        raise ValueError(
            f"{name} of a single environment must return a tuple of {count} parts, as "
            f"gymnasium.Env describes, got {validation.shown(given)}."
        )
    return given
