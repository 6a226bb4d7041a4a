"""Environments whose steps are sure to return what they should."""

from __future__ import annotations

from typing import Any, TypeGuard

from acl_gym.envs.control.bookkeeping import of_this_package
from acl_gym.envs.control.environments import ControlVectorEnv

_OF_A_STEP = {
    name: getattr(ControlVectorEnv, name)
    for name in ("step", "_step", "_observe", "_infos")
}


def is_native(env: Any) -> TypeGuard[ControlVectorEnv]:
    """Whether what `env` returns is sure to fit: it and its system are of this package.

    Of a subclass of a user's own, and of methods that were replaced, nothing is sure.
    """
    kind = type(env)
    if not (isinstance(env, ControlVectorEnv) and of_this_package(kind)):
        return False
    system = env.system
    return (
        of_this_package(type(system))
        and all(getattr(kind, name) is own for name, own in _OF_A_STEP.items())
        and vars(env).keys().isdisjoint(_OF_A_STEP)
        and vars(system).keys().isdisjoint(("advance", "observe", "action_mask"))
    )
