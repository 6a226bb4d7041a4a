"""Time limits of the environments: registered with an id, or chosen by a user."""

from __future__ import annotations

from typing import Any

from acl_gym.utils import validation

NO_LIMIT = -1
"""What `gym.make` takes for "no limit"; `gym.make_vec` of this package takes it too."""


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
