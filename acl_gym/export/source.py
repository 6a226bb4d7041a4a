"""What every export needs to know of a greedy policy, checked once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from acl_gym.colony.greedy import greedy_actions
from acl_gym.colony.interpolation import interpolated_inputs
from acl_gym.envs.control.signals import Signals
from acl_gym.partitions import Discrete, Grid, Partition
from acl_gym.utils.angles import Angles
from acl_gym.utils.input_grid import InputGrid
from acl_gym.utils.typing import FloatArray, IntArray, RankArray


@dataclass(frozen=True, eq=False)
class Source:
    """A greedy policy (4.16) that is to be exported; see `of`.

    Attributes:
        kind: "fuzzy", "crisp" or "discrete".
        lines: the centres of each variable; a circular one ends where it began, one
            period on. The possible values, where the kind is discrete.
        periods: of each variable, 0 where it is not circular.
        cells: the number of cells along each variable; the last one varies fastest.
        angles: which numbers of an observation the variables are.
        table: `(n_cells, n_actions)`, values or levels.
        ranks: `(n_cells, n_actions)`, the order in which tied actions are preferred.
        first_action: the action that column 0 stands for.
        signals: what observations and actions mean; None if unknown.
        grid: where the policy chooses real inputs between its actions, the grid of
            these; `signals` are then known.
    """

    kind: str
    lines: tuple[FloatArray, ...]
    periods: tuple[float, ...]
    cells: tuple[int, ...]
    angles: Angles
    table: FloatArray
    ranks: RankArray
    first_action: int
    signals: Signals | None
    grid: InputGrid | None = None

    @classmethod
    def of(
        cls,
        partition: Partition,
        table: FloatArray,
        ranks: RankArray,
        first_action: int = 0,
        signals: Signals | None = None,
    ) -> Self:
        """Describe a policy.

        Args:
            partition: `Crisp`, `Fuzzy` or `Discrete`.
            table: `(n_cells, n_actions)`.
            ranks: `(n_cells, n_actions)`.
            first_action: the action that column 0 stands for.
            signals: what observations and actions mean; names of observations of
                another size are left out.

        Raises:
            TypeError: the partition locates states by a method of its own.
            ValueError: the table holds NaN, or infinity in a fuzzy policy, or
                `signals` fit another number of actions.
        """
        kind, centres, given, angles = _axes(partition)
        # A lone centre takes every value, so it needs no period.
        periods = [
            0.0 if period is None or line.size == 1 else float(period)
            for line, period in zip(centres, given, strict=True)
        ]
        lines = [
            np.append(line, line[0] + period) if period else line
            for line, period in zip(centres, periods, strict=True)
        ]
        bad = ~np.isfinite(table) if kind == "fuzzy" else np.isnan(table)
        if bad.any():
            cell = int(np.flatnonzero(bad.any(axis=1))[0])
            raise ValueError(
                "the table of a policy must hold finite numbers to be exported, got "
                f"{table[cell].tolist()} for cell {cell}."
            )
        if signals is not None and len(signals.values) != table.shape[1]:
            raise ValueError(
                "inputs must hold a number or a row of numbers for each of the "
                f"{table.shape[1]} actions, got {len(signals.values)}."
            )
        if signals is not None and len(signals.observations) != angles.n_observed:
            signals = replace(signals, observations=())
        cells = tuple(line.size for line in centres)
        return cls(
            kind,
            tuple(lines),
            tuple(periods),
            cells,
            angles,
            table,
            ranks,
            first_action,
            signals,
        )

    @property
    def n_actions(self) -> int:
        """The number of actions."""
        return int(self.table.shape[1])

    def between(self, grid: InputGrid, signals: Signals) -> Self:
        """The same, but with real inputs between the actions.

        Args:
            grid: the inputs of the actions.
            signals: with the same inputs.
        """
        if len(signals.observations) != self.angles.n_observed:
            signals = replace(signals, observations=())
        return replace(self, grid=grid, signals=signals)

    @cached_property
    def cell_inputs(self) -> FloatArray:
        """The real inputs that are chosen in each cell by itself, `(n_cells, n_inputs)`."""
        if self.grid is None:
            raise ValueError("only policies between actions have real inputs.")
        index = np.arange(len(self.table), dtype=np.int32)[:, None]
        return interpolated_inputs(
            self.table, index, np.ones(index.shape), self.best_columns, self.grid
        )

    @cached_property
    def best_columns(self) -> IntArray:
        """The best column of each cell, ties broken as in `predict`, `(n_cells,)`."""
        index = np.arange(len(self.table), dtype=np.int32)[:, None]
        return greedy_actions(self.table, self.ranks, index, np.ones(index.shape))

    @cached_property
    def orders(self) -> tuple[IntArray, IntArray]:
        """The distinct rows of `ranks`, made 0, 1, ..., and which of them a cell has.

        There are at most n_actions! of them, so that a number for each cell takes less
        memory than a row does.
        """
        ranks = np.argsort(self.ranks, axis=1, kind="stable")
        ranks = np.argsort(ranks, axis=1, kind="stable")
        rows, which = np.unique(ranks, axis=0, return_inverse=True)
        return rows, which.ravel()


def _axes(
    partition: Partition,
) -> tuple[str, tuple[FloatArray, ...], tuple[float | None, ...], Angles]:
    """The kind of a partition; centres and period of each variable; its angles."""
    locate = type(partition).locate
    if isinstance(partition, Grid) and locate is Grid.locate:
        kind = "fuzzy" if partition.fuzzy else "crisp"
        angles = Angles(partition.angles, len(partition.centres))
        return kind, partition.centres, partition.periods, angles
    if isinstance(partition, Discrete) and locate is Discrete.locate:
        sizes, starts = partition.sizes.ravel(), partition.starts.ravel()
        lines = tuple(
            np.arange(start, start + size, dtype=np.float64)
            for start, size in zip(starts, sizes, strict=True)
        )
        return "discrete", lines, (None,) * len(lines), Angles((), len(lines))
    raise TypeError(
        "only policies over Crisp, Fuzzy and Discrete partitions can be exported, got "
        f"{type(partition).__name__}, which locates states by a method of its own; "
        "learn on one of these partitions."
    )
