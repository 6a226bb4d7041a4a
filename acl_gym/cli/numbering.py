"""Real inputs as numbered actions: `--discretize`, and values from end to end."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
from gymnasium import spaces

from acl_gym.cli.errors import BadArgumentError
from acl_gym.utils.boxes import MOST_ACTIONS


def parse_bins(text: str | None) -> tuple[int, ...] | None:
    """Parse `--discretize`: 5, or 5,3.

    Raises:
        BadArgumentError: it is neither a number >= 2 nor a list of those.
    """
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() and 2 <= int(part) <= MOST_ACTIONS for part in parts):
        raise BadArgumentError(
            "--discretize must be a number of values >= 2 such as 5, or one for each "
            f"dimension such as 5,3, got {text!r}."
        )
    return tuple(map(int, parts))


def discretized(
    name: str, env: gym.Env[Any, Any], bins: tuple[int, ...]
) -> gym.Env[Any, Any]:
    """An environment whose actions are the middles of equal parts of the range.

    Args:
        name: its id, for messages.
        env: with a Box of actions.
        bins: how many parts, one number for all inputs or one for each.

    Raises:
        BadArgumentError: its actions are no Box, or `bins` do not fit it.
    """
    from gymnasium.wrappers import DiscretizeAction

    space = env.action_space
    if not isinstance(space, spaces.Box):
        raise BadArgumentError(
            f"--discretize is for continuous actions, but {name} has {space}; leave it "
            "out."
        )
    count = math.prod(space.shape)
    if len(bins) not in (1, count):
        raise BadArgumentError(
            f"--discretize must have one number, or one for each of the {count} "
            f"dimensions of {space}, got {','.join(map(str, bins))}."
        )
    each = bins * count if len(bins) == 1 else bins
    if math.prod(each) > MOST_ACTIONS:
        raise BadArgumentError(
            f"--discretize must make at most {MOST_ACTIONS:,} actions, got "
            f"{math.prod(each):,} of {count} dimensions; take fewer values, or one "
            "number for each dimension such as 5,3."
        )
    return DiscretizeAction(env, bins=each)


def gridded(env: gym.Env[Any, Any], bins: tuple[int, ...]) -> gym.Env[Any, Any]:
    """An environment whose actions are the points of an `ActionGrid`.

    Args:
        env: with a bounded Box of actions of one axis.
        bins: how many values, one number for all inputs or one for each.

    Raises:
        ValueError: its actions are no such Box.
    """
    from gymnasium.wrappers import TransformAction

    from acl_gym.envs.wrappers.action_grid import grid_over

    _, values = grid_over(env.action_space, counts_of(bins))
    return TransformAction(env, values.__getitem__, spaces.Discrete(len(values)))


def counts_of(bins: tuple[int, ...]) -> int | tuple[int, ...]:
    """How `ActionGrid` is told of bins: one number for all inputs, or one for each."""
    return bins[0] if len(bins) == 1 else bins
