"""What a `VecEnv` of Stable-Baselines3 requires of a vector environment."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from acl_gym.envs import received
from acl_gym.envs.autoreset import ChoosesAutoreset
from acl_gym.utils import validation

_SUPPORTED_MODES = (AutoresetMode.DISABLED, AutoresetMode.SAME_STEP)
_ARRAY_SPACES = (
    spaces.Box,
    spaces.Discrete,
    spaces.MultiDiscrete,
    spaces.MultiBinary,
)


Settings = TypeVar("Settings")


def settle_mode(env: VectorEnv[Any, Any, Any]) -> AutoresetMode:
    """The autoreset mode of `env`; an environment of this package is given one that fits.

    Raises:
        ValueError: a `VecEnv` does not support the mode, and it cannot be changed.
    """
    mode = received.autoreset_mode_of(env)
    if mode in _SUPPORTED_MODES:
        return mode
    # Not below wrappers, which may have read the mode already.
    if isinstance(env, ChoosesAutoreset):
        env.set_autoreset_mode(AutoresetMode.DISABLED)
        return AutoresetMode.DISABLED
    raise ValueError(
        f"env must have autoreset mode DISABLED or SAME_STEP, got {mode.name}, which "
        "inserts a meaningless step between two episodes; make it with "
        f"{_with_autoreset_disabled(env)}{'' if env.unwrapped is env else ', then wrap'}."
    )


def _with_autoreset_disabled(env: VectorEnv[Any, Any, Any]) -> str:
    """The line of code that makes what `env` wraps, with autoreset disabled."""
    base = env.unwrapped
    mode, count = '"Disabled"', env.num_envs
    env_id = "id" if base.spec is None else f'"{base.spec.id}"'
    if isinstance(base, ChoosesAutoreset):
        return f"gym.make_vec({env_id}, num_envs={count}, autoreset_mode={mode})"
    if isinstance(base, (SyncVectorEnv, AsyncVectorEnv)) and base.spec is None:
        return f"{type(base).__name__}(env_fns, autoreset_mode={mode})"
    how = "async" if isinstance(base, AsyncVectorEnv) else "sync"
    return (
        f'gym.make_vec({env_id}, num_envs={count}, vectorization_mode="{how}", '
        f'vector_kwargs={{"autoreset_mode": {mode}}})'
    )


def check_action_space(space: spaces.Space[Any]) -> None:
    """Refuse actions that cannot be an array with one row for each slot.

    Raises:
        ValueError: `space` is not a Box, Discrete, MultiDiscrete or MultiBinary, or does not
            start from 0.
    """
    if not isinstance(space, _ARRAY_SPACES):
        raise ValueError(
            "actions must be a Box, Discrete, MultiDiscrete or MultiBinary, since a "
            "VecEnv takes them as one array with a row for each slot, got "
            f"{validation.shown(space)}; "
            "rearrange them in each single environment with gymnasium's "
            "TransformAction."
        )
    _check_start("actions", space)


def check_observation_space(space: spaces.Space[Any]) -> None:
    """Refuse observations that a `VecEnv` cannot return.

    Raises:
        ValueError: `space` is not a Box, Discrete, MultiDiscrete, MultiBinary or a Dict of
            those, or does not start from 0.
    """
    parts = space.spaces.values() if isinstance(space, spaces.Dict) else [space]
    for part in parts:
        if not isinstance(part, _ARRAY_SPACES):
            raise ValueError(
                "observations must be a Box, Discrete, MultiDiscrete, MultiBinary or "
                f"a Dict of those, got {part}; use gymnasium's FlattenObservation."
            )
        _check_start("observations", part)


def check_observations(
    observations: Any, space: spaces.Space[Any], n_slots: int
) -> None:
    """Refuse observations that buffers of Stable-Baselines3 would not take.

    Raises:
        ValueError: there is not one row a slot, or a row has not the shape of `space`.
    """
    received.observations(observations, n_slots)
    if isinstance(space, spaces.Dict):
        given = (
            set(observations) if isinstance(observations, dict) else type(observations)
        )
        if given != set(space.spaces):
            raise ValueError(
                f"observations must be a dict with the keys {list(space.spaces)}, got "
                f"{given}; check the environment's reset and step."
            )
    parts = space.spaces if isinstance(space, spaces.Dict) else {None: space}
    for key, part in parts.items():
        shape = np.shape(observations if key is None else observations[key])
        if shape != (n_slots, *(part.shape or ())):
            name = "observations" if key is None else f"observations[{key!r}]"
            raise ValueError(
                f"{name} must have shape {(n_slots, *(part.shape or ()))}, a row for "
                f"each slot in {validation.shown(part)}, got {shape}; check the "
                "environment's reset and step."
            )


def checked_settings(settings: Any, kind: type[Settings]) -> Settings:
    """Return the settings of a model; None takes the defaults.

    Raises:
        TypeError: they are not of this kind.
    """
    if settings is None:
        return kind()
    if not isinstance(settings, kind):
        raise TypeError(
            f"settings must be {kind.__name__} or None, got "
            f"{validation.shown(settings)}; make them with {kind.__name__}(...)."
        )
    return settings


def checked_layers(units: Any) -> tuple[int, ...]:
    """Return the number of units of each hidden layer of a network.

    Args:
        units: of each layer, >= 1; none where there is no hidden layer.

    Raises:
        TypeError: it is no sequence of integers.
        ValueError: a layer has no unit.
    """
    listed = validation.elements(units)
    if listed is None:
        raise TypeError(
            "net_arch must be a sequence with the units of each hidden layer, such as "
            f"(64, 64), got {validation.shown(units)}."
        )
    return tuple(validation.integer("net_arch", each, at_least=1) for each in listed)


def _check_start(what: str, space: spaces.Space[Any]) -> None:
    """Stable-Baselines3 assumes that discrete values start from 0."""
    if np.any(getattr(space, "start", 0)):
        raise ValueError(
            f"{what} must start from 0, got "
            f"{validation.shown(space)}; shift them with gymnasium's "
            f"{'TransformAction' if what == 'actions' else 'TransformObservation'}."
        )
