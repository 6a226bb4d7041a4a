"""The solutions of all ants in a trial, S_trial of Algorithm 4.2, kept compactly."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.partitions import Partition
from acl_gym.partitions.base import locate_checked
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.typing import ActionArray, BoolArray, CellArray, FloatArray, IntArray

ROWS_PER_BLOCK = 4_096
"""State-action pairs that `Solutions.blocks` takes at a time, about 200 kilobytes."""

RUN = 5
"""How many steps of one ant lie side by side in memory, followed by as many of the next
ant: a step is written for all ants at once, but deposits are read ant by ant."""


FIRST_STEPS = 640
"""For how many steps of each ant there is memory at first; more is made when needed."""


@dataclass(frozen=True, slots=True)
class Block:
    """The solutions of some ants, one after the other, `r` pairs in all."""

    ants: slice
    """The ants they belong to."""
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
    """Scratch memory for a block; `all` holds 0, 1, 2, ... for all rows."""

    seen: NDArray[Any]
    all: IntArray
    places: IntArray
    action: ActionArray
    index: CellArray
    degree: FloatArray


class Solutions(Fixed):
    """The multiset S_trial: what every ant did in one trial.

    Where a state has one cell, the cell is kept, in 4 bytes. Where it has more, cells
    and degrees would take 12 bytes for each of the 2^d cells, so the observation is kept
    instead and located again when it is needed, with the same bits. An action takes one
    byte if there are at most 256.

    Memory grows with the steps that ants make: by doubling, up to `max_steps`.

    Args:
        n_ants: M.
        max_steps: T.
        n_actions: how many actions there are.
        partition: turns observations into cells and degrees.

    Attributes:
        length: how many steps each ant has made, `(n_ants,)`, read-only.

    Raises:
        ValueError: there is no memory for so many steps.
    """

    _fixed = ("n_ants", "max_steps", "partition")

    may_repeat = True
    """Whether a solution may have a pair more than once."""

    def __init__(
        self, n_ants: int, max_steps: int, n_actions: int, partition: Partition
    ) -> None:
        self.n_ants, self.max_steps = n_ants, max_steps
        self.partition = partition
        self._room_for_steps = min(max_steps, FIRST_STEPS)
        self._action: ActionArray = np.empty(
            self._size, dtype=np.min_scalar_type(n_actions - 1)
        )
        self._length: IntArray = np.zeros(n_ants, dtype=np.int64)
        # Of a part of a colony: which ants these are, and of how many.
        self._ants: IntArray = np.arange(n_ants)
        self._n_slots = n_ants
        self._n_actions, self._n_cells = n_actions, partition.n_cells
        self._k = partition.cells_per_state
        self._one_cell = self._k == 1
        # Cells or observations, a row each.
        self._rows: NDArray[Any] | None = None
        self._state_shape: tuple[int, ...] = ()
        self._room: _Room | None = None

    @property
    def length(self) -> IntArray:
        """How many steps each ant has made, `(n_ants,)`, read-only."""
        return validation.read_only(self._length)

    @property
    def _size(self) -> int:
        """How many pairs there is memory for; `_place` computes where each lies."""
        return (self._room_for_steps + RUN - 1) // RUN * RUN * self.n_ants

    def clear(self, ants: IntArray | None = None) -> None:
        """Forget the solutions of some ants; None: of all."""
        self._length[slice(None) if ants is None else ants] = 0

    def of(self, ants: IntArray) -> Solutions:
        """The solutions of some ants, to be looked at until the next step.

        Args:
            ants: different ones in ascending order, `(m,)`; in what is returned they are
                0, 1, ... m - 1.
        """
        if ants.size == self.n_ants:
            return self
        if self._rows is not None:
            self._room_for(self._rows)  # scratch that both then use
        some = copy.copy(self)
        some.__dict__["n_ants"] = int(ants.size)  # fixed for everyone else
        some._ants, some._length = self._ants[ants], self._length[ants]
        return some

    def append(
        self,
        ants: IntArray,
        observation: NDArray[Any],
        index: CellArray,
        actions: IntArray,
    ) -> None:
        """Add one state-action pair to the solution of each of `ants`.

        Args:
            ants: the ants that have chosen, `(m,)`.
            observation: observations of all slots, `(n_ants, ...)`.
            index: the cells of the observations of `ants`, `(m, k)`.
            actions: the actions they chose, `(m,)`.

        Raises:
            ValueError: the arrays do not fit together, an ant or an action does not
                exist, an ant has made `max_steps` already, or observations are not
                numbers.
        """
        seen = index
        if not self._one_cell:
            flat = observation.ndim == 2
            seen = observation if flat else observation.reshape(self.n_ants, -1)
        rows = self._rows
        if rows is None or rows.dtype != seen.dtype or rows.shape[1] != seen.shape[1]:
            rows = self._rows_for(seen)
            self._state_shape = observation.shape[1:]
        by_slot = not self._one_cell
        done = 0
        while True:
            done = _append(
                done,
                ants,
                seen,
                by_slot,
                actions,
                self._n_actions,
                self._room_for_steps,
                rows,
                self._action,
                self._length,
            )
            if done == ants.size:
                return
            if done >= 0 and self._room_for_steps < self.max_steps:
                rows = self._grow(rows)
                continue
            raise ValueError(
                f"each of {ants.size} ants must exist, have made fewer than "
                f"{self.max_steps} steps, and take an action in "
                f"0..{self._n_actions - 1}, got {len(seen)} states and "
                f"{validation.shown(actions)}."
            )

    def _rows_for(self, seen: NDArray[Any]) -> NDArray[Any]:
        """Memory for observations of another type or size than before.

        Within a trial, earlier rows are kept, in a type that holds both.

        Raises:
            ValueError: within a trial, the number of variables changes.
        """
        width, kept = seen.shape[1], self._rows
        self._room = None  # has room for rows of the former kind
        if seen.dtype.kind not in "biuf":
            raise ValueError(
                f"observations must be numbers, got {seen.dtype}; check the "
                "environment, or use a partition with one cell per state."
            )
        if kept is None or not self._length.any():
            self._rows = np.empty((self._size, width), dtype=seen.dtype)
        elif kept.shape[1] != width:
            raise ValueError(
                "observations must have as many variables throughout a trial, got "
                f"{kept.shape[1]}, then {width}; check the environment's step and reset."
            )
        else:
            kind = np.result_type(kept, seen)
            self._rows = kept if kept.dtype == kind else kept.astype(kind)
        return self._rows

    def _grow(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Make memory for twice as many steps; what is there stays in its place."""
        self._room_for_steps = min(2 * self._room_for_steps, self.max_steps)
        self._room = None  # has room for the longest solution
        self._action = _enlarged(self._action, self._size)
        self._rows = _enlarged(rows, self._size)
        return self._rows

    def untried(
        self, ants: IntArray, index: CellArray, allowed: BoolArray | None
    ) -> BoolArray:
        """The tabu list of §3.4.2: no action twice from the same state in a trial.

        Each ant's partial solution serves as its list. An ant that has tried all
        allowed actions may choose from all of them again (a decision; the thesis does
        not say).

        Args:
            ants: the ants that choose, `(m,)`.
            index: their cells, `(m, 1)`.
            allowed: the actions they may take, `(m, n_actions)`; None: all.

        Returns:
            The allowed actions that each ant has not yet taken in its cell,
            `(m, n_actions)`.
        """
        if allowed is None:
            allowed = np.ones((ants.size, self._n_actions), np.bool_)
        left = allowed.copy()
        if self._rows is not None:
            _strike_tried(
                ants, index, self._rows, self._action, self._length, allowed, left
            )
        return left

    def blocks(self) -> Iterator[Block]:
        """All solutions, ant by ant, in parts that fit into the processor's cache.

        The arrays of a block are valid until the next block is requested.
        """
        rows = self._rows
        if rows is None:
            return
        room = self._room_for(rows)
        ends = np.cumsum(self._length)
        first = done = 0
        while first < self.n_ants:
            last = int(np.searchsorted(ends, done + ROWS_PER_BLOCK, side="right"))
            last = max(last, first + 1)
            size = int(ends[last - 1]) - done
            places, action = room.places[:size], room.action[:size]
            index, degree = room.index[:size], room.degree[:size]
            _collect(
                self._ants[first:last],
                self._length[first:last],
                self._n_slots,
                self._action,
                places,
                action,
            )
            seen = index if self._one_cell else room.seen[:size]
            np.take(rows, places, axis=0, out=seen, mode="clip")  # all are in range
            if not self._one_cell:
                # A copy: the rest of the memory may hold anything.
                states = seen.reshape(size, *self._state_shape)
                every, n_cells = room.all[:size], self._n_cells
                locate_checked(self.partition, states, every, index, degree, n_cells)
            ants = slice(first, last)
            yield Block(ants, index, degree, action, ends[ants] - done)
            first, done = last, done + size

    def _room_for(self, rows: NDArray[Any]) -> _Room:
        """Scratch for a block, the same in every trial."""
        room = self._room
        if room is None:
            most = max(ROWS_PER_BLOCK, self._room_for_steps)
            k = self._k
            room = self._room = _Room(
                np.empty((most, rows.shape[1]), dtype=rows.dtype),
                np.arange(most),
                np.empty(most, dtype=np.int64),
                np.empty(most, dtype=self._action.dtype),
                np.empty((most, k), dtype=np.int32),
                np.ones((most, 1)) if k == 1 else np.empty((most, k)),
            )
        return room


