"""The kernel of the double bridge."""

from __future__ import annotations

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


@njit
def advance(
    states: FloatArray,
    actions: IntArray,
    next_state: IntArray,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Move each ant to the next place, in place; an ant at the food stays there.

    Args:
        states: `(n,)`, replaced by the next states.
        actions: `(n,)`.
        next_state: where each action leads, `(n_states, 2)`; the food is last.
        rewards: `(n,)`, receives -1, and 0 at the food.
        reached: `(n,)`, receives whether the next state is the food.
    """
    food = next_state.shape[0] - 1
    for i in range(actions.size):
        state = int(states[i])
        rewards[i] = 0.0 if state == food else -1.0
        states[i] = next_state[state, actions[i]]
        reached[i] = states[i] == food
