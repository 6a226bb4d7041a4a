"""States that are already cells: `Discrete`, `MultiDiscrete` and `MultiBinary`."""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from acl_gym.partitions.base import (
    MOST_CELLS,
    FixedPartition,
    check_memory_of_states,
    check_states,
    trusted,
)
from acl_gym.partitions.kernels import OUTSIDE, locate_discrete
from acl_gym.utils import validation
from acl_gym.utils.typing import CellArray, FloatArray, IntArray

_MOST_START = 2**52
"""Starts up to this, plus sizes, are exact as floats, in which states may be given."""

_MOST_LISTED = 8
"""Variables whose values are listed in a line."""


@trusted
class Discrete(FixedPartition):
    """One cell for each value, or combination of values, of integer states (§3.2).

    A state is an array of integers, variable i among `starts[i]`, ..., `starts[i] +
    sizes[i] - 1`; it belongs entirely to its own cell. The last variable varies
    fastest, as in (4.8). See `from_space`.

    Args:
        sizes: how many values each variable has, >= 1. An int is one variable whose
            states are plain integers, `(n,)` for a batch; an array of any shape means
            states of that shape, `(n, ...)`.
        starts: the smallest value of each variable, an int for all of them or an
            array of the shape of `sizes`.

    Attributes:
        sizes: int64, as given.
        starts: int64, of the same shape.

    Raises:
        ValueError: `sizes` or `starts` are not such integers, or there are 2^31 cells
            or more.
    """

    _fixed = (
        "sizes",
        "starts",
        "n_cells",
        "cells_per_state",
        "state_ndim",
        "_flat_sizes",
        "_flat_starts",
    )

    def __init__(self, sizes: ArrayLike, starts: ArrayLike = 0) -> None:
        self.sizes = validation.read_only(
            _integers("sizes", sizes, 1, np.iinfo(np.int64).max)
        )
        starts = _integers("starts", starts, -_MOST_START, _MOST_START)
        if starts.shape not in ((), self.sizes.shape):
            raise ValueError(
                f"starts must be an integer or have the shape of sizes, "
                f"{self.sizes.shape}, got shape {starts.shape}."
            )
        self.starts = validation.read_only(np.full(self.sizes.shape, starts))
        self.cells_per_state = 1
        self.state_ndim = self.sizes.ndim
        self.n_cells = math.prod(self.sizes.ravel().tolist())
        if self.n_cells > MOST_CELLS:
            raise ValueError(
                f"a partition must have fewer than 2^31 cells, got {self.n_cells}; "
                "leave out variables, or merge values of them."
            )
        # Copies of their own, which kernels rely on.
        self._flat_sizes = self.sizes.flatten()
        self._flat_starts = self.starts.flatten()

    @classmethod
    def from_space(cls, space: spaces.Space[Any]) -> Self:
        """Make each element of a finite space a cell.

        Args:
            space: `Discrete`, `MultiDiscrete` or `MultiBinary`, for instance
                `env.single_observation_space`.

        Raises:
            ValueError: the space is of another kind or too large.
        """
        return cls(*_sizes_and_starts(space))

    def check_space(self, space: spaces.Space[Any]) -> None:
        """Refuse a space whose elements are not the cells.

        Raises:
            ValueError: the observations of `space` are not states of the partition.
        """
        remedy = "; build the partition with Discrete.from_space(space)."
        if not isinstance(space, FINITE_SPACES):
            remedy = "; let automatic_partition(env) build a partition that fits."
        else:
            sizes, starts = _sizes_and_starts(space)
            if np.array_equal(sizes, self.sizes) and np.all(starts == self.starts):
                return
        raise ValueError(
            f"{self!r} takes observations from a finite space of these sizes and "
            f"starts, got {validation.shown(space)}{remedy}"
        )

    def _fill(
        self,
        states: NDArray[Any],
        slots: IntArray,
        index: CellArray,
        degree: FloatArray,
    ) -> None:
        """See `FixedPartition`; int64 and float64 states are not copied."""
        shape = self.sizes.shape
        check_states(states)
        if states.ndim == 0 or states.shape[1:] != shape:
            wanted = ", ".join(["n", *map(str, shape)]) + ("" if shape else ",")
            raise ValueError(f"states must have shape ({wanted}), got {states.shape}.")
        if states.dtype != np.int64 and states.dtype != np.float64:
            states = _as_numbers(states)
        flat = states.reshape(len(states), self._flat_sizes.size)
        sizes, starts = self._flat_sizes, self._flat_starts
        bad, axis = locate_discrete(flat, slots, sizes, starts, index, degree)
        if bad == OUTSIDE:
            raise ValueError(f"slots must be rows of the {len(states)} states.")
        if bad >= 0:
            variable = f", variable {axis}" if shape else ""
            raise ValueError(
                f"states must be whole numbers in {starts[axis]}.."
                f"{starts[axis] + sizes[axis] - 1}, got {flat[bad, axis]} in row "
                f"{bad}{variable}."
            )

    def cell_states(self) -> IntArray:
        """The state of each cell, int64 `(n_cells, ...)`, as observed.

        Raises:
            ValueError: they do not fit into memory.
        """
        check_memory_of_states(self.n_cells, self._flat_sizes.size)
        variables = np.unravel_index(np.arange(self.n_cells), self._flat_sizes)
        states: IntArray = np.stack(variables, axis=-1) + self._flat_starts
        return states.reshape(self.n_cells, *self.sizes.shape)

    def settings(self) -> dict[str, Any]:
        """See `Partition.settings`."""
        return {
            "type": type(self).__name__,
            "sizes": self.sizes.tolist(),
            "starts": self.starts.tolist(),
        }

    def _variables(self) -> list[tuple[Any, ...]]:
        pairs = zip(self.sizes.ravel(), self.starts.ravel(), strict=True)
        return [
            (i + 1, size, start, start + size - 1, "")
            for i, (size, start) in enumerate(pairs)
        ]

    def __repr__(self) -> str:
        """Name, values of each variable, and where they do not start at 0."""
        if self.sizes.size > _MOST_LISTED:
            return f"Discrete({self.sizes.size} variables, {self.n_cells} cells)"
        starts = f", starts={self.starts.tolist()}" if self.starts.any() else ""
        return f"Discrete({self.sizes.tolist()}{starts})"


