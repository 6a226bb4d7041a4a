"""Grids over real variables: crisp bins, eq. (4.2), and fuzzy cells, eq. (4.7)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from acl_gym.partitions.axes import (
    check_spans,
    checked_centres,
    checked_periods,
    regular_rate,
    spread_centres,
)
from acl_gym.partitions.base import (
    MOST_CELLS,
    FixedPartition,
    check_memory_of_states,
    check_states,
    trusted,
)
from acl_gym.partitions.kernels import OUTSIDE, Axes, locate, locate_in_parallel
from acl_gym.utils import threads, validation
from acl_gym.utils.angles import Angles, periods_with_angles
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

_FLOAT = np.dtype(np.float64)


class Grid(FixedPartition):
    """A product of axes, each with strictly increasing centres.

    A variable with one centre makes no difference: all its values belong to that one.

    Args:
        centres: for each state variable its centres, strictly increasing; one or
            more variables, one or more centres each.
        periods: for each variable its period if it is circular (2 pi for an angle),
            else None. None for all: no variable is circular.
        angles: for each variable that is observed as a cosine and a sine the numbers of
            these two in an observation, see `Angles`; its period is 2 pi. With
            `angles=[(0, 1)]` an observation (cos, sin, velocity) is in the cells of two
            variables, angle and velocity.

    Raises:
        ValueError: centres that do not increase strictly or are not finite, or that
            span a full period; a period that is not positive; angles that are no pairs
            of numbers of an observation.
    """

    fuzzy: ClassVar[bool]
    _fixed = (
        "centres",
        "periods",
        "angles",
        "n_cells",
        "cells_per_state",
        "state_ndim",
        "_cells",
        "_varied",
        "_edges",
        "_axes",
        "_splits",
    )

    def __init__(
        self,
        centres: Sequence[ArrayLike],
        periods: Sequence[float | None] | None = None,
        angles: Sequence[tuple[int, int]] = (),
    ) -> None:
        given = validation.elements(centres)
        if given is None or (isinstance(centres, np.ndarray) and centres.ndim == 1):
            raise ValueError(
                "centres must be one sequence for each state variable, got "
                f"{validation.shown(centres)}; pass [sequence] for a single variable."
            )
        axes = [checked_centres(axis, values) for axis, values in enumerate(given)]
        if not axes:
            raise ValueError("centres must hold one or more state variables, got none.")
        self._angles = Angles(angles, len(axes))
        self.angles = self._angles.pairs
        lengths = periods_with_angles(checked_periods(periods, axes), self._angles)
        check_spans(axes, lengths)
        self.centres = tuple(map(validation.read_only, axes))
        self.periods = tuple(lengths)
        self._cells = tuple(axis.size for axis in axes)
        self.n_cells = math.prod(self._cells)
        if self.n_cells > MOST_CELLS:
            raise ValueError(
                f"a partition must have fewer than 2^31 cells, got {self.n_cells}; "
                "use fewer centres."
            )
        self.state_ndim = 1
        # Kernels see only the variables that have several centres, or else the first.
        several = [axis for axis, size in enumerate(self._cells) if size > 1]
        self._varied = tuple(several or [0])
        self.cells_per_state = 2 ** len(several) if self.fuzzy else 1
        self._splits = self.cells_per_state > 1

        edges = [
            # A lone centre takes every state, so it needs no copy a period on.
            axes[i]
            if (period := lengths[i]) is None or axes[i].size == 1
            else np.append(axes[i], axes[i][0] + period)
            for i in self._varied
        ]
        self._edges = np.concatenate(edges)
        counts = [axis.size for axis in edges]
        self._axes: Axes = (
            tuple(
                int(end) - n for end, n in zip(np.cumsum(counts), counts, strict=True)
            ),
            tuple(counts),
            tuple(self._cells[i] for i in self._varied),
            tuple(lengths[i] or 0.0 for i in self._varied),
            tuple(regular_rate(axis) for axis in edges),
        )

    @classmethod
    def from_box(
        cls,
        space: spaces.Box,
        cells: int | Sequence[int],
        circular: Iterable[int] = (),
    ) -> Self:
        """Spread centres evenly over a Box.

        Args:
            space: a bounded one-dimensional Box, for instance
                `env.single_observation_space`.
            cells: number of centres, for all variables or for each.
            circular: the variables that wrap around, such as angles.
                Their centres are low, low + range / n, ... as in (5.2); all others
                have centres on both ends as in (5.3).

        Raises:
            ValueError: the Box is unbounded or not one-dimensional, or `cells` or
                `circular` do not fit it.
        """
        return cls(*spread_centres(space, cells, circular))

    def check_space(self, space: spaces.Space[Any]) -> None:
        """Refuse what is not a one-dimensional Box of as many variables.

        Raises:
            ValueError: the observations of `space` are not states of the partition.
        """
        dimensions = self._angles.n_observed
        if not isinstance(space, spaces.Box) or space.shape != (dimensions,):
            raise ValueError(
                f"{self!r} takes observations from a Box of shape ({dimensions},), "
                f"got {validation.shown(space)}; build the partition from "
                "env.single_observation_space, "
                "or let automatic_partition(env) do it."
            )

    @property
    def columns(self) -> tuple[int, ...]:
        """Of each variable its number in an observation; of an angle its cosine's."""
        return self._angles.columns

    def variables(self, observations: NDArray[Any]) -> NDArray[Any]:
        """The variables that observations show, `(n, d)`: angles for their cosines."""
        return self._angles.variables(observations)

    def observations(self, variables: FloatArray) -> FloatArray:
        """What shows these variables, `(n, d)`: cosines and sines for angles."""
        return self._angles.observations(variables)

    def refine(self, axis: int, centres: ArrayLike) -> Self:
        """Return the partition with centres of your choice added along one axis.

        Around a goal that is narrow compared with the cells, this costs few cells and
        can keep a policy from hovering near the goal (docs/hovering.md).

        Args:
            axis: the state variable.
            centres: what to add, in any order; existing ones are skipped.

        Raises:
            ValueError: there is no such axis, or a centre is not finite.
        """
        axis = self._checked_axis(axis)
        axes = list(self.centres)
        there = axes[axis]
        added = validation.real_array("centres", centres, ndim=1)
        # What differs by rounding only is the same centre.
        distance = np.abs(added[:, None] - there).min(axis=1)
        new = added[distance > 1e-9 * max(np.ptp(there), np.ptp(added))]
        axes[axis] = np.union1d(there, new)
        return self.with_centres(axes)

    def with_centres(self, centres: Sequence[ArrayLike]) -> Self:
        """Return a partition of the same variables with other centres.

        Args:
            centres: as in the constructor.

        Raises:
            ValueError: see the constructor.
        """
        return type(self)(centres, self.periods, self.angles)

    def refined(
        self, axis: int, intervals: Sequence[bool] | BoolArray | None = None
    ) -> Self:
        """Return the partition with a new centre in the middle of intervals of one axis.

        All old centres stay, so that `acl_gym.partitions.growing.carried_over` carries a
        fuzzy table over exactly: values and policy stay as they are but for rounding.
        An axis with one centre stays too; nothing is known of its range.

        Args:
            axis: the state variable, 0 .. d - 1.
            intervals: which to halve, `(n,)`: those between neighbouring centres, on a
                circular axis also the last one, which closes the circle. None halves
                all.

        Raises:
            ValueError: there is no such axis, `intervals` do not fit it, or there would
                be 2^31 cells or more.
        """
        axis = self._checked_axis(axis)
        axes, edges = list(self.centres), self.edges(axis)
        middles = edges[:-1] + np.diff(edges) / 2
        if intervals is not None:
            chosen = validation.as_array(intervals)
            if (
                chosen is None
                or chosen.shape != middles.shape
                or chosen.dtype.kind != "b"
            ):
                raise ValueError(
                    f"intervals must be {middles.size} bools for axis {axis}, got "
                    f"{validation.shown(intervals)}."
                )
            middles = middles[chosen]
        axes[axis] = np.sort(np.concatenate([axes[axis], middles]))
        return self.with_centres(axes)

    def edges(self, axis: int) -> FloatArray:
        """Where the intervals of an axis end that `refined` halves, `(n + 1,)`.

        These are the centres, and on a circular axis the first one again, a period later.
        """
        centres, period = self.centres[axis], self.periods[axis]
        if period is None or centres.size == 1:
            return centres
        return np.append(centres, centres[0] + period)

    def _checked_axis(self, axis: int) -> int:
        most = len(self.centres) - 1
        return validation.integer("axis", axis, at_least=0, at_most=most)

    def _fill(
        self,
        states: NDArray[Any],
        slots: IntArray,
        index: CellArray,
        degree: FloatArray,
    ) -> None:
        dimensions = self._angles.n_observed
        if type(states) is not np.ndarray:
            check_states(states)
        if states.ndim != 2 or states.shape[1] != dimensions:
            raise ValueError(
                f"states must have shape (n, {dimensions}), got {states.shape}."
            )
        if states.dtype is not _FLOAT:
            states = _as_float64(states)
        seen, bad = states, -1
        if self.angles:
            seen = self.variables(states)
        if len(self._varied) < len(self.centres):
            bad = _first_not_finite(seen, slots)
            seen = np.take(seen, self._varied, axis=1)
        if bad == -1:
            find = locate
            if threads.worth_it(slots.size):
                find = locate_in_parallel
            bad = find(
                seen,
                slots,
                self._edges,
                self._axes,
                self._splits,
                index,
                degree,
            )
        if bad == OUTSIDE:
            raise ValueError(f"slots must be rows of the {len(states)} states.")
        if bad >= 0:
            raise ValueError(
                f"states must be finite, got {validation.shown(states[bad].tolist())} "
                f"in row {bad}; where these are observations, a row is a slot: check what "
                "the environment returns there."
            )

    def cell_states(self) -> FloatArray:
        """The centres of all cells as observations, in the order of (4.8).

        They are `(n_cells, d)`, with d numbers in an observation.

        Raises:
            ValueError: they do not fit into memory.
        """
        check_memory_of_states(self.n_cells, self._angles.n_observed)
        mesh = np.meshgrid(*self.centres, indexing="ij")
        return self.observations(np.stack(mesh, axis=-1).reshape(self.n_cells, -1))

    def settings(self) -> dict[str, Any]:
        """See `Partition.settings`."""
        settings: dict[str, Any] = {
            "type": type(self).__name__,
            "centres": [axis.tolist() for axis in self.centres],
            "periods": list(self.periods),
        }
        if self.angles:
            settings["angles"] = [list(pair) for pair in self.angles]
        return settings

    def _variables(self) -> list[tuple[Any, ...]]:
        sine_of = dict(self.angles)
        rows: list[tuple[Any, ...]] = []
        for i, (column, axis, period) in enumerate(
            zip(self.columns, self.centres, self.periods, strict=True)
        ):
            note = "" if period is None else f"circular, period {period:.4g}"
            if column in sine_of:
                both = f"{column + 1} and {sine_of[column] + 1}"
                note = f"angle, from observations {both}"
            elif self.angles and column != i:
                note = ", ".join(filter(None, [f"observation {column + 1}", note]))
            rows.append((i + 1, axis.size, f"{axis[0]:.4g}", f"{axis[-1]:.4g}", note))
        return rows

    def __repr__(self) -> str:
        """Name, cells along each axis, and which axes are circular."""
        shape = " x ".join(str(n) for n in self._cells)
        rounds = [axis for axis, p in enumerate(self.periods) if p is not None]
        seen = f", angles={list(self.angles)}" if self.angles else ""
        return f"{type(self).__name__}({shape} cells, circular={rounds}{seen})"


