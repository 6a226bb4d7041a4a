"""Batches of M solutions in a colony whose ants come back one by one (§7.3)."""

from __future__ import annotations

import numpy as np

from acl_gym.utils.typing import FloatArray


class Batches:
    """Counts the ants that come back, M to a batch, and keeps the last M costs.

    What happens once in a synchronous trial of M ants happens once in a batch. A deposit
    that compares solutions compares each with the last M, over trials.

    Attributes:
        costs: J of the last ants that came back, at most M, `(n,)`, the newest last.
    """

    def __init__(self) -> None:
        self.costs: FloatArray = np.empty(0)
        self.start_trial()

    def start_trial(self) -> None:
        """Begin a trial, and with it a batch; the costs are kept."""
        self._count, self._is_full = 0, True

    def add(self, costs: FloatArray, size: int) -> bool:
        """Note ants that have come back together.

        Args:
            costs: J of each, `(m,)`.
            size: M, the number of ants of a batch.

        Returns:
            Whether they begin a batch.
        """
        begins = self._is_full
        self._count += costs.size
        self._is_full = self._count >= size
        if self._is_full:
            self._count -= size
        self.costs = np.concatenate([self.costs, costs])[-size:]
        return begins
