"""What the steps of a rollout come to: outcomes, records, and the kernels of each step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class Step(NamedTuple):
    """The outcome of one step for the ants that took it, arrays of shape `(m,)`."""

    ants: IntArray
    """The slots that took the step."""
    observation: NDArray[Any]
    """Observations of all slots after the step, `(num_envs, ...)`."""
    cost: FloatArray
    """Stage costs, -reward."""
    terminated: BoolArray
    """Whether the episode ended in a terminal state."""
    finished: BoolArray
    """Whether the episode is over: a terminal state, the environment's limit or T."""


class Outcome(NamedTuple):
    """What the episodes of a trial came to."""

    costs: FloatArray
    """J of each finished episode, the sum of its stage costs."""
    success: BoolArray | None
    """Whether each was a success; None where nothing is known of success."""
    n_steps: int
    """Steps of all slots together."""


class Record:
    """Observations, actions and stage costs of all slots, step by step.

    Args:
        observation: the first ones.
        fresh: whether every observation is an array of its own. Other environments may
            write the next one to the same array, so that each is copied.
    """

    def __init__(self, observation: NDArray[Any], fresh: bool) -> None:
        self._fresh = fresh
        self.observations = [observation if fresh else observation.copy()]
        self.actions: list[IntArray] = []
        self.costs: list[FloatArray] = []

    def append(
        self, observation: NDArray[Any], actions: IntArray, reward: FloatArray
    ) -> None:
        """Add a step; the last two arguments are new arrays, or copied."""
        self.observations.append(observation if self._fresh else observation.copy())
        self.actions.append(actions)
        self.costs.append(-reward)


@njit
def spread_actions(
    ants: IntArray,
    actions: IntArray,
    first_action: int,
    n_actions: int,
    all_actions: IntArray,
) -> int:
    """Write the actions of the walking ants into the array of all slots.

    Returns:
        The first ant whose action is not in 0..n_actions - 1, or -1; after it, nothing
        is written.
    """
    for j in range(ants.size):
        if not 0 <= actions[j] < n_actions:
            return j
        all_actions[np.uint64(ants[j])] = actions[j] + first_action
    return -1


@njit
def account(
    ants: IntArray,
    reward: FloatArray,
    terminated: BoolArray,
    truncated: BoolArray,
    total_cost: FloatArray,
    length: IntArray,
    ended: BoolArray,
    cost: FloatArray,
    reached: BoolArray,
    stopped: BoolArray,
    left: IntArray,
) -> tuple[int, int]:
    """Add a step of the walking ants to their totals.

    Args:
        ants: the walking slots, `(m,)`.
        reward: of all slots.
        terminated: of all slots.
        truncated: of all slots.
        total_cost: J so far of all slots, updated.
        length: steps so far of all slots, updated.
        ended: whether each slot has ended in a terminal state, updated.
        cost: receives the stage cost of each walking ant, `(m,)`.
        reached: receives whether it is in a terminal state, `(m,)`.
        stopped: receives whether its episode has ended in any way, `(m,)`.
        left: receives the ants that are still walking, `(m,)`.

    Returns:
        The number of ants still walking, and a slot whose reward is not finite, or -1.
    """
    n_left = 0
    for j in range(ants.size):
        ant = np.uint64(ants[j])
        if not np.isfinite(reward[ant]):
            return n_left, int(ants[j])
        cost[j] = -reward[ant]
        total_cost[ant] += cost[j]
        length[ant] += 1
        ended[ant] |= terminated[ant]
        reached[j] = terminated[ant]
        stopped[j] = terminated[ant] | truncated[ant]
        left[n_left] = ants[j]
        n_left += not stopped[j]
    return n_left, -1
