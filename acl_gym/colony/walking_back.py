"""The returning ants: they walk their paths back and lay what they know by then.

At a pair (x_t, u_t) an ant on its way back lays

    G_t = r_t + discount * (mix * G_{t+1} + (1 - mix) * V(x_{t+1})),

V(x) being the best that the levels of before this walk promise in x. In a terminal state
both are 0; where the path ends otherwise, both are V. What all ants lay on a pair is
merged by its mean, weighted with the degrees, and the level moves towards the mean.

The sums are kept in fixed point: integers add up to the same bits in any order, so that
neither the order of the ants, nor the number of threads or processes matters.
"""

from __future__ import annotations

import math

import numpy as np

from acl_gym.colony.greedy import best_value
from acl_gym.colony.memory import UNITS, Memory
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import (
    ActionArray,
    BoolArray,
    CellArray,
    FloatArray,
    IntArray,
)

_BITS = 62  # of a sum, beside its sign


class WalkBack:
    """Walks paths of a memory back and merges what the ants lay into the levels.

    Args:
        levels: what each pair promises, the higher the better, `(n_cells, n_actions)`;
            changed in place.

    Attributes:
        known: whether anything was ever laid on a pair, `(n_cells, n_actions)`.
    """

    def __init__(self, levels: FloatArray) -> None:
        self.levels = levels
        self.known: BoolArray = np.zeros(levels.shape, np.bool_)
        self._sum: IntArray = np.zeros(levels.size, np.int64)
        self._weight: IntArray = np.zeros(levels.size, np.int64)
        self._largest: FloatArray = np.zeros(levels.size)
        self._touched: IntArray = np.zeros(levels.size, np.int64)

    def walk(
        self,
        memory: Memory,
        paths: IntArray,
        *,
        discount: float,
        mix: float,
        rate: float,
        trust: float,
    ) -> None:
        """Let ants walk paths back, all on the same levels, then merge.

        A level moves by the share `rate * largest * (n / N) ** trust` of the way to the
        mean of what was laid: `largest` is the largest degree with which it was
        visited, n the evidence of these paths, N that of all remembered ones.

        Args:
            memory: the paths, located in the cells of the levels.
            paths: which of them, different numbers.
            discount: gamma, in [0, 1].
            mix: weight of the ant's own continuation, in [0, 1]; the rest is V.
            rate: rho, in (0, 1].
            trust: in [0, 1]. 0 follows the latest paths, 1 the mean of all.

        Raises:
            ValueError: levels or rewards are not finite, or too large to be added up.
        """
        first, last = memory.first[paths], memory.last[paths]
        scale = self._scale(memory, first, last, discount * mix)
        count = _walk_back(
            first,
            last,
            memory.terminated[paths],
            memory.index,
            memory.degree,
            memory.action,
            memory.reward,
            memory.allowed,
            self.levels,
            discount,
            mix,
            scale,
            float(UNITS),
            self._sum,
            self._weight,
            self._largest,
            self._touched,
        )
        _merge(
            self._touched[:count],
            self._sum,
            self._weight,
            self._largest,
            memory.evidence,
            UNITS / scale,
            rate,
            trust,
            self.levels.reshape(-1),
            self.known.reshape(-1),
        )

    def _scale(
        self, memory: Memory, first: IntArray, last: IntArray, kept: float
    ) -> float:
        """The power of two by which deposits are multiplied before they are added up.

        The largest for which no sum can overflow: what an ant lays is at most the sum
        of its rewards, `kept` of one carried to the next, and the promised levels.
        """
        longest = int((last - first).max(initial=1))
        steps = longest if kept == 1.0 else min(longest, 1.0 / (1.0 - kept))
        rows = memory.reward[int(first.min()) : int(last.max())]
        reward = max(abs(rows.min(initial=0.0)), abs(rows.max(initial=0.0)))
        level = max(abs(self.levels.min()), abs(self.levels.max()))
        bound = (reward + level) * (steps + 1) * int((last - first).sum() + 1)
        if not bound < 2.0**1000:
            raise ValueError(
                f"levels and rewards must be numbers that can be added up, got {level:g} "
                f"and {reward:g}; scale the rewards down."
            )
        return math.ldexp(1.0, _BITS - max(math.frexp(bound)[1], -900))


@njit
def _walk_back(
    first: IntArray,
    last: IntArray,
    terminated: BoolArray,
    index: CellArray,
    degree: FloatArray,
    action: ActionArray,
    reward: FloatArray,
    allowed: BoolArray,
    levels: FloatArray,
    discount: float,
    mix: float,
    scale: float,
    units: float,
    total: IntArray,
    weight: IntArray,
    largest: FloatArray,
    touched: IntArray,
) -> int:
    """Add what ants lay to `total`, in units of 1 / scale, and its weights.

    Returns how many pairs were touched.
    """
    n_actions, count = levels.shape[1], 0
    own, promised = discount * mix, discount * (1.0 - mix)
    for path in range(first.size):
        end = last[path]
        value = 0.0
        if not terminated[path]:
            value = best_value(levels, index, degree, end, allowed)
        laid = value
        for row in range(end - 1, first[path] - 1, -1):
            laid = reward[row] + own * laid + promised * value
            for c in range(index.shape[1]):
                share = degree[row, c]
                if share > 0.0:
                    pair = np.int64(index[row, c]) * n_actions + np.int64(action[row])
                    if weight[pair] == 0:
                        touched[count] = pair
                        count += 1
                    total[pair] += np.int64(np.rint(share * laid * scale))
                    weight[pair] += max(np.int64(np.rint(share * units)), 1)
                    largest[pair] = max(largest[pair], share)
            if row > first[path]:
                value = best_value(levels, index, degree, row, allowed)
    return count


@njit
def _merge(
    touched: IntArray,
    total: IntArray,
    weight: IntArray,
    largest: FloatArray,
    evidence: IntArray,
    unit: float,
    rate: float,
    trust: float,
    levels: FloatArray,
    known: BoolArray,
) -> None:
    """Move the level of each touched pair towards its mean, and clear the sums."""
    for j in range(touched.size):
        pair = touched[j]
        mean = total[pair] / weight[pair] * unit
        share = min(1.0, weight[pair] / max(evidence[pair], 1))
        step = rate * largest[pair]
        if trust > 0.0:
            step *= share**trust
        levels[pair] += step * (mean - levels[pair])
        known[pair] = True
        total[pair] = 0
        weight[pair] = 0
        largest[pair] = 0.0
