"""Partitions that grow (§7.3): finer grids onto which a table is carried over."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.partitions.base import Partition, locate_all
from acl_gym.partitions.grid import Grid
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray

_ROWS = 65_536  # cells that are carried over at a time

AnyGrid = TypeVar("AnyGrid", bound=Grid)


def refined(
    grid: AnyGrid, axis: int, where: BoolArray | None = None
) -> AnyGrid:
    """Return the grid with a new centre in the middle of each interval of one axis.

    All old centres stay, so that a fuzzy table can be carried over exactly. An axis with
    one centre stays as it is: nothing is known of its range.

    Args:
        grid: a crisp or a fuzzy partition.
        axis: the state variable, 0 .. d - 1.
        where: which intervals to halve, `(n,)`: those between neighbouring centres, of a
            circular axis also the one that closes the circle. None halves all.

    Raises:
        ValueError: there is no such axis, or there would be 2^31 cells or more.
    """
    last = len(grid.centres) - 1
    axis = validation.integer("axis", axis, at_least=0, at_most=last)
    axes = list(grid.centres)
    axes[axis] = _halved(axes[axis], grid.periods[axis], where)
    return type(grid)(axes, grid.periods)


def _halved(
    centres: FloatArray, period: float | None, where: BoolArray | None
) -> FloatArray:
    edges = centres
    if period is not None and centres.size > 1:
        edges = np.append(centres, centres[0] + period)
    middles = edges[:-1] + np.diff(edges) / 2
    if where is not None:
        middles = middles[where]
    return np.sort(np.concatenate([centres, middles]))


def carried_over(table: ArrayLike, old: Partition, new: Partition) -> FloatArray:
    """Return the table of a finer partition that says the same as one of a coarser one.

    Each new cell receives what the old table says of its centre: the sum of the old
    entries weighted with the degrees, eq. (4.7). If `new` is a fuzzy grid that has all
    centres of `old`, both tables agree in every state but for rounding, and so do their
    policies. The cells of a crisp grid receive a copy of the cell that holds their
    centre.

    Args:
        table: `(old.n_cells, n_actions)`.
        old: the partition of `table`.
        new: the partition to carry it over to, of the same state variables.

    Returns:
        `(new.n_cells, n_actions)`.

    Raises:
        ValueError: the table is not one of `old`.
    """
    values = validation.real_array("table", table, ndim=2)
    if len(values) != old.n_cells:
        raise ValueError(
            f"table must have {old.n_cells} rows, one for each cell, got {len(values)}."
        )
    states = new.cell_states()
    carried = np.empty((new.n_cells, values.shape[1]))
    for first in range(0, new.n_cells, _ROWS):
        rows = slice(first, first + _ROWS)
        index, degree = locate_all(old, states[rows], old.n_cells)
        carried[rows] = np.einsum("nk,nka->na", degree, values[index])
    return carried
