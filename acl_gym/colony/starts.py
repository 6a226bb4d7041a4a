"""Whether ants learn more from setting out anew than from walking on.

An ant that starts anywhere sees more of the task from many short walks than from a few
long ones: what follows the end of a walk is promised by what others have seen. Where all
ants start in the same place, only long walks lead away from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.memory import Memory
from acl_gym.partitions import locate_all

ENOUGH = 20
"""Starts after which it is decided whether they are spread widely."""

SPREAD = 0.5
"""They are if they lie in at least this share of the cells in which states lie."""

SHORT = 60
"""Steps of a walk between starts that are spread widely."""


class Starts:
    """Compares the first states of episodes with all that are seen.

    Attributes:
        wide: whether starts are spread as widely as all states; None before that is
            decided.
    """

    def __init__(self) -> None:
        self.wide: bool | None = None
        self._seen: list[NDArray[Any]] = []

    def add(self, observation: NDArray[Any], memory: Memory) -> None:
        """Note where a trial begins, and decide when enough has been seen.

        Args:
            observation: the first states, one for each ant, `(m, ...)`.
            memory: what has been seen before.
        """
        if self.wide is None:
            if sum(map(len, self._seen)) < ENOUGH:
                self._seen.append(observation.copy())
            elif memory.live_rows().size:  # none are left after the agent has forgotten
                self._decide(memory)

    def steps(self, most: int) -> int:
        """After how many steps ants set out anew.

        Args:
            most: T, after how many steps they do so in any case.
        """
        return most if self.wide is False else min(most, SHORT)

    def _decide(self, memory: Memory) -> None:
        partition = memory.partition
        starts = np.concatenate(self._seen)
        index, degree = locate_all(partition, starts, partition.n_cells)
        rows = memory.live_rows()
        rows = rows[np.linspace(0, rows.size - 1, len(starts)).astype(np.int64)]
        of_starts = _foremost(index, degree).size
        of_states = _foremost(memory.index[rows], memory.degree[rows]).size
        self.wide = of_starts >= SPREAD * of_states
        self._seen = []

    def copy(self) -> Starts:
        """The same, to come back to."""
        copied = Starts()
        copied.wide, copied._seen = self.wide, list(self._seen)
        return copied

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a file holds of it, for `restore`."""
        decided = -1 if self.wide is None else int(self.wide)
        kept = {"wide": np.array(decided)}
        if self._seen:
            kept["seen"] = np.concatenate(self._seen)
        return kept

    def restore(self, arrays: Mapping[str, NDArray[Any]], memory: Memory) -> None:
        """Take over what `arrays` gave, perhaps from a stranger's file.

        Raises:
            KeyError: an array is missing.
            ValueError: one is not what it should be.
        """
        wide = arrays["wide"]
        if wide.shape != () or wide.dtype.kind not in "iu" or not -1 <= wide <= 1:
            raise ValueError("the array starts_wide must be -1, 0 or 1")
        self.wide = None if wide < 0 else bool(wide)
        self._seen = []
        if "seen" in arrays:
            partition = memory.partition
            locate_all(partition, arrays["seen"], partition.n_cells)  # checks them
            self._seen.append(arrays["seen"].copy())


def _foremost(index: NDArray[Any], degree: NDArray[Any]) -> NDArray[Any]:
    """The cells to which any of these states belongs most."""
    most = degree.argmax(axis=1)
    return np.unique(index[np.arange(len(index)), most])
