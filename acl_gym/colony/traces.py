"""Eligibility traces, and the update of Watkins's Q(lambda) by them, eq. (3.45)."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.colony.temporal_difference import td_error
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

TRACES = ("replacing", "accumulating")
"""What a visit makes of a trace."""

FIRST_TRACES = 1_024
"""For how many traces of each slot there is memory at first."""

TRACE_CUTOFF = 1e-4
"""Traces that fade below it are dropped (a decision)."""


class Traces:
    """The eligibility traces e of all slots, those that are not 0.

    Memory grows with what traces need: by doubling, up to the longest episode.

    Args:
        slots: how many slots there are.
        n_pairs: entries of the table.
        longest: how many visits to pairs an episode can hold.
    """

    def __init__(self, slots: int, n_pairs: int, longest: int) -> None:
        self._most = min(n_pairs, longest)
        first = min(self._most, FIRST_TRACES)
        self._greedy: BoolArray = np.empty(slots, dtype=np.bool_)
        self._pair: IntArray = np.empty((slots, first), dtype=np.int64)
        self._trace: FloatArray = np.empty((slots, first))
        self._count: IntArray = np.zeros(slots, dtype=np.int64)
        self._mark: FloatArray = np.zeros(n_pairs)
        self._at_most = 0  # no slot has more traces than this

    @property
    def greedy(self) -> BoolArray:
        """Whether the last action of each walking slot was greedy; to be written."""
        return self._greedy

    def clear(self) -> None:
        """Forget all traces."""
        self._count[:] = 0
        self._at_most = 0

    def update(
        self,
        transition: tuple[Any, ...],
        ants: IntArray,
        fading: float,
        accumulate: bool,
    ) -> None:
        """Learn from a step of all walking slots, and let their traces follow.

        Args:
            transition: what `update_values` takes.
            ants: which slots walk, `(m,)`; `greedy` says whether their actions were.
            fading: gamma_rl lambda.
            accumulate: add a visit to a trace, instead of replacing it.
        """
        k = transition[1].shape[1]
        how: tuple[Any, ...] = (fading, accumulate, TRACE_CUTOFF, ants)
        update_traced(*transition, *how, *self.with_room(k))

    def with_room(self, more: int) -> tuple[Any, ...]:
        """The arrays that `update_traced` changes, with room for `more` in each slot."""
        self._at_most += more
        if self._at_most > (room := self._pair.shape[1]):
            self._at_most = int(self._count.max()) + more
            if min(self._at_most, self._most) > room:
                self._widen(min(max(2 * room, self._at_most), self._most))
        return self._greedy, self._pair, self._trace, self._count, self._mark

    def _widen(self, width: int) -> None:
        """Make room for more traces of each slot; those that are there stay."""
        for name in ("_pair", "_trace"):
            array = getattr(self, name)
            wider = np.empty((len(array), width), dtype=array.dtype)
            wider[:, : array.shape[1]] = array
            setattr(self, name, wider)


@njit
def update_traced(
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
    fading: float,
    accumulate: bool,
    cutoff: float,
    ants: IntArray,
    greedy: BoolArray,
    pair: IntArray,
    trace: FloatArray,
    count: IntArray,
    mark: FloatArray,
) -> None:
    """Q(lambda) update, eq. (3.45), slot by slot, each on the values as they then are.

    The degrees of the state are written to `mark`, so that one pass over the slot's
    traces can fade them, merge the state into them, drop the smallest and correct the
    values.

    Args:
        values: `(n_cells, n_actions)`, corrected in place.
        index: cells of the `m` walking slots, `(m, k)`; those of degree > 0 differ.
        degree: their degrees, `(m, k)`.
        actions: what they did, `(m,)`.
        costs: what it cost, `(m,)`.
        terminated: whether it led to a terminal state, `(m,)`.
        next_index: where it led, `(m, k)`.
        next_degree: `(m, k)`.
        next_allowed: U_q there, `(m, n_actions)`, or empty.
        learning_rate: alpha_rl.
        discount: gamma_rl.
        fading: gamma_rl lambda.
        accumulate: add a visit to a trace, instead of replacing it.
        cutoff: traces that are not above it are dropped.
        ants: which slots walk, `(m,)`.
        greedy: whether their actions were, `(>= m,)`.
        pair: of each trace of each slot, cell * n_actions + action.
        trace: e, of the shape of `pair`.
        count: how many traces each slot has.
        mark: zeros, `(values.size,)`; zero again afterwards.
    """
    n_actions = values.shape[1]
    flat = values.reshape(values.size)
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
            if degree[j, c] > 0.0:
                mark[index[j, c] * n_actions + u] = degree[j, c]
        slot = ants[j]
        kept = 0
        for i in range(count[slot] if greedy[j] else 0):
            p = pair[slot, i]
            e = fading * trace[slot, i]
            beta = mark[p]
            if beta > 0.0:
                e = e + beta if accumulate else max(e, beta)
                mark[p] = 0.0
            elif e <= cutoff:
                continue
            pair[slot, kept] = p
            trace[slot, kept] = e
            kept += 1
            flat[p] += learning_rate * e * error
        for c in range(index.shape[1]):
            p = index[j, c] * n_actions + u
            if mark[p] > 0.0:
                pair[slot, kept] = p
                trace[slot, kept] = mark[p]
                kept += 1
                flat[p] += learning_rate * mark[p] * error
                mark[p] = 0.0
        count[slot] = kept
