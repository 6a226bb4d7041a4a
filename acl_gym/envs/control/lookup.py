"""The system behind an environment, and what its numbers mean."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from gymnasium.vector import SyncVectorEnv, VectorEnv, VectorWrapper

from acl_gym.envs.control.signals import Signals
from acl_gym.envs.control.system import ControlSystem


def system_of(env: Any) -> ControlSystem | None:
    """The system of an environment of this package, None for any other.

    Args:
        env: a single or a vector environment; wrappers are looked through, and so is
            a `SyncVectorEnv`.
    """
    base = getattr(env, "unwrapped", None)
    if isinstance(base, SyncVectorEnv):
        base = base.envs[0].unwrapped
    system = getattr(base, "system", None)
    return system if isinstance(system, ControlSystem) else None


def signals_of(env: Any) -> Signals | None:
    """What observations and actions of an environment mean; None if unknown.

    Where a wrapper changes the observations, their names are left out. Where it gives the
    actions another meaning, it says which in its `signals`.
    """
    wrapper = env
    while isinstance(wrapper, VectorWrapper):
        said = getattr(wrapper, "signals", None)
        if isinstance(said, Signals):
            if env.single_action_space != wrapper.single_action_space:
                return None
            if env.single_observation_space != wrapper.single_observation_space:
                return replace(said, observations=())
            return said
        wrapper = wrapper.env
    system = system_of(env)
    if system is None or system.signals is None:
        return None
    single = "single_" if isinstance(env, VectorEnv) else ""
    if getattr(env, f"{single}action_space") != system.action_space:
        return None
    if getattr(env, f"{single}observation_space") != system.observation_space:
        return replace(system.signals, observations=())
    return system.signals


def actions_are_replaced(env: Any) -> bool:
    """Whether a wrapper carries out other actions than those that it is given.

    Then the system alone is not what a policy of `env` acts on. Wrappers say so by an
    attribute `replaces_actions`, as `InnerLoop` and `Shield` do.
    """
    while isinstance(env, VectorWrapper):
        if getattr(env, "replaces_actions", False):
            return True
        env = env.env
    return False