@trusted
class Crisp(Grid):
    """Crisp bins: a state belongs entirely to the nearest centre, eq. (4.2).

    A state halfway between two centres belongs to the upper one. See `from_box` for
    evenly spread centres.

    Args:
        centres: for each state variable its centres, strictly increasing.
        periods: for each variable its period if circular, else None.
        angles: which variables are observed as cosine and sine, see `Grid`.
    """

    fuzzy = False


@trusted
class Fuzzy(Grid):
    """Fuzzy cells: triangular membership functions, eqs. (4.7)-(4.9).

    The degree of a cell is the product of the memberships of the variables; a state
    beyond the outermost centres belongs entirely to the outermost. See `from_box` for
    evenly spread centres.

    Args:
        centres: for each state variable its centres, strictly increasing.
        periods: for each variable its period if circular, else None.
        angles: which variables are observed as cosine and sine, see `Grid`.
    """

    fuzzy = True


def checked_kind(kind: Any) -> type[Grid]:
    """Return `kind` if it is a kind of grid.

    Raises:
        TypeError: it is not `Crisp`, `Fuzzy` or a subclass of one of them.
    """
    if not (isinstance(kind, type) and issubclass(kind, (Crisp, Fuzzy))):
        raise TypeError(
            f"kind must be the class Crisp or Fuzzy, got {validation.shown(kind)}."
        )
    return kind


def _as_float64(states: NDArray[Any]) -> FloatArray:
    if states.dtype == _FLOAT:
        return states
    if states.dtype.kind not in "fiu":
        raise ValueError(f"states must be real numbers, got dtype {states.dtype}.")
    return states.astype(np.float64)


def _first_not_finite(states: FloatArray, slots: IntArray) -> int:
    """A slot with a state that is not finite, `OUTSIDE` if one is no row; else -1."""
    if slots.size and (slots.min() < 0 or slots.max() >= len(states)):
        return OUTSIDE
    finite = np.isfinite(states[slots]).all(axis=1)
    return -1 if finite.all() else int(slots[np.argmin(finite)])


KINDS: dict[str, type[Crisp | Fuzzy]] = {"crisp": Crisp, "fuzzy": Fuzzy}
"""The partitions of continuous states by name."""
