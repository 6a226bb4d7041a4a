"""What the ants of a trial did: S_trial of Algorithm 4.2, in little memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acl_gym.membership import CellArray, FloatArray, IntArray
from acl_gym.partition import Partition
from acl_gym.partition.base import check_cells

ActionArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]

ROWS_PER_BLOCK = 8_192
"""State-action pairs that `Solutions.blocks` takes at a time, about half a megabyte."""

STEPS_AT_A_TIME = 32


@dataclass(frozen=True, slots=True)
class Block:
    """The solutions of some ants, one after the other, `r` pairs in all."""

    ants: slice
    """Whose they are."""
    index: CellArray
    """Cells of the states, `(r, k)`."""
    degree: FloatArray
    """Their degrees, `(r, k)`."""
    action: ActionArray
    """Actions, `(r,)`."""
    ends: IntArray
    """Where the pairs of each ant end."""


@dataclass(frozen=True, slots=True)
class _Room:
    """Scratch for a block; `all` is 0, 1, 2, ..., as many as there are rows."""

    seen: NDArray[Any]
    action: ActionArray
    index: CellArray
    degree: FloatArray
    all: IntArray


class Solutions:
    """The multiset S_trial: what every ant did in one trial.

    Where a state has one cell, its cell is kept, 4 bytes. Where it has more, cells
    and degrees would take 12 bytes for each of the 2^d; the observation is kept
    instead, and located once more when it is asked for, which gives the same bits. An
    action takes one byte, if there are at most 256.

    Memory is reserved for `max_steps` steps but touched only as far as ants walk.

    Args:
        n_ants: M.
        max_steps: T.
        n_actions: how many actions there are.
        partition: turns observations into cells and degrees.

    Attributes:
        action: what the ants did, `(max_steps, n_ants)`; of an ant the first `length`
            count.
        length: how many steps each ant has made, `(n_ants,)`.
    """

    def __init__(
        self, n_ants: int, max_steps: int, n_actions: int, partition: Partition
    ) -> None:
        self.n_ants, self.max_steps = n_ants, max_steps
        self.partition = partition
        self.action: ActionArray = np.empty(
            (max_steps, n_ants), dtype=np.min_scalar_type(n_actions - 1)
        )
        self.length: IntArray = np.zeros(n_ants, dtype=np.int64)
        self._one_cell = partition.cells_per_state == 1
        # Cells or observations, step by step: what is written together lies together.
        self._rows: NDArray[Any] | None = None
        self._state_shape: tuple[int, ...] = ()
        self._room: _Room | None = None

    @property
    def nbytes_per_step(self) -> int:
        """Memory of one step of one ant, in bytes; known after the first `append`."""
        rows = self._rows
        seen = 0 if rows is None else rows.itemsize * rows.shape[2]
        return self.action.itemsize + seen

    def clear(self) -> None:
        """Forget all solutions."""
        self.length[:] = 0

    def append(
        self,
        ants: IntArray,
        observation: NDArray[Any],
        index: CellArray,
        actions: IntArray,
    ) -> None:
        """Add one state-action pair to the solution of each of `ants`.

        Args:
            ants: who has chosen, `(m,)`.
            observation: what all slots saw, `(n_ants, ...)`.
            index: the cells of what `ants` saw, `(m, k)`.
            actions: what they chose, `(m,)`.
        """
        seen = index
        if not self._one_cell:
            flat = observation.ndim == 2
            seen = observation if flat else observation.reshape(self.n_ants, -1)
        rows = self._rows
        if rows is None or rows.dtype != seen.dtype or rows.shape[2] != seen.shape[1]:
            shape = (self.max_steps, self.n_ants, seen.shape[1])
            self._rows = rows = np.empty(shape, dtype=seen.dtype)
            self._state_shape = observation.shape[1:]
        by_slot = not self._one_cell
        _append(ants, seen, by_slot, actions, rows, self.action, self.length)

    def untried(
        self, ants: IntArray, index: CellArray, allowed: BoolArray
    ) -> BoolArray:
        """The tabu list of §3.4.2: no action twice from the same state in a trial.

        Each ant's own partial solution is its list, so that none has to be kept. An
        ant that has tried all that is allowed may choose from all of it again (a
        decision; the thesis is silent).

        Args:
            ants: who chooses, `(m,)`.
            index: their cells, `(m, 1)`.
            allowed: the actions they may take, `(m, n_actions)`.

        Returns:
            Those of `allowed` that the ant has not taken from its cell, `(m,
            n_actions)`.
        """
        left = allowed.copy()
        if self._rows is not None:
            _strike_tried(
                ants, index, self._rows, self.action, self.length, allowed, left
            )
        return left

    def blocks(self) -> Iterator[Block]:
        """All solutions, ant by ant, in parts that stay in the processor's cache.

        The arrays of a block are valid until the next one is asked for.
        """
        rows = self._rows
        if rows is None:
            return
        room = self._room_for(rows)
        ends = np.cumsum(self.length)
        first = done = 0
        while first < self.n_ants:
            last = int(np.searchsorted(ends, done + ROWS_PER_BLOCK, side="right"))
            last = max(last, first + 1)
            size = int(ends[last - 1]) - done
            seen, action = room.seen[:size], room.action[:size]
            index, degree = room.index[:size], room.degree[:size]
            _copy_block(first, last, rows, self.action, self.length, seen, action)
            if self._one_cell:
                index[:] = seen
            else:
                states = seen.reshape(size, *self._state_shape)
                self.partition.locate(states, room.all[:size], index, degree)
                if not self.partition.checked:
                    check_cells(index, self.partition)
            ants = slice(first, last)
            yield Block(ants, index, degree, action, ends[ants] - done)
            first, done = last, done + size

    def _room_for(self, rows: NDArray[Any]) -> _Room:
        """Scratch for a block, the same in every trial."""
        room = self._room
        if room is None or room.seen.dtype != rows.dtype:
            most = max(ROWS_PER_BLOCK, self.max_steps)
            k = self.partition.cells_per_state
            room = _Room(
                np.empty((most, rows.shape[2]), dtype=rows.dtype),
                np.empty(most, dtype=self.action.dtype),
                np.empty((most, k), dtype=np.int32),
                np.ones((most, k)),
                np.arange(most),
            )
            self._room = room
        return room


@njit(cache=True)
def _append(
    ants: IntArray,
    seen: NDArray[Any],
    by_slot: bool,
    actions: IntArray,
    all_seen: NDArray[Any],
    all_action: ActionArray,
    length: IntArray,
) -> None:
    """Add a step; `seen` has a row for each slot if `by_slot`, else for each ant."""
    for j in range(ants.size):
        ant = np.uint64(ants[j])  # unsigned: no check for indices from the end
        t = np.uint64(length[ant])
        row = ant if by_slot else np.uint64(j)
        for i in range(seen.shape[1]):
            all_seen[t, ant, i] = seen[row, i]
        all_action[t, ant] = actions[j]
        length[ant] += 1


@njit(cache=True)
def _copy_block(
    first: int,
    last: int,
    all_rows: NDArray[Any],
    all_action: ActionArray,
    length: IntArray,
    rows: NDArray[Any],
    action: ActionArray,
) -> None:
    """Write the steps of ants first .. last - 1 one ant after the other.

    A few steps at a time, for ants that follow each other share what memory brings.
    """
    longest = length[first:last].max()
    for start in range(0, longest, STEPS_AT_A_TIME):
        row = np.uint64(start)
        for ant in range(first, last):
            end = min(start + STEPS_AT_A_TIME, length[ant])
            for t in range(start, end):
                place = row + np.uint64(t - start)
                for i in range(rows.shape[1]):
                    rows[place, i] = all_rows[t, ant, i]
                action[place] = all_action[t, ant]
            row += np.uint64(length[ant])


@njit(cache=True)
def _strike_tried(
    ants: IntArray,
    index: CellArray,
    all_index: CellArray,
    all_action: ActionArray,
    length: IntArray,
    allowed: BoolArray,
    left: BoolArray,
) -> None:
    for j in range(ants.size):
        ant = ants[j]
        count = allowed[j].sum()
        for t in range(length[ant]):
            u = all_action[t, ant]
            if all_index[t, ant, 0] == index[j, 0] and left[j, u]:
                left[j, u] = False
                count -= 1
                if count == 0:
                    # Begin the list of this cell anew: what follows counts again.
                    left[j] = allowed[j]
                    count = allowed[j].sum()
