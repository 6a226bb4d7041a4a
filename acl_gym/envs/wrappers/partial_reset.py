"""Resetting some slots of a vector environment without harm to the statistics of others."""

from __future__ import annotations

from typing import Any

from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from acl_gym.utils.typing import BoolArray

_COUNTERS = ("episode_start_times", "episode_returns", "episode_lengths", "prev_dones")


def reset_slots(
    env: VectorEnv[Any, Any, Any], mask: BoolArray
) -> tuple[Any, dict[str, Any]]:
    """Start new episodes in some slots of an environment whose autoreset is disabled.

    `SyncVectorEnv` of Gymnasium 1.4 takes the mask out of the options, so that a
    `RecordEpisodeStatistics` around it sees a full reset and forgets what the slots that
    walk on have done so far. Here it remembers.

    Args:
        env: the environment, wrapped or not.
        mask: the slots to reset, `(num_envs,)`, at least one.

    Returns:
        What `reset` returns: the observations of all slots, and the infos.
    """
    recorders = _recorders(env)
    before = [
        {name: getattr(each, name).copy() for name in _COUNTERS} for each in recorders
    ]
    # Wrappers may keep or change the mask and the options, so they get new ones.
    result = env.reset(options={"reset_mask": mask.copy()})
    for recorder, counters in zip(recorders, before, strict=True):
        for name, values in counters.items():
            getattr(recorder, name)[~mask] = values[~mask]
    return result


def _recorders(env: VectorEnv[Any, Any, Any]) -> list[RecordEpisodeStatistics]:
    """The wrappers around `env` that count, from the outside in."""
    found = []
    while isinstance(env, VectorWrapper):
        if isinstance(env, RecordEpisodeStatistics):
            found.append(env)
        env = env.env
    return found
