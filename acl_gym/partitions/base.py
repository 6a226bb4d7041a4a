"""The interface of partitions, which map a batch of states to `(index, degree)`."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from typing import Any, TypeVar

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from acl_gym.utils import pictures, validation
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.pictures import guarded
from acl_gym.utils.typing import CellArray, FloatArray, IntArray

MOST_CELLS = 2**31 - 1
"""Cells are numbered by int32."""

ROUNDING = 1e-6
"""By how much the sum of a state's degrees may differ from 1."""

_MOST_LISTED = 12
"""Variables that a notebook lists."""

Kind = TypeVar("Kind", bound="Partition")


class Partition(ABC):
    """A map from states to cells with degrees."""

    n_cells: int
    """How many cells there are: the rows of an agent's table."""

    cells_per_state: int
    """k, how many cells a state belongs to at most."""

    state_ndim: int = 1
    """Axes of the array that is one state; 0 where a state is a plain number."""

    def __repr__(self) -> str:
        """Name and number of cells."""
        return f"{type(self).__name__}({getattr(self, 'n_cells', '?')} cells)"

    @guarded
    def _repr_html_(self) -> str:
        """What a notebook shows: the variables and their cells."""
        heading = html.escape(repr(self))
        rows = self._variables()
        heads = ("variable", "cells", "from", "to", "")
        table = pictures.table(rows[:_MOST_LISTED], heads) if rows else ""
        k = self.cells_per_state
        note = f"{self.n_cells:,} cells, a state belongs to {k} of them"
        return f"<div><strong>{heading}</strong>{table}<div>{note}</div></div>"

    def _variables(self) -> list[tuple[Any, ...]]:
        """Of each variable its number, cells, lowest and highest value, and a note."""
        return []

    @abstractmethod
    def locate(
        self,
        states: NDArray[Any],
        slots: IntArray,
        index: CellArray,
        degree: FloatArray,
    ) -> None:
        """Locate the states of some slots, without allocating.

        Args:
            states: the observations of all slots, `(n, ...)`.
            slots: which rows of `states` to locate, shape `(m,)`.
            index: int32 `(>= m, k)`; row j receives the cells of `states[slots[j]]`.
            degree: float64 `(>= m, k)`; row j receives their degrees.

        Raises:
            ValueError: a state is not finite or does not belong to the partition.
        """

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """What `partition_from_settings` needs to build this partition again."""

    @abstractmethod
    def cell_states(self) -> NDArray[Any]:
        """The state that stands for each cell, `(n_cells, ...)`."""

    def check_space(self, space: spaces.Space[Any]) -> None:
        """Refuse an observation space whose states this partition cannot take.

        Agents call this before they learn. A partition of your own accepts every space
        unless it overrides this method.

        Raises:
            ValueError: the observations of `space` are not states of the partition.
        """
        return None

    def __call__(self, states: ArrayLike) -> tuple[CellArray, FloatArray]:
        """Return `(index, degree)`, each `(n, k)`, for a batch of states `(n, ...)`.

        Raises:
            ValueError: a state is not finite or does not belong to the partition.
        """
        return locate_all(self, states, self.n_cells)


_TRUSTED: set[type[Partition]] = set()
"""The classes whose `locate` checks all it is given and writes what it should."""


def trusted(kind: type[Kind]) -> type[Kind]:
    """Mark a partition of this package, which cannot be changed once it is made.

    Only the class itself is trusted: a subclass may override what it is trusted for.
    """
    _TRUSTED.add(kind)
    return kind


def locate_checked(
    partition: Partition,
    states: NDArray[Any],
    slots: IntArray,
    index: CellArray,
    degree: FloatArray,
    n_cells: int,
) -> None:
    """Locate states for a table, whose rows kernels address without further checks.

    A partition that is not of this package writes to arrays of its own, which are
    checked before they are taken over.

    Args:
        partition: whose `locate` to call.
        states: see `Partition.locate`.
        slots: int64 `(m,)`, an array of this package.
        index: int32 `(m, k)`, an array of this package, receives the cells.
        degree: float64 `(m, k)`, an array of this package, receives the degrees.
        n_cells: rows of the table.

    Raises:
        ValueError: a cell is not a row of the table, degrees are negative or do not sum
            to 1, or `locate` refuses a state.
    """
    if isinstance(partition, FixedPartition) and type(partition) in _TRUSTED:
        partition._fill(states, slots, index, degree)
        return
    found, shares = np.zeros_like(index), np.zeros_like(degree)
    partition.locate(states, validation.read_only(slots), found, shares)
    name = type(partition).__name__
    if found.size and (found.min() < 0 or found.max() >= n_cells):
        raise ValueError(
            f"{name}.locate must give cells in 0..{n_cells - 1}, got {found.min()} to "
            f"{found.max()}."
        )
    good = (shares >= 0.0).all(axis=1) & (np.abs(shares.sum(axis=1) - 1.0) <= ROUNDING)
    if not good.all():
        row = int(np.argmin(good))
        raise ValueError(
            f"{name}.locate must give degrees >= 0 that sum to 1, got "
            f"{validation.shown(shares[row].tolist())} in row {row}."
        )
    index[:], degree[:] = found, shares


