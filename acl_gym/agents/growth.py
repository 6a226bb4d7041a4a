"""When the partition of an agent grows (§7.3), and what its table then says."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.colony.memory import UNITS
from acl_gym.partitions import Grid, Partition
from acl_gym.partitions.growing import carried_over, widened
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

logger = logging.getLogger("acl_gym")

WHERE = ("tried", "varied", "everywhere")
"""Where cells may be halved before those of the whole grid are, see `Growth`."""

TWICE = 2.0
"""How many times `visits_to_grow` the pairs between two centres must have been tried."""

NARROWEST = 2.0**-10
"""The share of a variable's range below which single intervals are not halved.

Where all episodes start in the same state, or a state is a number that is often repeated,
the cells around it would otherwise be halved for ever, and nothing would be learned from it.
"""


class Growth:
    """Says when a partition becomes wider or finer, and into what.

    Only grids grow: wider when something is seen beyond their range, finer when their
    pairs have been tried often enough.

    Args:
        on: whether it grows at all.
        where: where cells are halved before pairs have been tried often enough on the
            average. `"tried"`: where pairs have been tried twice as often as that. `"varied"`:
            where they have been tried often enough and the policy varies most (§7.3),
            weighted with how often they were tried. `"everywhere"`: nowhere sooner than
            elsewhere.

    Attributes:
        turn: whose turn it is, the number of a variable that varies, if the numbers go
            round; >= 0.

    Raises:
        TypeError: `on` is neither True nor False.
        ValueError: `where` is none of these words.
    """

    def __init__(self, on: bool, where: str = "tried") -> None:
        self.on = on
        self.where = where
        self.turn = 0
        self._told = 0  # the limit of which the log has said that it is reached

    @property
    def where(self) -> str:
        """Where cells are halved first."""
        return self._where

    @where.setter
    def where(self, value: str) -> None:
        self._where = validation.one_of("grows_where", value, WHERE)

    @property
    def on(self) -> bool:
        """Whether the partition becomes wider and finer."""
        return self._on

    @on.setter
    def on(self, value: bool) -> None:
        self._on = validation.boolean("grows", value)

    def wider(
        self,
        partition: Partition,
        states: NDArray[Any],
        space: spaces.Box,
        max_cells: int,
    ) -> Grid | None:
        """Return the partition over the range that is seen, or None if that is its own.

        Args:
            partition: the present one.
            states: what was seen, `(n, d)`.
            space: the observations.
            max_cells: the partition gets no more cells than this.
        """
        if not (self.on and isinstance(partition, Grid)):
            return None
        return widened(partition, states, space, max_cells)

    def finer(
        self,
        partition: Partition,
        evidence: IntArray,
        levels: FloatArray,
        visits_to_grow: float,
        max_cells: int,
    ) -> Grid | None:
        """Halve cells along the next variable for which there is evidence for finer ones.

        All cells, once the pairs have been tried often enough on the average. Before
        that, those between two neighbouring centres of the variable, if the pairs there
        have been tried so often: what of them is halved, `where` says.

        Args:
            partition: the present one.
            evidence: how often each pair was tried: sums of degrees, in units of
                1 / `UNITS`, `(n_pairs,)`.
            levels: what each pair promises, `(n_cells, n_actions)`.
            visits_to_grow: how many tries there must be for each pair and each variable
                that varies: the more variables, the more cells share a try.
            max_cells: the partition does not become finer than this.

        Returns:
            The finer partition, which the agent is to take over; or None.
        """
        if not (self.on and isinstance(partition, Grid)):
            return None
        several = [i for i, line in enumerate(partition.centres) if line.size > 1]
        enough = visits_to_grow * len(several) * UNITS
        everywhere = bool(evidence.mean() > enough)
        if self.where == "everywhere" and not everywhere:
            return None
        for turn in range(self.turn, self.turn + len(several)):
            axis = several[turn % len(several)]
            size, edges = partition.centres[axis].size, partition.edges(axis)
            low, high = edges[:-1], edges[1:]
            middle = low + (high - low) / 2
            if everywhere:
                chosen = (low < middle) & (middle < high)  # but for rounding, always
            else:
                chosen = self._chosen(partition, axis, evidence, levels, enough)
                chosen &= high - low > NARROWEST * (edges[-1] - edges[0])
            halved = np.count_nonzero(chosen)
            if not halved:
                continue
            if partition.n_cells // size * (size + halved) <= max_cells:
                self.turn = turn + 1
                return partition.refined(axis, chosen)
            self._tell(partition.n_cells, max_cells)
        return None

    def _tell(self, n_cells: int, max_cells: int) -> None:
        """Say once for each limit that it keeps cells from being halved."""
        if self._told != max_cells:
            self._told = max_cells
            logger.warning(
                "The partition has %d cells and would be made finer, but max_cells is "
                "%d; a higher limit allows finer cells.",
                n_cells,
                max_cells,
            )

    def _chosen(
        self,
        partition: Grid,
        axis: int,
        evidence: IntArray,
        levels: FloatArray,
        enough: float,
    ) -> BoolArray:
        """Which intervals of an axis are to be halved, `(n,)`."""
        shape = tuple(line.size for line in partition.centres)
        circular = partition.periods[axis] is not None
        tries = _sides(evidence.reshape(*shape, -1), axis, circular)
        others = tuple(range(1, tries[0].ndim))
        mean = np.mean([side.mean(axis=others) for side in tries], axis=0)
        if self.where == "tried":
            return np.asarray(mean > TWICE * enough)
        best = _sides(levels.argmax(axis=1).reshape(shape), axis, circular)
        both = np.minimum(*(side.sum(axis=-1, dtype=np.float64) for side in tries))
        varied = np.where(best[0] != best[1], both, 0.0).sum(axis=others[:-1])
        varied[mean <= enough] = 0.0
        # The fewest that have half of the variation among them.
        order = np.argsort(-varied, kind="stable")
        until = np.searchsorted(np.cumsum(varied[order]), varied.sum() / 2)
        chosen = np.zeros(varied.size, np.bool_)
        chosen[order[: until + 1]] = True
        return np.asarray(chosen & (varied > 0.0))

    def restore(self, turn: NDArray[Any]) -> None:
        """Take over whose turn it is, perhaps from a stranger's file.

        Raises:
            ValueError: it is not such a number.
        """
        if turn.shape != () or turn.dtype.kind not in "iu" or turn < 0:
            raise ValueError("growth_turn must be a number >= 0")
        self.turn = int(turn)


def _sides(
    of_cells: NDArray[Any], axis: int, circular: bool
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Split what belongs to cells into both sides of each interval of an axis.

    Returns:
        What belongs to the lower and to the upper centre of each interval, which are
        the first axis of both.
    """
    lines = np.moveaxis(of_cells, axis, 0)
    if circular:
        lines = np.concatenate([lines, lines[:1]])
    return lines[:-1], lines[1:]


def carried_with_known(
    table: FloatArray, known: BoolArray, old: Partition, new: Partition
) -> tuple[FloatArray, BoolArray]:
    """Carry a table over to a new partition, and what of it is known.

    A cell between one that is known and one that is not is not known. One beyond the range
    of the old partition takes over what is known at its edge. (If it counted as unknown,
    it would promise the most, and ants would go and see what lies further out; CartPole
    then took twice as long to learn.)

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