def _enlarged(array: NDArray[Any], size: int) -> NDArray[Any]:
    """A copy with more rows, of which those at the end hold nothing yet."""
    larger = np.empty((size, *array.shape[1:]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger


@njit(inline="always")
def _place(t: int, ant: int, n_ants: int) -> np.uint64:
    """Where step t of an ant lies, see `RUN`.

    Unsigned, which avoids the check for negative indices.
    """
    run, step = np.uint64(t) // np.uint64(RUN), np.uint64(t) % np.uint64(RUN)
    return (run * np.uint64(n_ants) + np.uint64(ant)) * np.uint64(RUN) + step


@njit
def _append(
    done: int,
    ants: IntArray,
    seen: NDArray[Any],
    by_slot: bool,
    actions: IntArray,
    n_actions: int,
    room: int,
    all_seen: NDArray[Any],
    all_action: ActionArray,
    length: IntArray,
) -> int:
    """Add a step; `seen` has a row for each slot if `by_slot`, else for each ant.

    Ants before `done` have been added. Returns how many have been added now: fewer than
    all where an ant has made `room` steps, -1 where something does not exist.
    """
    n_rows = length.size if by_slot else ants.size
    if actions.size != ants.size or seen.shape[0] < n_rows:
        return -1
    for j in range(done, ants.size):
        ant = np.uint64(ants[j])  # unsigned, as in `_place`; negative ones become huge
        if ant >= np.uint64(length.size) or not 0 <= actions[j] < n_actions:
            return -1
        if length[ant] >= room:
            return j
        place = _place(length[ant], ants[j], length.size)
        row = ant if by_slot else np.uint64(j)
        for i in range(seen.shape[1]):
            all_seen[place, i] = seen[row, i]
        all_action[place] = actions[j]
        length[ant] += 1
    return ants.size


@njit
def _collect(
    ants: IntArray,
    length: IntArray,
    n_slots: int,
    all_action: ActionArray,
    places: IntArray,
    action: ActionArray,
) -> None:
    """Where the steps of ants lie, `length` of each, one ant after the other."""
    row = np.uint64(0)
    for j in range(ants.size):
        ant = ants[j]
        for t in range(length[j]):
            place = _place(t, ant, n_slots)
            places[row] = place
            action[row] = all_action[place]
            row += np.uint64(1)


@njit
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
            place = _place(t, ant, length.size)
            u = all_action[place]
            if all_index[place, 0] == index[j, 0] and left[j, u]:
                left[j, u] = False
                count -= 1
                if count == 0:
                    # Restart the list of this cell: later steps count again.
                    left[j] = allowed[j]
                    count = allowed[j].sum()