def locate_all(
    partition: Partition, states: ArrayLike, n_cells: int
) -> tuple[CellArray, FloatArray]:
    """Return `(index, degree)`, each `(n, k)`, for a batch of states `(n, ...)`.

    Args:
        partition: whose cells to find.
        states: the batch.
        n_cells: rows of the table that the cells are for.

    Raises:
        ValueError: a state is not finite or does not belong to the partition, or
            `locate` gives cells that do not exist.
    """
    batch = validation.as_array(states)
    if batch is None or batch.ndim == 0:
        raise ValueError(
            "states must be an array with one row for each state, got "
            f"{validation.shown(states)}."
        )
    n, k = len(batch), partition.cells_per_state
    validation.check_memory(
        f"the cells of {n} states", 12 * n * k, "locate fewer states at a time"
    )
    index = np.zeros((n, k), dtype=np.int32)
    degree = np.zeros((n, k))
    locate_checked(partition, batch, np.arange(n), index, degree, n_cells)
    return index, degree


def checked_partition(partition: Any) -> Partition:
    """Return `partition` if it is one, with sizes that make sense.

    Raises:
        TypeError: it is not a `Partition`, or a size is not an integer.
        ValueError: a size is out of range.
    """
    if not isinstance(partition, Partition):
        raise TypeError(
            "partition must be a Partition such as Crisp or Fuzzy, got "
            f"{validation.shown(partition)} of type {type(partition).__name__}; build "
            "one with Fuzzy.from_box(env.single_observation_space, cells), or leave it "
            "out."
        )
    if type(partition) not in _TRUSTED:
        for name, least, most in (
            ("n_cells", 1, MOST_CELLS),
            ("cells_per_state", 1, MOST_CELLS),
            ("state_ndim", 0, None),
        ):
            value = getattr(partition, name, None)
            whole = f"{name} of {type(partition).__name__}"
            validation.integer(whole, value, at_least=least, at_most=most)
    return partition


def check_states(states: Any) -> None:
    """Check that states are an array.

    Raises:
        TypeError: they are not.
    """
    if not isinstance(states, np.ndarray):
        raise TypeError(
            f"states must be an array with a row for each state, got "
            f"{validation.shown(states)} of type {type(states).__name__}."
        )


def check_targets(
    slots: IntArray, index: CellArray, degree: FloatArray, cells_per_state: int
) -> None:
    """Check what `locate` of this package writes to, without looking at every entry.

    Raises:
        ValueError: the arrays have not the types and shapes of `Partition.locate`.
    """
    arrays = (slots, index, degree)
    if not all(isinstance(array, np.ndarray) for array in arrays):
        kinds = ", ".join(type(array).__name__ for array in arrays)
        raise TypeError(f"slots, index and degree must be arrays, got {kinds}.")
    m = slots.size
    good = (
        slots.ndim == 1
        and slots.dtype == np.int64
        and index.dtype == np.int32
        and degree.dtype == np.float64
        and index.ndim == 2
        and index.shape == degree.shape
        and len(index) >= m
        and index.shape[1] == cells_per_state
    )
    if not good:
        raise ValueError(
            f"index and degree must be arrays of int32 and float64 in shape ({m}, "
            f"{cells_per_state}) for int64 slots {slots.shape}, got {index.dtype} "
            f"{index.shape} and {degree.dtype} {degree.shape} for {slots.dtype} slots."
        )


def check_memory_of_states(n_cells: int, size: int) -> None:
    """Refuse to list the states of more cells than fit into memory, as float64."""
    what = f"the states of {n_cells} cells"
    validation.check_memory(what, 16 * n_cells * size, "make fewer cells")


class FixedPartition(Fixed, Partition):
    """A partition of this package, whose kernels rely on what it was made of."""

    def locate(
        self,
        states: NDArray[Any],
        slots: IntArray,
        index: CellArray,
        degree: FloatArray,
    ) -> None:
        """See `Partition.locate`."""
        check_targets(slots, index, degree, self.cells_per_state)
        self._fill(states, slots, index, degree)

    @abstractmethod
    def _fill(
        self,
        states: NDArray[Any],
        slots: IntArray,
        index: CellArray,
        degree: FloatArray,
    ) -> None:
        """`locate` into arrays that are known to be good; the states are checked."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "locate":
            raise AttributeError(
                f"locate of a {type(self).__name__} is fixed, got "
                f"{validation.shown(value)}; write a subclass."
            )
        super().__setattr__(name, value)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # A copy or a pickle forgets that arrays are read-only. Those for kernels are
        # private: for read-only ones they would be compiled anew.
        for name in self._fixed:
            value = self.__dict__[name]
            for each in value if isinstance(value, tuple) else (value,):
                if isinstance(each, np.ndarray) and not name.startswith("_"):
                    each.flags.writeable = False
