"""The kernel of the two-state system of Figure 3.2."""

from __future__ import annotations

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

FIRST, SECOND, AT_GOAL = 0, 1, 2
"""The states q, q' and the goal."""


@njit
def advance(
    states: FloatArray,
    actions: IntArray,
    costs: FloatArray,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Move each ant to the next state, in place; an ant at the goal stays there.

    Args:
        states: `(n,)`, replaced by the next states.
        actions: `(n,)`.
        costs: of the actions in q', `(n_actions,)`.
        rewards: `(n,)`, receives minus the cost in q' and 0 elsewhere.
        reached: `(n,)`, receives whether the next state is the goal.
    """
    for i in range(actions.size):
        rewards[i] = -costs[actions[i]] if states[i] == SECOND else 0.0
        states[i] = min(states[i] + 1.0, float(AT_GOAL))
        reached[i] = states[i] == AT_GOAL
