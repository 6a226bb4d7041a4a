"""Any Gymnasium vector environment as a `VecEnv` of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv, VectorWrapper
from numpy.typing import NDArray
from stable_baselines3.common.env_util import is_wrapped
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnvIndices,
    VecEnvObs,
    VecEnvStepReturn,
)

from acl_gym.envs import received

_SUPPORTED_MODES = (AutoresetMode.DISABLED, AutoresetMode.SAME_STEP)
_FINAL_KEYS = ("final_obs", "_final_obs", "final_info", "_final_info")
_ARRAY_SPACES = (
    spaces.Box,
    spaces.Discrete,
    spaces.MultiDiscrete,
    spaces.MultiBinary,
)


class VectorEnvAdapter(VecEnv):
    """Lets the agents of Stable-Baselines3 train in a Gymnasium vector environment.

    Both libraries step many slots at once, but a `VecEnv` resets a slot in the step
    that ends its episode, returns one info dict per slot, and reports truncation in
    that dict. With autoreset disabled, the adapter resets the slots that have finished
    with `reset(options={"reset_mask": ...})`; with SAME_STEP it takes the last
    observations from `infos["final_obs"]`.

    Wrap it in a `VecMonitor` to log the returns of the episodes.

    Args:
        env: a vector environment whose autoreset mode is DISABLED (preferred, because
            observation wrappers work with it) or SAME_STEP.

    Attributes:
        env: the vector environment.

    Raises:
        TypeError: `env` is not a vector environment.
        ValueError: a `VecEnv` does not support its autoreset mode or one of its
            spaces.

    Example:
        >>> import gymnasium as gym, acl_gym
        >>> from stable_baselines3.common.vec_env import VecMonitor
        >>> env = gym.make_vec(
        ...     "acl_gym/Pendulum-v0",
        ...     num_envs=8,
        ...     autoreset_mode="Disabled",
        ...     max_episode_steps=300,
        ... )
        >>> vec_env = VecMonitor(acl_gym.VectorEnvAdapter(env))
        >>> vec_env.reset().shape
        (8, 2)
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        if not isinstance(env, VectorEnv):
            raise TypeError(
                "env must be a gymnasium.vector.VectorEnv, got "
                f"{type(env).__name__}; make it with gym.make_vec(id, num_envs=...)."
            )
        mode = received.autoreset_mode_of(env)
        if mode not in _SUPPORTED_MODES:
            raise ValueError(
                f"env must have autoreset mode DISABLED or SAME_STEP, got {mode.name}, "
                "which inserts a meaningless step between two episodes; make it with "
                'gym.make_vec(id, autoreset_mode="Disabled"), or if the vector '
                "environment is built from single ones, with "
                'vector_kwargs={"autoreset_mode": AutoresetMode.DISABLED}.'
            )
        _check_observation_space(env.single_observation_space)
        _check_start("actions", env.single_action_space)
        self.env = env
        self._resets_itself = mode is AutoresetMode.SAME_STEP
        self._actions: NDArray[Any] | None = None
        super().__init__(
            env.num_envs, env.single_observation_space, env.single_action_space
        )

    @property
    def spec(self) -> Any:
        """The specification of the environment, None if it was built by hand."""
        return self.env.spec

    def reset(self) -> VecEnvObs:
        """Start an episode in every slot, with the seed and options set earlier.

        Returns:
            The first observations; infos are in `reset_infos`.
        """
        seed, options = self._seeds[0], self._options[0]
        observations, infos = self.env.reset(
            seed=None if seed is None else int(seed), options=options or None
        )
        self.reset_infos = _infos_per_slot(infos, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        self._actions = None
        return _copy(observations)

    def set_options(
        self, options: list[dict[str, Any]] | dict[str, Any] | None = None
    ) -> None:
        """Set the options of the next reset, one dict for all slots.

        Raises:
            TypeError: `options` is a list with one dict per slot.
        """
        if isinstance(options, list):
            raise TypeError(
                "options must be one dict for all slots, got a list; a vector "
                "environment takes values that differ between slots as an array with "
                'one row per slot, such as {"state": states}.'
            )
        super().set_options(options)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions for `step_wait`."""
        self._actions = np.array(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """Take the step, and start a new episode in each slot whose episode has ended.

        Returns:
            `(observations, rewards, dones, infos)`, the rewards as float32. Every
            info has `TimeLimit.truncated`; that of a slot that has finished also has
            `terminal_observation`.

        Raises:
            RuntimeError: `step_async` has not been called.
        """
        if self._actions is None:
            raise RuntimeError(
                "step_wait() needs actions; call step_async(actions) first, after "
                "reset()."
            )
        actions, self._actions = self._actions, None
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        n = self.num_envs
        received.observations(observations, n)
        rewards = received.rewards(rewards, n)
        terminated = received.flags("terminated", terminated, n)
        truncated = received.flags("truncated", truncated, n)
        dones = np.logical_or(terminated, truncated)
        slots = np.flatnonzero(dones).tolist()
        rows = [
            {key: row[key] for key in row if key not in _FINAL_KEYS}
            for row in _infos_per_slot(infos, n)
        ]
        batched = received.infos(infos, n)
        if slots and self._resets_itself:
            if "final_obs" not in batched:
                raise ValueError(
                    "infos['final_obs'] must hold the last observation of each slot "
                    f"that has finished, got infos with {list(batched)}; check the "
                    "environment and its wrappers."
                )
            # Entries missing from final_info were written by the reset or a wrapper.
            last = _infos_per_slot(batched.get("final_info"), n)
            for slot in slots:
                self.reset_infos[slot] = rows[slot]
                rows[slot] = {**rows[slot], **last[slot]}
                rows[slot]["terminal_observation"] = _copy(batched["final_obs"][slot])
        elif slots:
            for slot in slots:
                rows[slot]["terminal_observation"] = _row(observations, slot)
            # Some environments remove the mask from the dict, so make a new dict.
            observations, infos = self.env.reset(options={"reset_mask": dones.copy()})
            first = _infos_per_slot(infos, self.num_envs)
            for slot in slots:
                self.reset_infos[slot] = first[slot]
        for slot, cut in enumerate(np.greater(truncated, terminated).tolist()):
            rows[slot]["TimeLimit.truncated"] = cut
        return _copy(observations), np.array(rewards, dtype=np.float32), dones, rows

    def close(self) -> None:
        """Close the environment; calling it again is harmless."""
        self.env.close()

    def get_images(self) -> Sequence[NDArray[Any] | None]:
        """The frame of each slot, or None for slots without one."""
        frames: Any = self.env.render()
        return [None] * self.num_envs if frames is None else list(frames)

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute for each slot; `set_attr` explains where it is looked up.

        Raises:
            AttributeError: no environment or wrapper has it.
        """
        slots = self._get_indices(indices)
        if attr_name in ("observation_space", "action_space"):
            return [getattr(self, attr_name) for _ in slots]
        if envs := self._single_envs_with(attr_name):
            return [envs[slot].get_wrapper_attr(attr_name) for slot in slots]
        value = getattr(self._layer_with(attr_name), attr_name)
        return [value for _ in slots]

    def set_attr(
        self, attr_name: str, value: Any, indices: VecEnvIndices = None
    ) -> None:
        """Set an existing attribute.

        In a `SyncVectorEnv` it is the attribute of the slots' single environments. In
        any other vector environment, or if those do not have it, it is that of the
        outermost wrapper or vector environment that has it, shared by all slots.

        Raises:
            AttributeError: no environment or wrapper has it.
            ValueError: it is shared by all slots, but `indices` selects only some.
        """
        slots = list(self._get_indices(indices))
        if envs := self._single_envs_with(attr_name):
            for slot in slots:
                envs[slot].set_wrapper_attr(attr_name, value)
            return
        layer = self._layer_with(attr_name)
        self._check_all(attr_name, slots)
        setattr(layer, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method; `set_attr` explains where it is looked up.

        Returns:
            Its result for each slot. A method of the vector environment is called
            once, and its result is returned for every slot.

        Raises:
            AttributeError: no environment or wrapper has it.
            ValueError: it acts on all slots, but `indices` selects only some.
        """
        slots = list(self._get_indices(indices))
        if envs := self._single_envs_with(method_name):
            return [
                envs[slot].get_wrapper_attr(method_name)(*method_args, **method_kwargs)
                for slot in slots
            ]
        layer = self._layer_with(method_name)
        self._check_all(method_name, slots)
        result = getattr(layer, method_name)(*method_args, **method_kwargs)
        return [result for _ in slots]

    def env_is_wrapped(
        self,
        wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Whether each slot, or the vector environment, is wrapped in this class."""
        slots = list(self._get_indices(indices))
        if any(isinstance(layer, wrapper_class) for layer in self._layers()):
            return [True for _ in slots]
        base = self.env.unwrapped
        if isinstance(base, SyncVectorEnv):
            return [is_wrapped(base.envs[slot], wrapper_class) for slot in slots]
        return [False for _ in slots]

    def _layers(self) -> Iterator[VectorEnv[Any, Any, Any]]:
        """The wrappers from the outside in, then the environment itself."""
        layer = self.env
        while isinstance(layer, VectorWrapper):
            yield layer
            layer = layer.env
        yield layer

    def _layer_with(self, name: str) -> VectorEnv[Any, Any, Any]:
        for layer in self._layers():
            if hasattr(layer, name):
                return layer
        raise AttributeError(f"neither {self.env} nor what it wraps has {name!r}.")

    def _single_envs_with(self, name: str) -> Sequence[gym.Env[Any, Any]]:
        """The slots' single environments if they are accessible and have `name`."""
        base = self.env.unwrapped
        if isinstance(base, SyncVectorEnv) and all(
            env.has_wrapper_attr(name) for env in base.envs
        ):
            return base.envs
        return ()

    def _check_all(self, name: str, slots: Iterable[int]) -> None:
        if set(slots) != set(range(self.num_envs)):
            raise ValueError(
                f"{name!r} is shared by all {self.num_envs} slots, got indices "
                f"{list(slots)}; leave indices out."
            )


def _check_observation_space(space: spaces.Space[Any]) -> None:
    parts = space.spaces.values() if isinstance(space, spaces.Dict) else [space]
    for part in parts:
        if not isinstance(part, _ARRAY_SPACES):
            raise ValueError(
                "observations must be a Box, Discrete, MultiDiscrete, MultiBinary or "
                f"a Dict of those, got {part}; use gymnasium's FlattenObservation."
            )
        _check_start("observations", part)


def _check_start(what: str, space: spaces.Space[Any]) -> None:
    """Stable-Baselines3 assumes that discrete values start from 0."""
    if np.any(getattr(space, "start", 0)):
        raise ValueError(
            f"{what} must start from 0, got {space}; shift them with gymnasium's "
            f"{'TransformAction' if what == 'actions' else 'TransformObservation'}."
        )


def _infos_per_slot(infos: Any, count: int) -> list[dict[str, Any]]:
    """Split batched infos into one dict per slot, following the mask of each key.

    Infos that are a list with a dict for each slot already are taken as they are.

    Raises:
        ValueError: they are neither.
    """
    if isinstance(infos, list):
        received.infos(infos, count)
        return [dict(row) for row in infos]
    infos = received.infos(infos, count)
    rows: list[dict[str, Any]] = [{} for _ in range(count)]
    for key, values in infos.items():
        if key.startswith("_") and key[1:] in infos:
            continue
        mask = infos.get(f"_{key}")
        slots = range(count) if mask is None else np.flatnonzero(mask).tolist()
        if isinstance(values, dict):
            parts: Sequence[Any] = _infos_per_slot(values, count)
        elif isinstance(values, np.ndarray) and values.shape[:1] == (count,):
            parts = list(values.copy())
        else:  # one value for all
            parts = [values] * count
        for slot in slots:
            rows[slot][key] = parts[slot]
    return rows


def _copy(observations: Any) -> VecEnvObs:
    if isinstance(observations, dict):
        return {key: np.array(value) for key, value in observations.items()}
    return np.array(observations)


def _row(observations: Any, slot: int) -> VecEnvObs:
    if isinstance(observations, dict):
        return {key: np.array(value[slot]) for key, value in observations.items()}
    return np.array(observations[slot])
