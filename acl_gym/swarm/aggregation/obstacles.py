"""Round obstacles, which repel agents and which they do not enter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acl_gym.swarm.aggregation.profiles import for_each
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Circles, or balls, with a repulsive potential around them.

    The potential of one is U(x) = (k / 2) max(0, reach - rho)^2, where rho is the
    distance from its edge, < 0 inside. It pushes agents away with the force
    k (reach - rho), which has a bound, unlike the classic potential 1 / rho (Khatib,
    1986): steps of a simulation do not throw agents far away. An agent that comes to
    the edge all the same is stopped there.

    Attributes:
        centres: `(count, dim)`.
        radii: > 0, one for each or one for all.
        strength: k, >= 0.
        reach: how far from the edge the repulsion begins, >= 0.

    Raises:
        ValueError: an attribute is out of range, or there is not one for each centre.
    """

    centres: FloatArray
    radii: float | FloatArray
    strength: float = 20.0
    reach: float = 0.5

    def __post_init__(self) -> None:
        centres = validation.real_array("centres", self.centres, ndim=2)
        radii = for_each("radii", self.radii, len(centres))
        if (radii <= 0).any():
            raise ValueError(f"radii must be > 0, got {radii.min():g}.")
        object.__setattr__(self, "centres", validation.read_only(centres))
        object.__setattr__(self, "radii", validation.read_only(radii))
        for name in ("strength", "reach"):
            checked = validation.number(name, getattr(self, name), at_least=0)
            object.__setattr__(self, name, checked)

    def gradient(self, positions: FloatArray) -> FloatArray:
        """grad U of all obstacles together, `(n, dim)`, at `(n, dim)` positions."""
        x = self._checked(positions)
        gradient = np.empty_like(x)
        radii = np.asarray(self.radii)
        _slope(x, self.centres, radii, self.strength, self.reach, gradient)
        return gradient

    def value(self, positions: FloatArray) -> FloatArray:
        """U of all obstacles together, `(n,)`, at `(n, dim)` positions."""
        x = self._checked(positions)
        distance = np.linalg.norm(x[:, None] - np.asarray(self.centres), axis=-1)
        depth = np.maximum(0.0, self.reach - (distance - self.radii))
        return np.asarray(0.5 * self.strength * np.square(depth).sum(axis=-1))

    def inside(self, positions: FloatArray) -> BoolArray:
        """Whether each of `(n, dim)` positions lies inside an obstacle, `(n,)`."""
        x = self._checked(positions)
        distance = np.linalg.norm(x[:, None] - np.asarray(self.centres), axis=-1)
        return np.asarray((distance < self.radii).any(axis=-1))

    def stop(self, positions: FloatArray) -> BoolArray:
        """Put agents that have entered an obstacle back to its edge, in place.

        Args:
            positions: `(n, dim)`, float64.

        Returns:
            Which agents are stopped, `(n,)`.
        """
        stopped = np.zeros(len(positions), dtype=np.bool_)
        stop_at_edges(positions, self.centres, np.asarray(self.radii), stopped)
        return stopped

    def _checked(self, positions: FloatArray) -> FloatArray:
        x = np.ascontiguousarray(positions, dtype=np.float64)
        dim = np.shape(self.centres)[1]
        if x.ndim != 2 or x.shape[1] != dim:
            raise ValueError(
                f"positions must have {dim} coordinates each, as the obstacles have, "
                f"got an array of shape {x.shape}."
            )
        return x


@njit
def _slope(
    positions: FloatArray,
    centres: FloatArray,
    radii: FloatArray,
    strength: float,
    reach: float,
    gradient: FloatArray,
) -> None:
    n, dim = positions.shape
    for i in range(n):
        gradient[i] = 0.0
        for k in range(radii.size):
            distance = _distance(positions[i], centres[k])
            overlap = reach - (distance - radii[k])
            # In the middle there is no direction to push to.
            if overlap > 0.0 and distance > 0.0:
                for axis in range(dim):
                    y = positions[i, axis] - centres[k, axis]
                    gradient[i, axis] -= strength * overlap * y / distance


@njit
def stop_at_edges(
    positions: FloatArray, centres: FloatArray, radii: FloatArray, stopped: BoolArray
) -> None:
    """Put positions `(n, dim)` inside circles to their edges; mark them in `stopped`.

    The circles take turns, so that an agent may be left inside one of several that
    overlap.
    """
    n, dim = positions.shape
    for i in range(n):
        for k in range(radii.size):
            distance = _distance(positions[i], centres[k])
            if distance >= radii[k]:
                continue
            stopped[i] = True
            for axis in range(dim):
                y = positions[i, axis] - centres[k, axis]
                if distance > 0.0:
                    y *= radii[k] / distance
                else:  # in the middle any direction is as good
                    y = radii[k] if axis == 0 else 0.0
                positions[i, axis] = centres[k, axis] + y


@njit
def _distance(one: FloatArray, other: FloatArray) -> float:
    square = 0.0
    for axis in range(one.size):
        y = one[axis] - other[axis]
        square += y * y
    return float(np.sqrt(square))
