"""The greedy policy over a table: what every method of this package learns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.colony.greedy import greedy_actions
from acl_gym.envs.control.signals import Signals
from acl_gym.export import Source
from acl_gym.partitions import Partition
from acl_gym.policies.base import PartitionPolicy, checked_first_action
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, RankArray


def random_ranks(n_cells: int, n_actions: int, rng: np.random.Generator) -> RankArray:
    """A random order of the actions for each cell, `(n_cells, n_actions)`.

    Ties are broken at random (4.16). Drawing the order once makes the policy a function
    (a decision).
    """
    ranks = np.tile(np.arange(n_actions, dtype=np.int32), (n_cells, 1))
    return np.asarray(rng.permuted(ranks, axis=1), dtype=np.int32)


class TablePolicy(PartitionPolicy):
    """The greedy policy, eq. (4.16): the action of the largest degree-weighted entry.

    Args:
        partition: turns observations into cells and degrees.
        table: `(n_cells, n_actions)`, pheromone levels or action values.
        ranks: `(n_cells, n_actions)`, the order in which tied actions are preferred;
            None draws it from a fixed seed.
        first_action: the action that column 0 stands for, `Discrete.start`.
        signals: what observations and actions mean, for `to_c` and `to_numpy`; None if
            unknown.

    Raises:
        TypeError: `partition` is no partition, or `first_action` not an integer.
        ValueError: `table` or `ranks` do not fit the partition, or an entry is
            NaN.
    """

    _fixed = ("partition", "table", "ranks", "first_action")

    def __init__(
        self,
        partition: Partition,
        table: FloatArray,
        ranks: RankArray | None = None,
        first_action: int = 0,
        signals: Signals | None = None,
    ) -> None:
        if not isinstance(table, np.ndarray) or table.dtype != np.float64:
            got = getattr(table, "dtype", type(table).__name__)
            raise ValueError(f"table must be an array of float64, got {got}.")
        self._check_fits("table", table, partition)
        if np.isnan(table).any():
            cell = int(np.argmax(np.isnan(table).any(axis=1)))
            raise ValueError(
                f"table must not hold NaN, got {validation.shown(table[cell].tolist())} in "
                f"cell {cell}."
            )
        n_cells, n_actions = table.shape
        if ranks is None:
            ranks = random_ranks(n_cells, n_actions, np.random.default_rng(0))
        if (
            not isinstance(ranks, np.ndarray)
            or ranks.shape != table.shape
            or ranks.dtype.kind not in "iu"
        ):
            raise ValueError(
                f"ranks must be integers in the shape of the table, {table.shape}, got "
                f"{validation.shown(ranks)}."
            )
        if ranks.dtype != np.int32:
            ranks = ranks.astype(np.int32)
        self.partition = partition
        self.table = table
        self.ranks = ranks
        self.first_action = checked_first_action(first_action)
        self.signals = signals

    @property
    def n_actions(self) -> int:
        """See `PartitionPolicy.n_actions`."""
        return int(self.table.shape[1])

    @property
    def _n_cells(self) -> int:
        return len(self.table)

    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        return greedy_actions(self.table, self.ranks, index, degree, allowed)

    def best_actions(self) -> IntArray:
        """The greedy policy, eq. (3.10): the best column of each cell, `(n_cells,)`."""
        return best_of_rows(self.table, self.ranks)

    def copy(self) -> TablePolicy:
        """The same policy over a table that no longer changes."""
        return TablePolicy(
            self.partition,
            self.table.copy(),
            self.ranks,
            self.first_action,
            self.signals,
        )

    def _source(self, inputs: ArrayLike | None = None) -> Source:
        signals = self.signals
        if inputs is not None:
            names = () if signals is None else signals.observations
            signals = Signals.of_inputs(inputs, names)
        return Source.of(
            self.partition, self.table, self.ranks, self.first_action, signals
        )


@njit
def best_of_rows(table: FloatArray, ranks: RankArray) -> IntArray:
    """The best column of each row, `(n,)`; ties by the ranks."""
    best = np.zeros(table.shape[0], dtype=np.int64)
    for cell in range(table.shape[0]):
        for u in range(1, table.shape[1]):
            lead = table[cell, u] - table[cell, best[cell]]
            if lead > 0.0 or (lead == 0.0 and ranks[cell, u] < ranks[cell, best[cell]]):
                best[cell] = u
    return best
