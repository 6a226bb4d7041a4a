"""The interface of partitions, which map a batch of states to `(index, degree)`."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from acl_gym.utils import pictures
from acl_gym.utils.pictures import guarded
from acl_gym.utils.typing import CellArray, FloatArray, IntArray

_MOST_LISTED = 12
"""Variables that a notebook lists."""


class Partition(ABC):
    """A map from states to cells with degrees."""

    n_cells: int
    """How many cells there are: the rows of an agent's table."""

    cells_per_state: int
    """k, how many cells a state belongs to at most."""

    state_ndim: int = 1
    """Axes of the array that is one state; 0 where a state is a plain number."""

    checked: ClassVar[bool] = False
    """Whether `locate` itself ensures that cells are in range, so that agents need not
    check them in every step."""

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
        try:
            batch = np.asarray(states)
        except ValueError as error:
            raise ValueError(f"states must be an array: {error}.") from error
        n = len(batch) if batch.ndim else 0
        index = np.zeros((n, self.cells_per_state), dtype=np.int32)
        degree = np.zeros((n, self.cells_per_state))
        self.locate(batch, np.arange(n), index, degree)
        if not self.checked:
            check_cells(index, self)
        return index, degree


def check_cells(index: CellArray, partition: Partition) -> None:
    """Check that cells are below the number of cells; tables are indexed by them.

    Raises:
        ValueError: a cell is out of range.
    """
    if index.size and (index.min() < 0 or index.max() >= partition.n_cells):
        raise ValueError(
            f"{type(partition).__name__}.locate must give cells in "
            f"0..{partition.n_cells - 1}, got {index.min()} to {index.max()}."
        )
