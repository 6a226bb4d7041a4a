"""Whether two environments pose the same task."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from acl_gym.envs.control.lookup import system_of

_NOT_OF_THE_TASK = (
    "autoreset_mode",
    "max_episode_steps",
    "num_envs",
    "render_mode",
    "vector_kwargs",
    "vectorization_mode",
    "wrappers",
)
"""Keywords of `gym.make_vec` that change nothing of what a solution costs."""


def is_same_task(env: Any, other: Any) -> bool:
    """Whether two vector environments are known to pose the same task.

    They do if they are the same object, if their systems are of this package and equal,
    or if Gymnasium made their slots by the same id with the same arguments. Wrappers do
    not count, nor do the number of slots and time limits.
    """
    if env.unwrapped is other.unwrapped:
        return True
    system, second = system_of(env), system_of(other)
    if system is not None or second is not None:
        return type(system) is type(second) and _are_equal(
            _values(system), _values(second)
        )
    made, made_too = _made_by(env), _made_by(other)
    return made is not None and made_too is not None and _are_equal(made, made_too)


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
