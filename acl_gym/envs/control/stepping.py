"""A step of the active slots, while those that have finished are idle."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.control.system import ControlSystem, SlotError
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

Scratch = tuple[FloatArray, NDArray[Any], FloatArray, BoolArray]

RESTORE_ABOVE = 0.75
"""Share of walking slots above which it is faster to step all and restore the rest."""


class PartialStep:
    """Gathers some slots side by side, advances them, and puts them back.

    Idle slots cost nothing, and nothing is allocated. If most slots are active, all are
    advanced in place and the idle ones restored; the results are the same.

    Args:
        system: whose states are advanced.
        num_envs: number of slots.
    """

    def __init__(self, system: ControlSystem, num_envs: int) -> None:
        self._system = system
        self._states: FloatArray = np.empty(0)
        self._actions: NDArray[Any] = np.empty(num_envs, dtype=np.int64)
        if isinstance(system.action_space, spaces.Box):
            self._actions = np.empty((num_envs, *system.action_space.shape))
        self._rewards: FloatArray = np.empty(num_envs)
        self._reached: BoolArray = np.empty(num_envs, dtype=np.bool_)
        self._scratch: Scratch | None = None
        self._before: FloatArray = np.empty((0, 0))

    def __call__(
        self,
        limit: int,
        slots: IntArray,
        idle: BoolArray,
        states: FloatArray,
        steps: IntArray,
        actions: NDArray[Any],
        uniforms: FloatArray | None,
        rewards: FloatArray,
        terminated: BoolArray,
        truncated: BoolArray,
    ) -> tuple[int, BoolArray | None]:
        """Step some slots; the entries of the others stay as they are.

        Args:
            limit: steps after which a slot is truncated; 0 means none.
            slots: those that step, `(m,)`.
            idle: whether each slot does not step, `(num_envs,)`.
            states: of all slots, `(state_size, num_envs)`, replaced by the next ones.
            steps: of all slots so far, counted up.
            actions: of all slots.
            uniforms: `(draws_per_step, m)`, None if the system needs none.
            rewards: of all slots, zeros; receives those of `slots`.
            terminated: of all slots, False; receives whether `slots` are at the goal, or
                have failed.
            truncated: of all slots, False; receives whether the limit is reached.

        Returns:
            How many slots have finished, and which of all slots have failed,
            `(num_envs,)`; None if the system says of none that it has.
        """
        if uniforms is None and slots.size > RESTORE_ABOVE * idle.size:
            if self._before.shape != states.shape:
                self._before = np.empty_like(states)
            np.copyto(self._before, states)
            try:
                failed = self._system.advance(
                    states, actions, None, rewards, terminated
                )
            except SlotError:
                # Perhaps in an idle slot: without these it fails for good or not at all.
                np.copyto(states, self._before)
                rewards.fill(0.0)
                terminated.fill(False)
            else:
                if failed is not None:
                    failed &= ~idle
                    terminated |= failed
                n_finished: int = put_idle_back(
                    idle,
                    self._before,
                    limit,
                    states,
                    steps,
                    rewards,
                    terminated,
                    truncated,
                )
                return n_finished, failed
        part, part_actions, part_rewards, part_reached = self._scratch_for(
            slots, states
        )
        gather_slots(slots, states, actions, part, part_actions)
        try:
            part_failed = self._system.advance(
                part, part_actions, uniforms, part_rewards, part_reached
            )
        except SlotError as error:
            raise SlotError(error.message, int(slots[error.slot])) from error
        failed = None
        if part_failed is not None:
            part_reached |= part_failed
            failed = np.zeros(idle.size, np.bool_)
            failed[slots] = part_failed
        n_finished = put_slots_back(
            slots,
            part,
            part_rewards,
            part_reached,
            limit,
            states,
            steps,
            rewards,
            terminated,
            truncated,
        )
        return n_finished, failed

    def _scratch_for(self, slots: IntArray, states: FloatArray) -> Scratch:
        """Return scratch arrays: those of the last step if they have the right size."""
        size, m = len(states), slots.size
        scratch = self._scratch
        if scratch is None or scratch[0].shape != (size, m):
            if self._states.size != states.size:
                self._states = np.empty(states.size)
            part = self._states[: size * m].reshape(size, m)
            scratch = part, self._actions[:m], self._rewards[:m], self._reached[:m]
            self._scratch = scratch
        return scratch


@njit
def gather_slots(
    slots: IntArray,
    states: FloatArray,
    actions: NDArray[Any],
    part: FloatArray,
    part_actions: NDArray[Any],
) -> None:
    """Copy the columns of `slots` side by side."""
    for j in range(slots.size):
        slot = np.uint64(slots[j])  # unsigned: no check for indices from the end
        part_actions[j] = actions[slot]
        for row in range(states.shape[0]):
            part[row, j] = states[row, slot]


@njit
def put_slots_back(
    slots: IntArray,
    part: FloatArray,
    part_rewards: FloatArray,
    part_reached: BoolArray,
    limit: int,
    states: FloatArray,
    steps: IntArray,
    rewards: FloatArray,
    terminated: BoolArray,
    truncated: BoolArray,
) -> int:
    """Undo `gather_slots` after a step and count the step; `limit` 0 means none.

    Returns how many slots have finished.
    """
    n_finished = 0
    for j in range(slots.size):
        slot = np.uint64(slots[j])
        for row in range(states.shape[0]):
            states[row, slot] = part[row, j]
        steps[slot] += 1
        rewards[slot] = part_rewards[j]
        terminated[slot] = part_reached[j]
        truncated[slot] = (limit > 0) & (steps[slot] >= limit)
        n_finished += terminated[slot] | truncated[slot]
    return n_finished


@njit
def put_idle_back(
    idle: BoolArray,
    before: FloatArray,
    limit: int,
    states: FloatArray,
    steps: IntArray,
    rewards: FloatArray,
    terminated: BoolArray,
    truncated: BoolArray,
) -> int:
    """Undo the step of the idle slots and count that of the others; vectorised.

    Returns how many slots have finished.
    """
    for row in range(states.shape[0]):
        now, then = states[row], before[row]
        for slot in range(idle.size):
            now[slot] = then[slot] if idle[slot] else now[slot]
    n_finished = 0
    for slot in range(idle.size):
        rewards[slot] = 0.0 if idle[slot] else rewards[slot]
    for slot in range(idle.size):
        walks = not idle[slot]
        steps[slot] += walks
        terminated[slot] &= walks
        truncated[slot] = walks & (limit > 0) & (steps[slot] >= limit)
        n_finished += terminated[slot] | truncated[slot]
    return n_finished
