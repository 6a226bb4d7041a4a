"""Partitions that grow (§7.3): a coarse one to begin with, wider ones, their tables.

`Grid.refined` gives the finer ones.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from acl_gym.envs.control.lookup import system_of
from acl_gym.partitions.automatic import centres_for
from acl_gym.partitions.base import Partition, locate_all
from acl_gym.partitions.bounds import Env, observation_space, real_box
from acl_gym.partitions.discrete import FINITE_SPACES, Discrete
from acl_gym.partitions.grid import Fuzzy, Grid
from acl_gym.utils import validation
from acl_gym.utils.angles import find_angles
from acl_gym.utils.boxes import declared_bounds
from acl_gym.utils.typing import FloatArray

COARSE = {1: 21, 2: 9, 3: 7, 4: 7, 5: 5, 6: 3}
"""Number of variables -> centres of each to begin with: a few thousand cells at most. They
are odd, so that the middle of a range that is symmetric is a centre."""

MARGIN = 0.1
"""A range that has become too narrow is widened by this share of it beyond what was seen,
so that it need not be widened again at once."""

_ROWS = 65_536  # cells that are carried over at a time

AnyGrid = TypeVar("AnyGrid", bound=Grid)


def initial_partition(env: Env, max_cells: float = math.inf) -> Partition:
    """Choose the partition from which that of a colony grows.

    Observations that are cells already stay cells. Others get a fuzzy grid of few cells.
    A circular variable of this package's systems has its whole range at once. Nothing is
    assumed of the others: each begins with one centre, until `widened` gives it the range
    that is seen, so that variables without bounds and those with bounds that are never
    reached are treated alike.

    Args:
        env: a vector environment or a single one.
        max_cells: a grid has no more cells than this, >= 1, nor when it becomes wider.

    Raises:
        TypeError: its observations have no cells, such as Dict, Tuple or Text.
        ValueError: they have more than six variables or more than one axis.
    """
    space = observation_space(env)
    if isinstance(space, FINITE_SPACES):
        return Discrete.from_space(space)
    box = real_box(space)
    system = system_of(env)
    whole = system is not None and system.observation_space == space
    circular = system.circular if system is not None and whole else ()
    on_circle = _coarse(box.low.size, len(circular), max_cells)[1]
    centres: list[FloatArray] = []
    periods: list[float | None] = []
    for axis, (low, high) in enumerate(zip(*declared_bounds(box), strict=True)):
        if axis in circular:
            periods.append(float(high - low))
            centres.append(np.linspace(low, high, on_circle, endpoint=False))
        else:
            periods.append(None)
            centres.append(np.array([min(max(0.0, low), high)]))
    return Fuzzy(centres, periods)


def _coarse(n_variables: int, n_circular: int, max_cells: float) -> tuple[int, int]:
    """The centres of a variable to begin with, and those of one that is circular.

    A circle has one more: its first centre is its last one as well.
    """
    for number in range(centres_for(COARSE, n_variables), 1, -1):
        if (
            number ** (n_variables - n_circular) * (number + 1) ** n_circular
            <= max_cells
        ):
            return number, number + 1
    return 1, 1


def widened(
    grid: AnyGrid, states: FloatArray, space: spaces.Box, max_cells: int
) -> AnyGrid | None:
    """Return the grid over the range that is seen, where that is wider than its own.

    While nothing is known of the range of variables, those that turn out to be cosine and
    sine of an angle become one circular variable (`acl_gym.utils.angles`).

    The centres of a variable whose range changes are spread evenly over the new range,
    as many as before; a variable with one centre that is seen to vary gets as many as
    `COARSE` says.

    Args:
        grid: a crisp or a fuzzy partition.
        states: what was seen, `(n, d)`.
        space: the observations; no range becomes wider than its bounds.
        max_cells: variables that are seen to vary get no more centres than this allows.

    Returns:
        The wider grid, or None if nothing was seen beyond the outermost centres.

    Raises:
        ValueError: what was seen lies too far apart, or too close together, for cells.
    """
    if not np.isfinite([states.min(axis=0), states.max(axis=0)]).all():
        return None  # whoever locates these states refuses them
    angled = _with_angles(grid, states, max_cells)
    wider, grid = angled is not None, angled or grid
    columns = list(grid.columns)
    least, most = (bounds[columns] for bounds in declared_bounds(space))
    variables = grid.variables(states)
    low, high = variables.min(axis=0), variables.max(axis=0)
    axes = list(grid.centres)
    for axis, line in enumerate(axes):
        beyond = low[axis] < line[0] or high[axis] > line[-1]
        if grid.periods[axis] is not None or not beyond:
            continue
        count = line.size
        if count == 1:
            circles = sum(period is not None for period in grid.periods)
            others = math.prod(each.size for each in axes)
            count = _coarse(len(axes), circles, max_cells)[0]
            count = max(1, min(count, max_cells // others))
            first, last = low[axis], high[axis]
        else:
            first, last = min(low[axis], line[0]), max(high[axis], line[-1])
        _check_range(axis, float(first), float(last), count)
        margin = MARGIN * (last - first)
        if low[axis] < line[0] or line.size == 1:
            first = max(first - margin, least[axis])
        if high[axis] > line[-1] or line.size == 1:
            last = min(last + margin, most[axis])
        if count == line.size == 1:
            continue
        if last > first and (first < line[0] or last > line[-1]):
            axes[axis] = np.linspace(first, last, count)
            wider = True
    return grid.with_centres(axes) if wider else None


def _check_range(axis: int, first: float, last: float, count: int) -> None:
    """Check that a range can be divided, to rounding.

    Raises:
        ValueError: it is too wide or too narrow.
    """
    gap = last / count - first / count  # Python's numbers overflow without a warning
    if gap != 0.0 and not 1e-300 < abs(gap) < 1e300:
        raise ValueError(
            "observations must have ranges that can be divided into cells, those of "
            f"variable {axis} lie between {first:g} and {last:g}; scale them."
        )


def _with_angles(grid: AnyGrid, states: FloatArray, max_cells: int) -> AnyGrid | None:
    """Make one circular variable of each two that are seen to be cosine and sine.

    Only of those that have one centre each: nothing was learned of them yet.
    """
    if grid.angles:
        return None
    lone = [axis for axis, line in enumerate(grid.centres) if line.size == 1]
    pairs = [(lone[i], lone[j]) for i, j in find_angles(states[:, lone])]
    if not pairs:
        return None
    sine_of = dict(pairs)
    kept = [a for a in range(len(grid.centres)) if a not in sine_of.values()]
    circles = len(pairs) + sum(grid.periods[axis] is not None for axis in kept)
    number = _coarse(len(kept), circles, max_cells)[1]
    circle = np.linspace(-np.pi, np.pi, number, endpoint=False)
    return type(grid)(
        [circle if axis in sine_of else grid.centres[axis] for axis in kept],
        [grid.periods[axis] for axis in kept],
        pairs,
    )


def carried_over(table: ArrayLike, old: Partition, new: Partition) -> FloatArray:
    """Return the table of a new partition that says what one of an old one said.

    Each new cell receives what the old table says of its centre: the sum of the old
    entries weighted with the degrees, eq. (4.7). If `new` is a fuzzy grid that has all
    centres of `old`, both tables agree in every state but for rounding, and so do their
    policies. The cells of a crisp grid receive a copy of the cell that holds their
    centre.

    Any agent can go on learning with finer cells: make a new one with
    `coarse.refined(0)`, and give its `set_table` the table that was carried over.

    Args:
        table: `(old.n_cells, n_actions)`.
        old: the partition of `table`.
        new: the partition to carry it over to, of the same state variables.

    Returns:
        `(new.n_cells, n_actions)`.

    Raises:
        TypeError: `old` or `new` is no partition.
        ValueError: the table is not one of `old`, or the partitions are not of the same
            variables.

    Example:
        >>> from acl_gym import Fuzzy
        >>> coarse = Fuzzy([[0.0, 1.0]])
        >>> carried_over([[1.0], [3.0]], coarse, coarse.refined(0)).ravel().tolist()
        [1.0, 2.0, 3.0]
    """
    for name, each in (("old", old), ("new", new)):
        if not isinstance(each, Partition):
            raise TypeError(
                f"{name} must be a partition, got {validation.shown(each)}; take Fuzzy, "
                "Crisp or Discrete."
            )
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
