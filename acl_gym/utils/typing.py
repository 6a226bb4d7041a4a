"""Types that many signatures share: arrays, rows of measures, what predicts."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
"""Real numbers: states, degrees, levels, costs."""

IntArray = NDArray[np.int64]
"""Integers: slots, counts, indices of actions."""

BoolArray = NDArray[np.bool_]
"""Flags and masks."""

CellArray = NDArray[np.int32]
"""Indices of a partition's cells."""

ActionArray = NDArray[np.integer[Any]]
"""Indices of actions in the smallest integers that hold them."""

RankArray = NDArray[np.int32]
"""An order of the actions in each cell, used to break ties."""

Float32Array = NDArray[np.float32]
"""Features for a neural network."""

Row = dict[str, float]
"""The measures of one trial, see `TabularAgent.history`."""


class Predictor(Protocol):
    """Anything with the `predict` of Stable-Baselines3: agents and policies."""

    def predict(self, observation: Any, *, deterministic: bool = ...) -> Any:
        """Return `(actions, state)` for a batch of observations."""
