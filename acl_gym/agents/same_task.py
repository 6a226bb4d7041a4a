"""Whether two environments pose the same task."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AsyncVectorEnv, VectorWrapper

from acl_gym.envs.control.lookup import system_of

_NOT_OF_THE_TASK = (
    "autoreset_mode",
    "max_episode_steps",
    "num_envs",
    "render_mode",
    "vector_kwargs",
    "vectorization_mode",
    "wrappers",  # see `same_wrappers`
)
"""Keywords of `gym.make_vec` that change nothing of what a solution costs."""

_WATCHERS = (
    "HumanRendering",
    "OrderEnforcing",
    "PassiveEnvChecker",
    "RecordEpisodeStatistics",
    "RecordVideo",
    "RenderCollection",
    "TimeLimit",
)
"""Wrappers of Gymnasium that change neither observations, actions nor rewards."""


def is_same_task(env: Any, other: Any) -> bool:
    """Whether two vector environments are known to pose the same task.

    They do if they are the same object; or if the same is wrapped around them, see
    `same_wrappers`, and either the same object is below, or their systems are of this
    package and equal, or Gymnasium made their slots by the same id with the same
    arguments. The number of slots and time limits do not count.
    """
    if env is other:
        return True
    if not same_wrappers(env, other):
        return False
    if env.unwrapped is other.unwrapped:
        return True
    system, second = system_of(env), system_of(other)
    if system is not None or second is not None:
        return type(system) is type(second) and _are_equal(
            _values(system), _values(second)
        )
    made, made_too = _made_by(env), _made_by(other)
    return made is not None and made_too is not None and _are_equal(made, made_too)


def same_wrappers(env: Any, other: Any) -> bool:
    """Whether two vector environments are known to have the same wrappers.

    Those around the whole and those around its slots, in the same order and with the same
    arguments: a wrapper may change rewards, and with them what a solution costs.
    Wrappers of Gymnasium that only watch do not count, nor do time limits.
    """
    if not _are_alike(list(_wrappers(env)), list(_wrappers(other))):
        return False
    if env.unwrapped is other.unwrapped:
        return True
    inside, inside_too = _wrappers_of_slots(env), _wrappers_of_slots(other)
    return (
        inside is not None and inside_too is not None and _are_alike(inside, inside_too)
    )


def _wrappers(env: Any) -> Iterator[Any]:
    """What is wrapped around an environment and may change it, the outermost first."""
    while isinstance(env, (gym.Wrapper, VectorWrapper)):
        kind = type(env)
        own = kind.__module__.partition(".")[0] == "gymnasium"
        if not (own and kind.__name__ in _WATCHERS):
            yield env
        env = env.env


def _wrappers_of_slots(env: Any) -> Sequence[Any] | None:
    """What is wrapped around each slot; None where that is not known, or differs."""
    base = env.unwrapped
    if isinstance(base, AsyncVectorEnv):  # whose slots live in other processes
        return None if base.spec is None else base.spec.kwargs.get("wrappers", ())
    slots = [list(_wrappers(each)) for each in getattr(base, "envs", ())]
    if not slots:
        return ()
    same = all(_are_alike(slots[0], each) for each in slots)
    return slots[0] if same else None


def _are_alike(wrappers: Sequence[Any], others: Sequence[Any]) -> bool:
    return len(wrappers) == len(others) and all(
        _is_alike(*pair) for pair in zip(wrappers, others, strict=True)
    )


def _is_alike(wrapper: Any, other: Any) -> bool:
    if wrapper is other:
        return True
    if type(wrapper) is not type(other):
        return False
    made, made_too = _arguments(wrapper), _arguments(other)
    return made is not None and made_too is not None and _are_equal(made, made_too)


def _arguments(wrapper: Any) -> dict[str, Any] | None:
    """With what a wrapper was made; None where it does not tell."""
    if isinstance(wrapper, gym.utils.RecordConstructorArgs):
        return wrapper._saved_kwargs
    if not isinstance(wrapper, VectorWrapper):
        return None
    names = [
        name for name in inspect.signature(type(wrapper)).parameters if name != "env"
    ]
    if not all(hasattr(wrapper, name) for name in names):
        return None
    return {name: getattr(wrapper, name) for name in names}


def _values(system: Any) -> dict[str, Any]:
    if not is_dataclass(system):
        return {"system": system}
    return {each.name: getattr(system, each.name) for each in fields(system)}


def _made_by(env: Any) -> dict[str, Any] | None:
    """The id and the arguments of all slots; None where they are not known."""
    base = env.unwrapped
    specs = [getattr(base, "spec", None)]
    if specs[0] is None:
        specs = [getattr(each, "spec", None) for each in getattr(base, "envs", ())]
    found = [
        None
        if spec is None
        else {
            "id": spec.id,
            **{n: v for n, v in spec.kwargs.items() if n not in _NOT_OF_THE_TASK},
        }
        for spec in specs
    ]
    if not found or found[0] is None:
        return None
    same = all(each is not None and _are_equal(found[0], each) for each in found)
    return found[0] if same else None


def _are_equal(values: dict[str, Any], others: dict[str, Any]) -> bool:
    return values.keys() == others.keys() and all(
        _is_equal(values[name], others[name]) for name in values
    )


def _is_equal(value: Any, other: Any) -> bool:
    if value is other:
        return True
    if isinstance(value, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(value, other)
    try:
        return bool(value == other)
    except (TypeError, ValueError):  # of arrays within, which tell nothing
        return False
