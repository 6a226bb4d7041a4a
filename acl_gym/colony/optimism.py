"""What a pair promises of which nothing is known yet."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.greedy import best_value
from acl_gym.colony.memory import Memory
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, ActionArray


def promised_levels(
    memory: Memory, levels: FloatArray, quantile: float, discount: float, sample: int
) -> float:
    sizes = np.cumsum((memory.last - memory.first)[::-1])
    count = int(np.searchsorted(sizes, sample)) + 1
    first, last = memory.first[-count:], memory.last[-count:]
    values = np.empty(int((last - first).sum()))
    _values(first, last, memory.index, memory.degree, memory.allowed, levels, values)
    level = float(np.quantile(values, 0.9))
    going, ending = _best_rewards(
        memory.first, memory.last, memory.terminated, memory.reward
    )
    bound = max(0.0, going / (1 - discount), ending)
    return level + quantile * (bound - level)


@njit
def _best_rewards(
    first: IntArray, last: IntArray, terminated: BoolArray, reward: FloatArray
) -> tuple[float, float]:
    """The best reward of a step after which the ant went on, and of one that ended."""
    going = ending = -np.inf
    for path in range(first.size):
        for row in range(first[path], last[path] - 1):
            going = max(going, reward[row])
        if terminated[path]:
            ending = max(ending, reward[last[path] - 1])
        else:
            going = max(going, reward[last[path] - 1])
    return going, ending


@njit
def _values(
    first: IntArray,
    last: IntArray,
    index: CellArray,
    degree: FloatArray,
    allowed: BoolArray,
    levels: FloatArray,
    values: FloatArray,
) -> None:
    place = 0
    for path in range(first.size):
        for row in range(first[path], last[path]):
            values[place] = best_value(levels, index, degree, row, allowed)
            place += 1
