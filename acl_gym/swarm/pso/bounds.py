"""Where a swarm searches, and what happens to particles that would leave."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import Bounds

from acl_gym.swarm.pso import kernels
from acl_gym.swarm.rows import FARTHEST
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

BOUNDARIES = {
    "none": kernels.NONE,
    "clip": kernels.CLIP,
    "absorb": kernels.ABSORB,
    "reflect": kernels.REFLECT,
}
"""What `boundary=` may be, see `Landscape`."""


@dataclass(frozen=True)
class SearchSpace:
    """The range of each of d variables.

    Attributes:
        lower: `(d,)`, may be -inf.
        upper: `(d,)`, may be inf; where it equals `lower`, the variable is fixed.
    """

    lower: FloatArray
    upper: FloatArray

    @cached_property
    def d(self) -> int:
        """The number of variables."""
        return self.lower.size

    def initial_velocities(
        self, positions: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Return half the way from each position to a point drawn within the bounds.

        Args:
            positions: `(n, d)`.
            rng: draws the points, uniformly.

        Returns:
            `(n, d)`; 0 for variables whose bounds are not finite.
        """
        finite = np.isfinite(self.upper - self.lower)
        lower, width = self.lower[finite], (self.upper - self.lower)[finite]
        velocities = np.zeros(positions.shape)
        points = lower + width * rng.random((len(positions), lower.size))
        velocities[:, finite] = 0.5 * (points - positions[:, finite])
        return velocities

    def initial_positions(
        self, n: int, x0: ArrayLike | None, rng: np.random.Generator
    ) -> FloatArray:
        """Return where n particles begin: the first at `x0`, the others anywhere.

        Args:
            n: number of particles.
            x0: `(d,)`, or `(m, d)` with m <= n, within the bounds; None: no point.
            rng: draws the other positions, uniformly within the bounds.

        Returns:
            `(n, d)`.

        Raises:
            ValueError: `x0` are not such points, or positions are to be drawn between
                bounds that are infinite.
        """
        given = self._points(n, x0)
        drawn = n - len(given)
        if drawn and not np.isfinite([self.lower, self.upper]).all():
            k = int(np.flatnonzero(~np.isfinite(self.upper - self.lower))[0])
            raise ValueError(
                "bounds must be finite where positions are drawn, got "
                f"({self.lower[k]:g}, {self.upper[k]:g}) for variable {k}; give finite "
                f"bounds, or x0 as an array of {n} points, one for each particle."
            )
        if not drawn:
            return given
        share = rng.random((drawn, self.d))
        positions = self.lower + (self.upper - self.lower) * share
        return np.vstack([given, np.minimum(positions, self.upper)])

    def _points(self, n: int, x0: ArrayLike | None) -> FloatArray:
        if x0 is None:
            return np.empty((0, self.d))
        points = np.atleast_2d(validation.real_array("x0", x0))
        if points.ndim != 2 or points.shape[1] != self.d or len(points) > n:
            raise ValueError(
                f"x0 must be a point of {self.d} variables, or at most {n} of them as "
                f"an array of shape (m, {self.d}), got shape {np.shape(x0)}."
            )
        if np.abs(points).max() > FARTHEST:
            raise ValueError(
                f"x0 must lie within {FARTHEST:g} of 0, got "
                f"{np.abs(points).max():g}; choose other units."
            )
        outside = (points < self.lower) | (points > self.upper)
        if outside.any():
            row, k = (int(each) for each in np.argwhere(outside)[0])
            raise ValueError(
                f"x0 must lie within the bounds, got {points[row, k]:g} for variable {k} "
                f"of point {row}, whose bounds are ({self.lower[k]:g}, "
                f"{self.upper[k]:g}); change x0 or widen the bounds."
            )
        return points


def search_space(bounds: Any) -> SearchSpace:
    """Check bounds.

    Args:
        bounds: a pair (lower, upper) for each variable, or `scipy.optimize.Bounds`.

    Raises:
        ValueError: they are neither, a lower bound exceeds its upper bound, or a finite
            one is farther away than `FARTHEST`.
    """
    if isinstance(bounds, Bounds):
        bounds = np.column_stack(np.broadcast_arrays(bounds.lb, bounds.ub))
    array = validation.real_array("bounds", bounds, finite=False)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(
            "bounds must be a pair (lower, upper) for each variable, got an array of "
            f"shape {array.shape}; for two variables from 0 to 1 pass [(0, 1), (0, 1)]."
        )
    lower, upper = array.T.copy()
    ordered = (lower <= upper) & (lower < np.inf) & (upper > -np.inf)  # NaN neither
    for bound in (lower, upper):
        ordered &= (np.abs(bound) <= FARTHEST) | np.isinf(bound)
    if not ordered.all():
        k = int(np.flatnonzero(~ordered)[0])
        raise ValueError(
            "bounds must have lower <= upper, neither of them NaN, and those that are "
            f"finite within {FARTHEST:g} of 0, got ({lower[k]:g}, {upper[k]:g}) for "
            f"variable {k}."
        )
    return SearchSpace(lower, upper)
