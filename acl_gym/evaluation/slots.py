"""Environments of this package with a slot for each of some states."""

from __future__ import annotations

from typing import Any
from weakref import WeakSet

from gymnasium.vector import VectorEnv

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.action_grid import ActionGrid
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray
from acl_gym.utils.vector_envs import require_vector_env

_OWN: WeakSet[ControlVectorEnv] = WeakSet()
"""Environments that were made for evaluations, so that nobody else steps them."""


def control_env(env: VectorEnv[Any, Any, Any]) -> ControlVectorEnv:
    """The environment of this package that `env` is or wraps.

    Raises:
        TypeError: it is no vector environment, or of another package.
    """
    require_vector_env(env)
    base = env.unwrapped
    if not isinstance(base, ControlVectorEnv):
        raise TypeError(
            "env must be a vector environment of acl_gym, which can start from any "
            f"state, got {type(base).__name__}."
        )
    return base


def rows_of_states(states: Any) -> FloatArray:
    """Return states, one row for each episode."""
    rows = validation.real_array("states", states)
    if rows.ndim == 0:
        raise ValueError(
            "states must hold one row for each episode, got "
            f"{validation.shown(states)}; pass [state]."
        )
    return rows


def with_slots_for(
    env: VectorEnv[Any, Any, Any], states: FloatArray | None = None
) -> VectorEnv[Any, Any, Any]:
    """An environment for evaluations, with one slot per initial state.

    To evaluate often, call this once and pass the result to `evaluate_policy_cost`
    each time: it is not copied again.

    Args:
        env: where to evaluate.
        states: initial states; None takes `evaluation_states()` of an environment of
            this package.

    Returns:
        A new environment of the same system, whose random numbers continue a copy of
        the stream of `env`, in an `ActionGrid` if that is all `env` is wrapped in; or
        `env` itself if it is wrapped or of another package, or
        is such a new environment with the right number of slots.

    Raises:
        TypeError: `env` is not a vector environment.
    """
    require_vector_env(env)
    base = env.unwrapped
    if isinstance(env, ActionGrid) and env.env is base:
        inside = with_slots_for(base, states)
        return env if inside is base else ActionGrid(inside, env.counts)
    if base is not env or not isinstance(base, ControlVectorEnv):
        return env
    if states is None:
        states = base.system.evaluation_states()
    if base in _OWN and base.num_envs == len(states):
        return base
    copied = base.with_slots(len(states))
    _OWN.add(copied)
    return copied
