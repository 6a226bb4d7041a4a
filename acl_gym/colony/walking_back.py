"""The returning ants: they walk their paths back and lay what they then know.

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
_PARTS = 4  # integers of a pair, see `_walk_back`
_BLOCK_BITS = 6  # pairs are merged in blocks of 2 ** 6


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
        self._laid: IntArray = np.zeros(levels.size * _PARTS, np.int64)
        self._visited: BoolArray = np.zeros((levels.size >> _BLOCK_BITS) + 1, np.bool_)

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
        _walk_back(
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
            self._visited,
        )
        _merge(
            self._visited,
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
        reward = memory.largest_reward
        level = float(max(abs(self.levels.min()), abs(self.levels.max())))
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
    visited: BoolArray,
) -> None:
    """Add up what ants lay on each pair.

    V and Q are those of `best_value`, with the same sums. They are written out here,
    once: a function that takes arrays, called in a loop, may have them counted as used
    and not used again in each pass, which takes longer than the sums do.

    Args:
        first: row of the first state of each path.
        last: row of its last state.
        terminated: whether that is a terminal state.
        index: cells of the states, `(rows, k)`.
        degree: their degrees, `(rows, k)`.
        action: what was done, `(rows,)`; anything that can be done in last states.
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
            degrees, and the largest degree, all integers, side by side, since it takes
            time to fetch them, and one to spare, `(n_pairs * _PARTS,)`. Zeros before.
        visited: receives in which blocks of 2 ** `_BLOCK_BITS` pairs some were visited.
            To note each pair that is visited first takes a branch that is hard to
            predict.
    """
    n_actions, parts = np.uint64(levels.shape[1]), np.uint64(_PARTS)
    own, promised = discount * mix, discount * (1.0 - mix)
    masked = allowed.size > 0
    for path in range(first.size):
        end = last[path]
        expected = value = 0.0
        for row in range(end, first[path] - 1, -1):
            place = np.uint64(row)  # unsigned: no check for indices from the end
            best = -np.inf
            if masked:
                for u in range(len(choices) or levels.shape[1]):
                    promise = 0.0
                    for c in range(len(corners) or index.shape[1]):
                        cell = np.uint64(index[place, np.uint64(c)])
                        promise += (
                            degree[place, np.uint64(c)] * levels[cell, np.uint64(u)]
                        )
                    if allowed[place, np.uint64(u)]:
                        best = max(best, promise)
            else:
                for u in range(len(choices) or levels.shape[1]):
                    promise = 0.0
                    for c in range(len(corners) or index.shape[1]):
                        cell = np.uint64(index[place, np.uint64(c)])
                        promise += (
                            degree[place, np.uint64(c)] * levels[cell, np.uint64(u)]
                        )
                    best = promise if promise > best else best
            if row == end:
                expected = value = 0.0 if terminated[path] else best
                continue
            taken = np.uint64(action[place])
            said = 0.0
            for c in range(len(corners) or index.shape[1]):
                cell = np.uint64(index[place, np.uint64(c)])
                said += degree[place, np.uint64(c)] * levels[cell, taken]
            expected = reward[place] + own * expected + promised * value
            value, short = best, expected - said
            for c in range(len(corners) or index.shape[1]):
                share = degree[place, np.uint64(c)]
                if share > 0.0:
                    cell = np.uint64(index[place, np.uint64(c)])
                    pair = cell * n_actions + taken
                    weight = max(np.int64(np.rint(share * units)), 1)
                    visited[pair >> np.uint64(_BLOCK_BITS)] = True
                    sums = pair * parts
                    laid[sums] += np.int64(np.rint(share * short * scale))
                    laid[sums + np.uint64(1)] += weight
                    largest = sums + np.uint64(2)
                    laid[largest] = max(laid[largest], weight)


@njit(error_model="numpy")
def _merge(
    visited: BoolArray,
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
    """Move the level of each visited pair by its mean, and clear the sums."""
    for block in range(visited.size):
        if not visited[block]:
            continue
        visited[block] = False
        begin = block << _BLOCK_BITS
        for pair in range(begin, min(begin + (1 << _BLOCK_BITS), levels.size)):
            sums = pair * _PARTS
            weight = laid[sums + 1]
            if weight == 0:
                continue
            mean = laid[sums] / weight * (units / scale)
            step = rate * laid[sums + 2] / units
            if trust > 0.0:
                share = min(1.0, weight / max(evidence[pair], 1))
                # A power takes longer than all the rest.
                step *= share if trust == 1.0 else share**trust
            levels[pair] = min(max(levels[pair] + step * mean, least), most)
            known[pair] = True
            laid[sums] = laid[sums + 1] = laid[sums + 2] = 0
