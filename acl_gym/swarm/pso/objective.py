"""The function to minimize, as a swarm calls it: whole batches in, checked values out."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from acl_gym.swarm.pso import kernels
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_PACKAGE = str(Path(__file__).parents[2] / "_")[:-1]


class Objective:
    """A function of points, whose values are checked and counted.

    NaN counts as infinity, which is worse than every number, with one warning.

    A function of one point that is taken for one of many points is found by the shape of
    what it returns, unless there are as many points as variables. In that case the first
    call has one point more, which is not counted.

    Args:
        function: of `(n, d)`, returns `(n,)`; if not `vectorized`, of `(d,)`, returns a
            number. It is given a copy, which it may change.
        vectorized: whether it takes many points at once.

    Attributes:
        evaluations: how many points it was called with.

    Raises:
        TypeError: `function` cannot be called.
    """

    def __init__(self, function: Callable[..., Any], vectorized: bool = True) -> None:
        if not callable(function):
            raise TypeError(
                "function must be callable, a function of an array of points, got "
                f"{validation.shown(function)}."
            )
        self.function = function
        self.vectorized = validation.boolean("vectorized", vectorized)
        self.evaluations = 0
        self._warned = False
        self._unlike = False  # whether a call had not as many points as variables

    def __call__(self, points: FloatArray) -> FloatArray:
        """The values at some points.

        Args:
            points: `(n, d)`.

        Returns:
            A new array `(n,)` without NaN.

        Raises:
            ValueError: the function has returned anything but a number for each point.
        """
        self.evaluations += len(points)
        if self.vectorized:
            n, d = points.shape
            if self._unlike or n != d or d == 1:
                values = self._checked(self.function(points.copy()), n)
            else:
                batch = np.vstack([points, points[:1]])
                values = self._checked(self.function(batch), n + 1)[:n]
            self._unlike = True
        else:
            values = np.array([self._of_one(row.copy()) for row in points])
        first = kernels.replace_nan(values)
        if first >= 0 and not self._warned:
            self._warned = True
            warnings.warn(
                f"the function returned NaN at {validation.shown(points[first].tolist())}"
                "; NaN counts as infinity, worse than every number, here and from now on.",
                RuntimeWarning,
                stacklevel=_level_of_caller(),
            )
        return values

    def _checked(self, returned: Any, n: int) -> FloatArray:
        # A copy, because the function may use its array again.
        if type(returned) is np.ndarray and returned.dtype == np.float64:
            values = returned.copy()
        else:
            array = validation.as_array(returned)
            if array is None or array.dtype.kind not in "iufb":
                raise ValueError(
                    f"the function must return {n} real numbers for {n} points, got "
                    f"{validation.shown(returned)}; pass vectorized=False if it takes "
                    "one point at a time."
                )
            values = validation.float64(array)
            values = values.copy() if values is array else values
        if values.shape != (n,):
            raise ValueError(
                f"the function must return an array of shape ({n},) for an array of {n} "
                f"points, got shape {values.shape}; reduce over the last axis, or pass "
                "vectorized=False if it takes one point at a time."
            )
        return values

    def _of_one(self, point: FloatArray) -> float:
        returned = self.function(point)
        array = validation.as_array(returned)
        if array is None or array.size != 1 or array.dtype.kind not in "iufb":
            raise ValueError(
                "the function must return one real number for a point, got "
                f"{validation.shown(returned)}; leave vectorized=True if it takes an "
                "array of points."
            )
        return float(validation.float64(array).reshape(()))


def _level_of_caller() -> int:
    """The `stacklevel` at which `warnings.warn` names a line outside of this package."""
    level, frame = 1, sys._getframe(1)
    above: FrameType | None = frame
    while above is not None and above.f_code.co_filename.startswith(_PACKAGE):
        level, above = level + 1, above.f_back
    return level
