"""What a pair promises that no ant has tried: enough for ants to try it."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.greedy import LOOP, best_value
from acl_gym.colony.memory import Memory
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

GOOD = 0.9
"""The quantile of the values of remembered states that counts as good."""

NEWEST = 20_000
"""How many of the newest remembered states are looked at."""


def promised_level(
    memory: Memory, levels: FloatArray, optimism: float, discount: float, horizon: int
) -> float:
    """What pairs promise of which nothing is known, from what has been seen so far.

    It lies between the value of a good state, of which nine of ten are worse, and the
    most that could be had: the best reward for ever (without discounting: in each step of
    an episode), or the best reward at an end, or an end that costs nothing.

    Args:
        memory: what the ants remember.
        levels: what pairs promise now, `(n_cells, n_actions)`.
        optimism: where between the two it lies, in [0, 1].
        discount: gamma_rl, in [0, 1].
        horizon: the most steps of an episode, which count where discount is 1.
    """
    sizes = memory.last - memory.first
    steps = _steps_that_count(discount, horizon)
    going, ending, _ = _extreme_rewards(
        memory.first, memory.last, memory.terminated, memory.reward
    )
    most = max(0.0, going * steps, ending)
    if optimism == 1.0:
        return most
    count = int(np.searchsorted(np.cumsum(sizes[::-1]), NEWEST)) + 1
    first, last = memory.first[-count:], memory.last[-count:]
    values = np.empty(int((last - first).sum()))
    _values(first, last, memory.index, memory.degree, memory.allowed, levels, values)
    good = float(np.quantile(values, GOOD))
    return good + optimism * (most - good)


def possible_levels(
    memory: Memory, discount: float, horizon: int
) -> tuple[float, float]:
    """The least and the most that a pair can promise, from the rewards seen so far.

    The worst reward for ever; and the best one for ever, then the best end.

    Args:
        memory: what the ants remember.
        discount: gamma_rl, in [0, 1].
        horizon: the most steps of an episode. Where discount is 1, so many rewards can be
            had at most.
    """
    steps = _steps_that_count(discount, horizon)
    going, ending, worst = _extreme_rewards(
        memory.first, memory.last, memory.terminated, memory.reward
    )
    most = max(0.0, going) * steps + max(0.0, ending)
    return min(0.0, worst) * steps, most


def _steps_that_count(discount: float, horizon: int) -> float:
    """The sum of the weights of all steps that an episode may still have."""
    return float(horizon) if discount == 1.0 else 1.0 / (1.0 - discount)


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
    """The best that each state promises in which an ant took a step."""
    place = 0
    for path in range(first.size):
        for row in range(first[path], last[path]):
            values[place] = best_value(levels, index, degree, row, allowed, LOOP, LOOP)
            place += 1


@njit
def _extreme_rewards(
    first: IntArray, last: IntArray, terminated: BoolArray, reward: FloatArray
) -> tuple[float, float, float]:
    """The best reward before an ant went on, the best at an end, and the worst of all."""
    going = ending = -np.inf
    worst = np.inf
    for path in range(first.size):
        final = last[path] - 1
        for row in range(first[path], final):
            going = max(going, reward[row])
            worst = min(worst, reward[row])
        worst = min(worst, reward[final])
        if terminated[path]:
            ending = max(ending, reward[final])
        else:
            going = max(going, reward[final])
    return going, ending, worst
