"""When the partition of an agent grows (§7.3), and what its table then says."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.colony.memory import UNITS
from acl_gym.partitions import Grid, Partition
from acl_gym.partitions.growing import carried_over, widened
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class Growth:
    """Says when a partition becomes wider or finer, and into what.

    Only grids grow: wider when something is seen beyond their range, finer when their
    pairs have been tried often enough.

    Args:
        on: whether it grows at all.

    Attributes:
        splits: how often cells were halved along one variable, >= 0.

    Raises:
        TypeError: `on` is neither True nor False.
    """

    def __init__(self, on: bool) -> None:
        self.on = on
        self.splits = 0

    @property
    def on(self) -> bool:
        """Whether the partition becomes wider and finer."""
        return self._on

    @on.setter
    def on(self, value: bool) -> None:
        if not isinstance(value, bool):
            raise TypeError(
                f"grows must be True or False, got {validation.shown(value)}."
            )
        self._on = value

    def wider(
        self, partition: Partition, states: NDArray[Any], space: spaces.Box
    ) -> Grid | None:
        """Return the partition over the range that is seen, or None if that is its own.

        Args:
            partition: the present one.
            states: what was seen, `(n, d)`.
            space: the observations.
        """
        if not (self.on and isinstance(partition, Grid)):
            return None
        return widened(partition, states, space)

    def finer(
        self,
        partition: Partition,
        evidence: IntArray,
        visits_to_grow: float,
        max_cells: int,
    ) -> Grid | None:
        """Halve the cells along the next variable if there is evidence for finer ones.

        Args:
            partition: the present one.
            evidence: how often each pair was tried: sums of degrees, in units of
                1 / `UNITS`, `(n_pairs,)`.
            visits_to_grow: how many tries there must be for each pair and each variable
                that varies: the more variables, the more cells share a try.
            max_cells: the partition does not become finer than this.

        Returns:
            The finer partition, which the agent is to take over; or None.
        """
        if not (self.on and isinstance(partition, Grid)):
            return None
        several = [i for i, line in enumerate(partition.centres) if line.size > 1]
        if not several:
            return None
        axis = several[self.splits % len(several)]
        size = partition.centres[axis].size
        halved = size - 1 if partition.periods[axis] is None else size
        if partition.n_cells // size * (size + halved) > max_cells:
            return None  # first, since a look at the evidence takes longer
        tries = float(evidence.mean()) / UNITS
        if tries <= visits_to_grow * len(several):
            return None
        self.splits += 1
        return partition.refined(axis)

    def restore(self, splits: NDArray[Any]) -> None:
        """Take over the number of splits, perhaps from a stranger's file.

        Raises:
            ValueError: it is not one.
        """
        if splits.shape != () or splits.dtype.kind not in "iu" or splits < 0:
            raise ValueError("splits must be a number >= 0")
        self.splits = int(splits)


def carried_with_known(
    table: FloatArray, known: BoolArray, old: Partition, new: Partition
) -> tuple[FloatArray, BoolArray]:
    """Carry a table over to a new partition, and what of it is known.

    A cell between one that is known and one that is not is not known.

    Args:
        table: `(old.n_cells, n_actions)`.
        known: whether anything was learned of each pair, of the same shape.
        old: the partition of both.
        new: the partition to carry them over to, of the same state variables.

    Returns:
        Both, `(new.n_cells, n_actions)`.
    """
    n_actions = table.shape[1]
    both = carried_over(np.hstack([table, known]), old, new)
    return both[:, :n_actions].copy(), both[:, n_actions:] > 1.0 - 1e-9