FINITE_SPACES = (spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)
"""The spaces of which each element can be a cell."""


def _sizes_and_starts(space: spaces.Space[Any]) -> tuple[ArrayLike, ArrayLike]:
    if isinstance(space, spaces.Discrete):
        return int(space.n), int(space.start)
    if isinstance(space, spaces.MultiDiscrete):
        return space.nvec, space.start
    if isinstance(space, spaces.MultiBinary):
        return np.full(space.shape, 2), 0
    raise ValueError(
        "space must be Discrete, MultiDiscrete or MultiBinary, got "
        f"{validation.shown(space)}; for a "
        "Box take Crisp or Fuzzy."
    )


def _integers(name: str, values: ArrayLike, lowest: int, highest: int) -> IntArray:
    array = validation.as_array(values)
    if (
        array is None
        or array.dtype.kind not in "iu"
        or array.size == 0
        or array.min() < lowest
        or array.max() > highest
    ):
        bounds = f">= {lowest}" if highest > _MOST_START else f"within +-{highest}"
        raise ValueError(
            f"{name} must be an integer or an array of integers, each {bounds}, got "
            f"{validation.shown(values)}."
        )
    return array.astype(np.int64)


def _as_numbers(states: NDArray[Any]) -> NDArray[Any]:
    if states.dtype.kind not in "bfiu":
        raise ValueError(f"states must be whole numbers, got dtype {states.dtype}.")
    # Unsigned ones of 64 bits may lie beyond int64; all that are in range are exact.
    wide = states.dtype.kind == "f" or states.dtype == np.uint64
    return states.astype(np.float64 if wide else np.int64)
