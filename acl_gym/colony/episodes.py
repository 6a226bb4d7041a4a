"""What ants did in a trial, step by step, for costs of complete solutions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Episode:
    """One episode of one ant, of L steps.

    Attributes:
        observations: from the first to the last, `(L + 1, ...)`.
        actions: indices, `(L,)`; where a policy sets real inputs, `(L, n_inputs)`.
        stage_costs: -(reward) of each step, `(L,)`.
        terminated: whether it ended in a terminal state.
    """

    observations: NDArray[Any]
    actions: NDArray[Any]
    stage_costs: FloatArray
    terminated: bool


@dataclass(frozen=True)
class Episodes:
    """The episodes of all n ants of a trial, time first.

    Rows of an ant beyond its length L have no meaning.

    Attributes:
        observations: `(longest + 1, n, ...)`.
        actions: indices, `(longest, n)`; where a policy sets real inputs,
            `(longest, n, n_inputs)`.
        stage_costs: `(longest, n)`.
        lengths: L of each ant, `(n,)`.
        terminated: whether each ended in a terminal state, `(n,)`.
    """

    observations: NDArray[Any]
    actions: NDArray[Any]
    stage_costs: FloatArray
    lengths: IntArray
    terminated: BoolArray

    def __len__(self) -> int:
        """How many ants there are."""
        return int(self.lengths.size)

    def __getitem__(self, ant: int) -> Episode:
        """The solution of one ant, copied."""
        length = int(self.lengths[ant])
        return Episode(
            self.observations[: length + 1, ant].copy(),
            self.actions[:length, ant].copy(),
            self.stage_costs[:length, ant].copy(),
            bool(self.terminated[ant]),
        )

    def taken(self) -> BoolArray:
        """Which steps were taken, `(longest, n)`."""
        steps = np.arange(len(self.actions))[:, None]
        return np.asarray(steps < self.lengths)

    def variable(self, index: int, period: float | None = None) -> FloatArray:
        """One state variable over time, `(longest + 1, n)`; it keeps its last value.

        Args:
            index: of the variable.
            period: of a circular one: jumps from one end to the other are undone.

        Raises:
            ValueError: there is no such variable.
        """
        observations = self.observations
        if observations.ndim == 2:
            observations = observations[:, :, None]
        if observations.ndim != 3 or not 0 <= index < observations.shape[2]:
            raise ValueError(
                "variable must be one of the observation's, got "
                f"{index} for observations of shape {self.observations.shape[2:]}."
            )
        times = np.arange(len(observations))[:, None]
        last = np.minimum(times, self.lengths)
        values = np.take_along_axis(
            observations[:, :, index].astype(np.float64), last, axis=0
        )
        return values if period is None else np.unwrap(values, period=period, axis=0)
