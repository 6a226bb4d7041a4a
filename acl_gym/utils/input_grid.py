"""Numbered actions whose inputs form a grid, and the neighbours of each on it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.boxes import INFINITE
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.typing import FloatArray, IntArray


class InputGrid(Fixed):
    """The inputs of numbered actions, ordered along each input.

    The actions may be numbered in any order, but together their inputs must be all
    points of a grid: each value of one input with each value of the others.

    Args:
        values: the inputs of each action, `(n_actions, n_inputs)`, or `(n_actions,)` of
            a single input; each within +-1e30.

    Attributes:
        values: `(n_actions, n_inputs)`, float64, read-only.
        axes: of each input its values, increasing.
        below: the action whose input is the next lower one, all others alike,
            `(n_actions, n_inputs)`; -1 where there is none. Read-only, as `above`.
        above: the same for the next higher one.

    Raises:
        ValueError: `values` are not numbers in such a shape, or no grid.
    """

    _fixed = ("values", "axes", "below", "above")

    values: FloatArray
    axes: tuple[FloatArray, ...]
    below: IntArray
    above: IntArray

    def __init__(self, values: Any) -> None:
        array = validation.real_array("inputs", values)
        if array.ndim == 1:
            array = array[:, None]
        if array.ndim != 2 or not array.size or np.abs(array).max() > INFINITE:
            raise ValueError(
                "inputs must hold a row of numbers within +-1e30 for each action, shape "
                f"(n_actions, n_inputs), got {validation.shown(values)}."
            )
        found = [np.unique(column, return_inverse=True) for column in array.T]
        self.values = validation.read_only(array.copy())
        self.axes = tuple(validation.read_only(axis) for axis, _ in found)
        place = np.stack([inverse.ravel() for _, inverse in found])
        size = math.prod(self.counts)
        number = np.ravel_multi_index(tuple(place), self.counts) if size < 2**31 else 0
        if size != len(array) or np.unique(number).size != size:
            counts = " x ".join(map(str, self.counts))
            raise ValueError(
                "inputs must form a grid, each value of one input with each value of "
                f"the others, {counts} = {size} actions, got {len(array)} actions; make "
                "one with acl_gym.ActionGrid, or numpy.meshgrid."
            )
        action_at = np.empty(size, dtype=np.int64)
        action_at[number] = np.arange(size)
        on_grid = action_at.reshape(self.counts)
        self.below = self._neighbours(on_grid, place, -1)
        self.above = self._neighbours(on_grid, place, 1)

    @property
    def counts(self) -> tuple[int, ...]:
        """How many values each input has."""
        return tuple(axis.size for axis in self.axes)

    @property
    def n_inputs(self) -> int:
        """How many inputs there are."""
        return len(self.axes)

    def __repr__(self) -> str:
        """How many values each input has."""
        return f"InputGrid({' x '.join(map(str, self.counts))})"

    def _neighbours(self, on_grid: IntArray, place: IntArray, step: int) -> IntArray:
        """The action one step away along each input, `(n_actions, n_inputs)`."""
        found = np.full((place.shape[1], self.n_inputs), -1, dtype=np.int64)
        for axis, count in enumerate(self.counts):
            there = place.copy()
            there[axis] += step
            inside = (there[axis] >= 0) & (there[axis] < count)
            found[inside, axis] = on_grid[tuple(there[:, inside])]
        found.setflags(write=False)  # kernels address by it
        return found
