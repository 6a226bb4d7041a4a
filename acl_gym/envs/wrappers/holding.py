"""A choice that is held for several steps of an environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from acl_gym.envs import received
from acl_gym.envs.control.bookkeeping import final_infos
from acl_gym.envs.wrappers.idle import IdleSlots
from acl_gym.envs.wrappers.partial_reset import reset_slots
from acl_gym.utils.typing import BoolArray

StepResult = tuple[Any, Any, Any, Any, dict[str, Any]]
OF_THE_END = ("is_success", "_is_success")
"""What infos tell of the end of an episode alone."""


def held(
    advance: Callable[[], StepResult],
    env: VectorEnv[Any, Any, Any],
    observation: Any,
    idle: IdleSlots,
    period: int,
) -> tuple[Any, Any, Any, Any, dict[str, Any], BoolArray]:
    """Make several steps of an environment whose finished slots wait, as if it were one.

    Rewards are summed. A slot whose episode ends on the way waits for the others. After
    that it is started anew, as its autoreset mode says, which the environment, whose slots
    wait, does not do by itself.

    Args:
        advance: makes a step of `env`.
        env: the environment.
        observation: the last one of all slots.
        idle: the account of its idle slots; it is brought up to date.
        period: how many steps, >= 1.

    Returns:
        What a step of a vector environment returns, and the slots that were started anew.

    Raises:
        ResetNeeded: autoreset is disabled, and a slot has finished.
    """
    idle.require_reset()
    resting = idle.mask
    rewards = np.zeros(resting.size)
    terminated, truncated = np.zeros_like(resting), np.zeros_like(resting)
    infos: dict[str, Any] = {}
    done = resting.copy()
    for _ in range(period):
        if done.all():
            break
        observation, reward, ended, late, told = advance()
        rewards += np.where(done, 0.0, reward)
        terminated |= ended & ~done
        truncated |= late & ~done
        done |= ended | late
        infos = merged_infos(infos, told)
    finished = terminated | truncated
    started = idle.finish(finished)
    if started.any():
        final: dict[str, Any] = {}
        if idle.mode is AutoresetMode.SAME_STEP:
            last = {name: infos.pop(name) for name in OF_THE_END if name in infos}
            final = final_infos(observation, finished, last)
        observation, begun = _started(env, started)
        infos = {**merged_infos(infos, begun), **final}
    return observation, rewards, terminated, truncated, infos, started


def _started(env: VectorEnv[Any, Any, Any], slots: BoolArray) -> tuple[Any, Any]:
    """Start some slots; the observations of all, and the infos."""
    begun, infos = received.parts("reset", reset_slots(env, slots), 2)
    return received.observations(begun, slots.size), received.infos(infos, slots.size)


def merged_infos(older: Mapping[str, Any], newer: Mapping[str, Any]) -> dict[str, Any]:
    """What infos of two steps tell together; the newer ones where both tell something.

    Args:
        older: of one step, with a mask `_key` for each key.
        newer: of a later one.
    """
    result = dict(newer)
    for mask_name, told in older.items():
        name = mask_name[1:]
        if not mask_name.startswith("_") or name not in older:
            continue
        if name not in newer:
            result[name], result[mask_name] = older[name], told
            continue
        told_again = newer.get(mask_name, np.ones_like(told))
        only_before = told & ~told_again
        if only_before.any():
            result[name] = _filled(newer[name], older[name], only_before)
            result[mask_name] = told | told_again
    return result


def _filled(values: Any, others: Any, where: BoolArray) -> Any:
    """The values, and the others in some slots; dicts part by part."""
    if isinstance(values, dict):
        return {
            key: _filled(part, others[key], where) if key in others else part
            for key, part in values.items()
        }
    filled = np.array(values)
    filled[where] = np.asarray(others)[where]
    return filled
