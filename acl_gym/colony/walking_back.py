"""The returning ants: they walk their paths back and lay what they know by then.

Levels promise Q(x, u), the sum of those of the cells of x weighted with its degrees, and
V(x), the largest Q(x, u) over the allowed u. At a pair (x_t, u_t) an ant on its way back
expects

    G_t = r_t + discount * (mix * G_{t+1} + (1 - mix) * V(x_{t+1})),

all from the levels of before this walk. In a terminal state G and V are 0; where the path
ends otherwise, G is V. It lays on each cell by how much the promise falls short,
G_t - Q(x_t, u_t). What all ants lay on a pair is merged by its mean, weighted with the
degrees, and the level moves by a share of that.

In a state that has one cell, Q is its level, so that the level moves towards the mean of
what is expected. Where cells overlap, that mean would blur what differs from one side of
a cell to the other. The mean of the shortfalls does not: it is a step of the simultaneous
iterative reconstruction technique, which approaches the least-squares fit of the levels
to all that is expected (Gilbert, 1972, doi:10.1016/0022-5193(72)90180-4). Such a fit may
exceed what is possible where there is little evidence. So levels stay between bounds.

The sums are kept in fixed point: integers add up to the same bits in any order, so that
neither the order of the ants, nor the number of threads or processes matters.
"""

from __future__ import annotations

import math

import numpy as np

from acl_gym.colony.greedy import best_value
from acl_gym.colony.memory import UNITS, Memory
from acl_gym.partitions.kernels import written_out
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
        self._laid: IntArray = np.zeros((levels.size, 4), np.int64)
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
        bounds: tuple[float, float],
    ) -> None:
        """Let ants walk paths back, all on the same levels, then merge.

        A level moves by the share `rate * largest * (n / N) ** trust` of the mean of what
        was laid: `largest` is the largest degree with which it was visited, n the
        evidence of these paths, N that of all remembered ones.

        Args:
            memory: the paths, located in the cells of the levels.
            paths: which of them, different numbers.
            discount: gamma, in [0, 1].
            mix: weight of the ant's own continuation, in [0, 1]; the rest is V.
            rate: rho, in (0, 1].
            trust: in [0, 1]. 0 follows the latest paths, 1 the mean of all.
            bounds: the least and the most that a level may be.

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
            written_out(memory.index.shape[1]),
            written_out(memory.n_actions),
            discount,
            mix,
            scale,
            float(UNITS),
            self._laid,
            self._touched,
        )
        _merge(
            self._touched[:count],
            self._laid,
            memory.evidence,
            scale,
            float(UNITS),
            rate,
            trust,
            *bounds,
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
        bound = (reward + 2.0 * level) * (steps + 1) * int((last - first).sum() + 1)
        if not bound < 2.0**1000:
            raise ValueError(
                f"levels and rewards must be numbers that can be added up, got {level:g} "
                f"and {reward:g}; scale the rewards down."
            )
        return math.ldexp(1.0, _BITS - max(math.frexp(bound)[1], -900))


@njit(error_model="numpy")
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
    corners: tuple[int, ...],
    choices: tuple[int, ...],
    discount: float,
    mix: float,
    scale: float,
    units: float,
    laid: IntArray,
    touched: IntArray,
) -> int:
    """Add up what ants lay on each pair.

    Args:
        first: row of the first state of each path.
        last: row of its last state.
        terminated: whether that is a terminal state.
        index: cells of the states, `(rows, k)`.
        degree: their degrees, `(rows, k)`.
        action: what was done, `(rows,)`.
        reward: what that gave, `(rows,)`.
        allowed: U_q, `(rows, n_actions)`, or empty.
        levels: `(n_cells, n_actions)`.
        corners: a tuple as long as k, or empty, see `written_out`.
        choices: a tuple as long as n_actions, or empty.
        discount: gamma_rl.
        mix: weight of an ant's own continuation.
        scale: of the sums of deposits.
        units: of the sums of degrees.
        laid: for each pair the sum of the deposits times their degrees, the sum of the
            degrees, and the largest degree, all integers, `(n_pairs, 4)`; side by side,
            since most of the time goes into fetching them. Zeros before.
        touched: receives the pairs that were visited, `(>= n_pairs,)`.

    Returns:
        How many pairs were visited.
    """
    n_actions, count = np.uint64(levels.shape[1]), 0
    own, promised = discount * mix, discount * (1.0 - mix)
    for path in range(first.size):
        end = last[path]
        value = 0.0
        if not terminated[path]:
            value = best_value(levels, index, degree, end, allowed, corners, choices)
        expected = value
        for row in range(end - 1, first[path] - 1, -1):
            expected = reward[row] + own * expected + promised * value
            place = np.uint64(row)
            taken = np.uint64(action[place])
            said = 0.0
            for c in range(len(corners) or index.shape[1]):
                cell = np.uint64(index[place, np.uint64(c)])
                said += degree[place, np.uint64(c)] * levels[cell, taken]
            short = expected - said
            for c in range(len(corners) or index.shape[1]):
                share = degree[place, np.uint64(c)]
                if share > 0.0:
                    cell = np.uint64(index[place, np.uint64(c)])
                    pair = cell * n_actions + taken
                    weight = max(np.int64(np.rint(share * units)), 1)
                    if laid[pair, 1] == 0:
                        touched[count] = np.int64(pair)
                        count += 1
                    laid[pair, 0] += np.int64(np.rint(share * short * scale))
                    laid[pair, 1] += weight
                    laid[pair, 2] = max(laid[pair, 2], weight)
            if row > first[path]:
                value = best_value(
                    levels, index, degree, row, allowed, corners, choices
                )
    return count


@njit
def _merge(
    touched: IntArray,
    laid: IntArray,
    evidence: IntArray,
    scale: float,
    units: float,
    rate: float,
    trust: float,
    least: float,
    most: float,
    levels: FloatArray,
    known: BoolArray,
) -> None:
    """Move the level of each touched pair by its mean, and clear the sums."""
    for j in range(touched.size):
        pair = touched[j]
        weight = laid[pair, 1]
        mean = laid[pair, 0] / weight * (units / scale)
        step = rate * laid[pair, 2] / units
        if trust > 0.0:
            step *= min(1.0, weight / max(evidence[pair], 1)) ** trust
        levels[pair] = min(max(levels[pair] + step * mean, least), most)
        known[pair] = True
        laid[pair] = 0
