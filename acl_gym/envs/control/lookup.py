"""The system behind an environment, and what its numbers mean."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv, VectorWrapper
from gymnasium.wrappers import DiscretizeAction
from numpy.typing import NDArray

from acl_gym.envs.control.signals import Signals
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.wrappers.action_grid import ActionGrid


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
    actions another meaning, it says which in its `signals`. Where actions are numbered
    inputs, of an `ActionGrid` or of Gymnasium's `DiscretizeAction`, these are known in any
    environment.
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
    own = None if system is None else system.signals
    values = _numbered_inputs(env)
    if values is not None:
        numbered = Signals.of_inputs(values)
        names = numbered.inputs
        if own is not None and len(own.inputs) == len(names):
            names = own.inputs
        own = Signals(
            () if own is None else own.observations,
            names,
            numbered.values,
            values.dtype.name,
        )
    elif own is None or _space(env, "action") != getattr(system, "action_space", None):
        return None
    seen = None if system is None else system.observation_space
    if _space(env, "observation") != seen:
        return replace(own, observations=())
    return own


def _space(env: Any, name: str) -> Any:
    """The space of one slot."""
    single = "single_" if isinstance(env, VectorEnv) else ""
    return getattr(env, f"{single}{name}_space")


def _numbered_inputs(env: Any) -> NDArray[Any] | None:
    """The inputs of each action, `(n_actions, n_inputs)`, where a wrapper numbers them."""
    space = _space(env, "action")
    while isinstance(env, VectorWrapper):
        if isinstance(env, ActionGrid) and env.single_action_space == space:
            return env.values
        env = env.env
    if isinstance(env, SyncVectorEnv):
        env = env.envs[0]
    while isinstance(env, gym.Wrapper):
        if isinstance(env, DiscretizeAction) and env.action_space == space:
            point: Callable[[int], Any] = env.action
            points = [np.ravel(point(u)) for u in range(int(space.n))]
            return np.array(points)
        env = env.env
    return None


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
