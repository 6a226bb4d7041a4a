"""Any Gymnasium vector environment as a `VecEnv` of Stable-Baselines3."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import (
    AutoresetMode,
    VectorEnv,
    VectorWrapper,
)
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnvIndices,
    VecEnvObs,
    VecEnvStepReturn,
)

from acl_gym.envs import received
from acl_gym.envs.wrappers.partial_reset import reset_slots
from acl_gym.sb3.checks import (
    check_action_space,
    check_observation_space,
    check_observations,
    settle_mode,
)
from acl_gym.sb3.slots import SlotEnvs, slot_envs
from acl_gym.utils import validation
from acl_gym.utils.vector_envs import require_vector_env

_FINAL_KEYS = ("final_obs", "_final_obs", "final_info", "_final_info")


class VectorEnvAdapter(VecEnv):
    """Lets the agents of Stable-Baselines3 train in a Gymnasium vector environment.

    Both libraries step many slots at once, but a `VecEnv` resets a slot in the step
    that ends its episode, returns one info dict per slot, and reports truncation in
    that dict. With autoreset disabled, the adapter resets the slots that have finished
    with `reset(options={"reset_mask": ...})`; with SAME_STEP it takes the last
    observations from `infos["final_obs"]`.

    The info of a slot whose episode has ended has `"episode"`, its return `r`, length `l`
    and time `t`, from which agents log `rollout/ep_rew_mean` and `ep_len_mean`, as with a
    `Monitor`; and `"is_success"` if the environment gives it, for `rollout/success_rate`
    and `EvalCallback`. A `VecMonitor` is needed for a log file only, and for
    `evaluate_policy` not to warn that there is none.

    Args:
        env: a vector environment whose autoreset mode is DISABLED (preferred, because
            observation wrappers work with it) or SAME_STEP. An environment of this
            package that is not wrapped yet may have any mode: NEXT_STEP, the default of
            `gym.make_vec`, is changed to DISABLED.

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
        ...     max_episode_steps=300,
        ... )
        >>> vec_env = VecMonitor(acl_gym.VectorEnvAdapter(env))
        >>> vec_env.reset().shape
        (8, 2)
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        require_vector_env(env)
        validation.integer("env.num_envs", env.num_envs, at_least=1)
        check_observation_space(env.single_observation_space)
        check_action_space(env.single_action_space)
        self.env = env
        self._resets_itself = settle_mode(env) is AutoresetMode.SAME_STEP
        self._slot_envs = slot_envs(env)
        self._actions: NDArray[Any] | None = None
        self._returns = np.zeros(env.num_envs)
        self._lengths = np.zeros(env.num_envs, dtype=np.int64)
        self._began = time.time()
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
        result = self.env.reset(
            seed=None if seed is None else int(seed), options=options or None
        )
        observations, infos = received.parts("reset", result, 2)
        check_observations(observations, self.observation_space, self.num_envs)
        self.reset_infos = _infos_per_slot(infos, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        self._actions = None
        self._returns[:] = 0.0
        self._lengths[:] = 0
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
            `terminal_observation` and `episode`.

        Raises:
            RuntimeError: `step_async` has not been called.
        """
        if self._actions is None:
            raise RuntimeError(
                "step_wait() needs actions; call step_async(actions) first, after "
                "reset()."
            )
        actions, self._actions = self._actions, None
        result = received.parts("step", self.env.step(actions), 5)
        observations, rewards, terminated, truncated, infos = result
        n = self.num_envs
        check_observations(observations, self.observation_space, n)
        rewards = received.rewards(rewards, n)
        if not np.isfinite(rewards).all():
            raise received.not_finite(rewards, int(np.argmin(np.isfinite(rewards))))
        terminated = received.flags("terminated", terminated, n)
        truncated = received.flags("truncated", truncated, n)
        dones = np.logical_or(terminated, truncated)
        slots = np.flatnonzero(dones).tolist()
        rows = [
            {key: row[key] for key in row if key not in _FINAL_KEYS}
            for row in _infos_per_slot(infos, n)
        ]
        if slots and self._resets_itself:
            batched = received.infos(infos, n)
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
            observations, infos = reset_slots(self.env, dones)
            first = _infos_per_slot(infos, self.num_envs)
            for slot in slots:
                self.reset_infos[slot] = first[slot]
        for slot, cut in enumerate(np.greater(truncated, terminated).tolist()):
            rows[slot]["TimeLimit.truncated"] = cut
        self._count(rewards, slots, rows)
        return _copy(observations), np.array(rewards, dtype=np.float32), dones, rows

    def _count(
        self, rewards: Any, slots: Iterable[int], rows: list[dict[str, Any]]
    ) -> None:
        """Add up rewards and steps; add those of the episodes that have ended."""
        self._returns += rewards
        self._lengths += 1
        for slot in slots:
            # What a wrapper has counted, such as RecordEpisodeStatistics, stays.
            rows[slot].setdefault(
                "episode",
                {
                    "r": float(self._returns[slot]),
                    "l": int(self._lengths[slot]),
                    "t": round(time.time() - self._began, 6),
                },
            )
            self._returns[slot] = 0.0
            self._lengths[slot] = 0

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
            AttributeError: no environment or wrapper has it, or only some of the
                slots have it.
        """
        slots = list(self._get_indices(indices))
        if attr_name in ("observation_space", "action_space"):
            return [getattr(self, attr_name) for _ in slots]
        envs = self._slots_with(attr_name, slots)
        if envs is not None:
            return envs.get(attr_name, slots)
        value = getattr(self._layer_with(attr_name), attr_name)
        return [value for _ in slots]

    def set_attr(
        self, attr_name: str, value: Any, indices: VecEnvIndices = None
    ) -> None:
        """Set an existing attribute.

        In a `SyncVectorEnv` or `AsyncVectorEnv` it is the attribute of the slots'
        single environments. In any other vector environment, or if those do not have
        it, it is that of the outermost wrapper or vector environment that has it, shared
        by all slots.

        Raises:
            AttributeError: no environment or wrapper has it, or only some of the
                slots have it.
            ValueError: `indices` selects some slots only, but it is shared by all, or
                belongs to the workers of an `AsyncVectorEnv`, which are set together.
        """
        slots = list(self._get_indices(indices))
        envs = self._slots_with(attr_name, slots)
        if envs is not None:
            envs.set(attr_name, value, slots)
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
            AttributeError: no environment or wrapper has it, or only some of the
                slots have it.
            ValueError: it acts on all slots, but `indices` selects only some.
        """
        slots = list(self._get_indices(indices))
        envs = self._slots_with(method_name, slots)
        if envs is not None:
            return envs.call(method_name, method_args, method_kwargs, slots)
        layer = self._layer_with(method_name)
        self._check_all(method_name, slots)
        result = getattr(layer, method_name)(*method_args, **method_kwargs)
        return [result for _ in slots]

    def env_is_wrapped(
        self,
        wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Whether each slot, or the vector environment, is wrapped in this class.

        Raises:
            TypeError: the workers of an `AsyncVectorEnv` have a wrapper of a class that
                this process does not know.
        """
        slots = list(self._get_indices(indices))
        if any(isinstance(layer, wrapper_class) for layer in self._layers()):
            return [True for _ in slots]
        if self._slot_envs is not None:
            return self._slot_envs.wrapped_in(wrapper_class, slots)
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

    def _slots_with(self, name: str, slots: list[int]) -> SlotEnvs | None:
        """The single environments if those asked have `name`, None if none of them has.

        Raises:
            AttributeError: only some have it.
        """
        if self._slot_envs is None:
            return None
        has = self._slot_envs.has(name)
        reached = self._slot_envs.reached(slots)
        missing = [slot for slot in reached if not has[slot]]
        if missing and len(missing) < len(reached):
            raise AttributeError(
                f"each of the slots {list(reached)[:10]} must have {name!r}, but slots "
                f"{missing[:10]} do not; name those that have it by indices, in a "
                "SyncVectorEnv."
            )
        return None if missing else self._slot_envs

    def _check_all(self, name: str, slots: Sequence[int]) -> None:
        if set(slots) != set(range(self.num_envs)):
            raise ValueError(
                f"{name!r} is shared by all {self.num_envs} slots, got indices "
                f"{list(slots)}; leave indices out."
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
        if str(key).startswith("_") and key[1:] in infos:
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
