"""Time limits of the environments: registered with an id, or chosen by a user."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TimeLimit

from acl_gym.utils import validation

NO_LIMIT = -1
"""What `gym.make` takes for "no limit"; `gym.make_vec` of this package takes it too."""

DEFAULT_MAX_STEPS = 300
"""T of Table 5.2, where nobody has set a limit."""


class RegisteredLimit(int):
    """A limit that comes with an id, for those who choose none themselves.

    An agent that is given a T, and an evaluation, walk as far as their own T says, also
    beyond a registered limit. A limit that a user has chosen always holds.
    """


def checked_limit(steps: Any) -> int | None:
    """Return the limit on the steps of an episode, None for no limit.

    Args:
        steps: an integer >= 1, or None or -1 for no limit.

    Raises:
        TypeError: it is not an integer.
        ValueError: it is another number below 1.
    """
    if steps is None or isinstance(steps, RegisteredLimit):
        return steps
    limit = validation.integer("max_episode_steps", steps, at_least=NO_LIMIT)
    if limit == 0:
        raise ValueError(
            "max_episode_steps must be at least 1, or -1 or None for no limit, got 0."
        )
    return None if limit == NO_LIMIT else limit


def trial_limit(own: int | None, trial: int | None) -> int:
    """How many steps an episode may last; 0 if there is no limit.

    Args:
        own: of the environment, None if it has none.
        trial: T of the trial under way, None if it has none.
    """
    if trial is None or own is None:
        return int(own or trial or 0)  # kernels take plain integers only
    return trial if isinstance(own, RegisteredLimit) else min(own, trial)


def usual_max_steps(env: Any) -> int:
    """T where none is given: the time limit of the environment, or 300 if it has none.

    Args:
        env: a single or a vector environment, or None.
    """
    return time_limit(env) or DEFAULT_MAX_STEPS


def time_limit(env: Any) -> int | None:
    """The time limit that an environment was made or registered with, or None.

    Args:
        env: a single or a vector environment, or None.

    Returns:
        Steps, >= 1; None where there is no limit, or nothing tells it.
    """
    base = getattr(env, "unwrapped", None)
    own = getattr(base, "max_episode_steps", None)
    if isinstance(base, VectorEnv) and hasattr(base, "max_episode_steps"):
        # It ends episodes itself. None: it was made without the limit that its id has.
        return int(own) if own and own > 0 else None
    # A vector of single environments may know its limit by those only; its own spec has
    # the limit of the id, and what the caller said beside it.
    for each in (*getattr(base, "envs", ())[:1], env):
        own = own or _limit_of_spec(each) or _limit_of_wrappers(each)
    return int(own) if own and own > 0 else None


def _limit_of_spec(env: Any) -> int | None:
    """The limit that `gym.make` or `gym.make_vec` was told, or that the id has."""
    spec = getattr(env, "spec", None)
    if spec is None:
        return None
    limit: int | None = spec.kwargs.get("max_episode_steps", spec.max_episode_steps)
    return limit


def _limit_of_wrappers(env: Any) -> int | None:
    """The limit of the outermost `TimeLimit`, where a single environment has no spec."""
    while isinstance(env, gym.Wrapper):
        if isinstance(env, TimeLimit):
            return env._max_episode_steps
        env = env.env
    return None
