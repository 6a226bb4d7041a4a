"""The kernels of the grid searches of §3.6.2 and §3.6.6."""

from __future__ import annotations

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


@njit(error_model="numpy")
def move(
    states: FloatArray,
    actions: IntArray,
    next_state: IntArray,
    goal: BoolArray,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Carry out every move, in place.

    Args:
        states: `(n,)`, replaced by the next states.
        actions: `(n,)`.
        next_state: where each action leads, `(n_states, n_actions)`.
        goal: whether each state is a goal, `(n_states,)`.
        rewards: `(n,)`, receives -1.
        reached: `(n,)`, receives whether the next state is a goal.
    """
    for i in range(actions.size):
        cell = next_state[int(states[i]), actions[i]]
        states[i] = cell
        rewards[i] = -1.0
        reached[i] = goal[cell]


@njit(error_model="numpy")
def move_or_fail(
    states: FloatArray,
    actions: IntArray,
    uniforms: FloatArray,
    probability: float,
    next_state: IntArray,
    goal: BoolArray,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Carry out each move with some probability, in place; the others stay.

    Args:
        states: `(n,)`, replaced by the next states.
        actions: `(n,)`.
        uniforms: random numbers from [0, 1), `(n,)`.
        probability: that a move is carried out, in (0, 1].
        next_state: where each action leads, `(n_states, n_actions)`.
        goal: whether each state is a goal, `(n_states,)`.
        rewards: `(n,)`, receives -1.
        reached: `(n,)`, receives whether the next state is a goal.
    """
    for i in range(actions.size):
        cell = int(states[i])
        if uniforms[i] < probability:
            cell = next_state[cell, actions[i]]
        states[i] = cell
        rewards[i] = -1.0
        reached[i] = goal[cell]
