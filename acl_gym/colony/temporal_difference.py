"""Q-learning's update, eq. (3.44), for all slots of a step."""

from __future__ import annotations

from acl_gym.colony.greedy import LOOP, best_value
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


@njit(inline="always")
def td_error(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    u: int,
    cost: float,
    terminated: bool,
    next_index: CellArray,
    next_degree: FloatArray,
    next_allowed: BoolArray,
    discount: float,
    j: int,
) -> float:
    """The temporal-difference error of slot j: by how much the value of its pair is off."""
    best = 0.0
    if not terminated:
        best = best_value(values, next_index, next_degree, j, next_allowed, LOOP, LOOP)
    error = -cost + discount * best
    for c in range(index.shape[1]):
        error -= degree[j, c] * values[index[j, c], u]
    return error


@njit
def update_values(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    costs: FloatArray,
    terminated: BoolArray,
    next_index: CellArray,
    next_degree: FloatArray,
    next_allowed: BoolArray,
    learning_rate: float,
    discount: float,
) -> None:
    """Q-learning update, eq. (3.44), slot by slot, each on the values as they then are.

    Adding up the slots' corrections instead would overshoot where many slots share a
    cell: with ten slots at a rate of 0.3 it would move by three times the error.
    """
    for j in range(actions.size):
        u = actions[j]
        error = td_error(
            values,
            index,
            degree,
            u,
            costs[j],
            terminated[j],
            next_index,
            next_degree,
            next_allowed,
            discount,
            j,
        )
        for c in range(index.shape[1]):
            values[index[j, c], u] += learning_rate * degree[j, c] * error
