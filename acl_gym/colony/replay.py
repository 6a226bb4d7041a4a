"""Q-learning from memory: remembered steps are learned from again, one after the other.

A path is replayed backwards, so that what its end has taught reaches its beginning in
one pass. Each step moves the value of its pair towards

    G_t = r_t + discount * ((1 - lambda) * V(x_{t+1}) + lambda * G_{t+1}),

V(x) being the largest value in x as it is by then. This is the forward view of Watkins's
Q(lambda): a remembered action is the policy's only while it is greedy, and where it is
not, G_{t+1} is replaced by V(x_{t+1}), which is what cutting the trace means. In a
terminal state V is 0; where the path ends otherwise, G is V. With lambda = 0 it is
Q-learning, eq. (3.44), replayed backwards.

Traces would have to walk forwards, and their errors would refer to values that
learning has changed since; a return from the end needs no traces, and no more than one
pass, and is the same method for values that stand still.

References: Watkins (1989), chapter 5; Lin (1992), on replaying backwards; Sutton and
Barto (2018), section 12.10; Daley and Amato (2019), on lambda-returns from memory.
"""

from __future__ import annotations

import numpy as np

from acl_gym.colony.greedy import best_value
from acl_gym.colony.memory import Memory
from acl_gym.partitions.kernels import written_out
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import (
    ActionArray,
    BoolArray,
    CellArray,
    FloatArray,
    IntArray,
)


def replay(
    memory: Memory,
    paths: IntArray,
    values: FloatArray,
    *,
    rate: float,
    discount: float,
    trace_decay: float,
) -> None:
    """Learn from paths of a memory again, in the order given, each backwards.

    Args:
        memory: the paths, located in the cells of the values.
        paths: which of them.
        values: Q, `(n_cells, n_actions)`, changed in place.
        rate: alpha_rl, in (0, 1].
        discount: gamma_rl, in [0, 1].
        trace_decay: lambda, in [0, 1].
    """
    _replay(
        memory.first[paths],
        memory.last[paths],
        memory.terminated[paths],
        memory.index,
        memory.degree,
        memory.action,
        memory.reward,
        memory.allowed,
        values,
        written_out(memory.index.shape[1]),
        written_out(memory.n_actions),
        rate,
        discount,
        trace_decay,
    )


@njit
def _replay(
    first: IntArray,
    last: IntArray,
    terminated: BoolArray,
    index: CellArray,
    degree: FloatArray,
    action: ActionArray,
    reward: FloatArray,
    allowed: BoolArray,
    values: FloatArray,
    corners: tuple[int, ...],
    choices: tuple[int, ...],
    rate: float,
    discount: float,
    trace_decay: float,
) -> None:
    """Replay paths, see `replay`.

    Args:
        first: row of the first state of each path.
        last: row of its last state.
        terminated: whether that is a terminal state.
        index: cells of the states, `(rows, k)`.
        degree: their degrees, `(rows, k)`.
        action: what was done, `(rows,)`.
        reward: what that gave, `(rows,)`.
        allowed: U_q, `(rows, n_actions)`, or empty.
        values: `(n_cells, n_actions)`.
        corners: a tuple as long as k, or empty, see `written_out`.
        choices: a tuple as long as n_actions, or empty.
        rate: alpha_rl.
        discount: gamma_rl.
        trace_decay: lambda.
    """
    for path in range(first.size):
        end = last[path]
        best = 0.0
        if not terminated[path]:
            best = best_value(values, index, degree, end, allowed, corners, choices)
        following = best
        for row in range(end - 1, first[path] - 1, -1):
            target = reward[row] + discount * (best + trace_decay * (following - best))
            taken = action[row]
            error = target - _value(values, index, degree, row, taken, corners)
            for c in range(len(corners) or index.shape[1]):
                place = np.uint64(c)
                cell = np.uint64(index[np.uint64(row), place])
                share = degree[np.uint64(row), place]
                values[cell, np.uint64(taken)] += rate * share * error
            if row > first[path]:
                best = best_value(values, index, degree, row, allowed, corners, choices)
                # The same sums as those in `best`, so that equal is equal.
                own = _value(values, index, degree, row, taken, corners)
                following = target if own >= best else best


@njit(inline="always")
def _value(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    j: int,
    u: int,
    corners: tuple[int, ...],
) -> float:
    """The degree-weighted value of action u in state j."""
    state, column, value = np.uint64(j), np.uint64(u), 0.0
    for c in range(len(corners) or index.shape[1]):
        cell = np.uint64(index[state, np.uint64(c)])
        value += degree[state, np.uint64(c)] * values[cell, column]
    return value
