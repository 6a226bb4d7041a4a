"""Recognising what agents learn in, and saying how to make it of what was given."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec, load_env_creator
from gymnasium.vector import VectorEnv

from acl_gym.utils import validation

_MANY = 100
"""Slots proposed in place of a single environment."""


def require_vector_env(env: Any) -> None:
    """Check that `env` is a vector environment.

    Raises:
        TypeError: it is not; the message has the line of code that makes one of the
            same kind, for a single environment, an id, a function that makes one, or a
            `VecEnv` of Stable-Baselines3.
    """
    if isinstance(env, VectorEnv):
        return
    if _is_vec_env(env):
        kind, remedy = (f"{type(env).__name__} of Stable-Baselines3", _of_vec_env(env))
    elif isinstance(env, gym.Env):
        kind = f"the single environment {type(env.unwrapped).__name__}"
        remedy = f"use {_line(env.spec, type(env.unwrapped).__name__, _MANY)}"
    elif isinstance(env, str):
        spec = gym.registry.get(env.rpartition(":")[2])
        kind = f"the id {env!r}"
        remedy = f"use {_line(spec, None, _MANY)}"
    elif callable(env):
        name = getattr(env, "__name__", "make_env")
        kind = f"{name}, a class or function"
        remedy = f"use {_line(None, name, _MANY)}"
    else:
        kind, remedy = type(env).__name__, f"use {_line(None, None, _MANY)}"
    raise TypeError(f"env must be a gymnasium.vector.VectorEnv, got {kind}; {remedy}.")


def require_discrete_actions(env: VectorEnv[Any, Any, Any]) -> spaces.Discrete:
    """The action space of a slot, if its actions are numbered.

    Raises:
        ValueError: its actions are not `Discrete`; the message has a wrapper that helps.
    """
    space = env.single_action_space
    if isinstance(space, spaces.Discrete):
        return space
    remedy = "number its actions with gymnasium.wrappers.TransformAction"
    if isinstance(space, spaces.Box):
        remedy = (
            "wrap it in acl_gym.ActionGrid(env, 5), or each single environment in "
            "gymnasium.wrappers.DiscretizeAction(env, bins=5)"
        )
    raise ValueError(
        f"env must have Discrete actions, got {validation.shown(space)}; {remedy}."
    )


def has_independent_slots(env_id: str) -> bool:
    """Whether an id has a native vector environment whose slots are copies of a task.

    Where slots share a world, what they meet depends on how many there are. Who needs
    some slots for learning and others for an evaluation takes single environments then.

    Args:
        env_id: of a registered environment.
    """
    entry_point: Any = gym.spec(env_id).vector_entry_point
    if isinstance(entry_point, str):
        entry_point = load_env_creator(entry_point)
    shared = getattr(entry_point, "slots_share_a_world", False)
    return entry_point is not None and not shared


def _line(spec: EnvSpec | None, maker: str | None, count: int) -> str:
    """The expression that makes a vector environment of `count` slots.

    Args:
        spec: of one slot, None if it is not registered.
        maker: the name of what makes one slot if it is not registered.
        count: the number of slots.
    """
    if spec is not None:
        extra = "".join(
            f", {name}={value!r}"
            for name, value in spec.kwargs.items()
            if name != "render_mode" and isinstance(value, (bool, int, float, str))
        )
        if spec.vector_entry_point is not None:
            return f'gym.make_vec("{spec.id}", num_envs={count}{extra})'
        return f'acl_gym.WaitingVectorEnv.make("{spec.id}", {count}{extra})'
    if maker is not None:
        maker = "make_env" if maker == "<lambda>" else maker
        return f"acl_gym.WaitingVectorEnv([{maker}] * {count})"
    return f"gym.make_vec(id, num_envs={count})"


def _is_vec_env(env: Any) -> bool:
    """Whether it is a `VecEnv`, found without importing Stable-Baselines3."""
    package = "stable_baselines3.common.vec_env"
    return any(base.__module__.startswith(package) for base in type(env).__mro__)


def _of_vec_env(env: Any) -> str:
    base = env.unwrapped
    if isinstance(getattr(base, "env", None), VectorEnv):
        inside = "env.env" if base is env else "env.unwrapped.env"
        return f"pass what it adapts, {inside}"
    singles = getattr(base, "envs", [])  # those of a SubprocVecEnv are in processes
    if not singles:
        return f"use {_line(None, None, env.num_envs)}"
    first = singles[0]
    return f"use {_line(first.spec, type(first.unwrapped).__name__, env.num_envs)}"
