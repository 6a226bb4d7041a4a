"""Round obstacles, which repel agents and which they do not enter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acl_gym.swarm.aggregation.profiles import for_each
from acl_gym.swarm.rows import checked_positions
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray

MOST_TURNS = 60
"""How often an agent between obstacles that overlap is put outside one of them."""

EPSILON = float(np.finfo(np.float64).eps)

TOUCHING = 1.0 - 1e-9
"""Ways whose distance from the middle is a larger share of the radius only touch."""


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
        inside = np.empty(len(x), dtype=np.bool_)
        _any_inside(x, self.centres, np.asarray(self.radii), inside)
        return inside

    def stop(
        self, positions: FloatArray, before: FloatArray | None = None
    ) -> BoolArray:
        """Put agents that have entered an obstacle back to its edge, in place.

        With the positions before a motion, which is along a straight line, nobody jumps
        through an obstacle that is smaller than a step. An agent that ends inside an
        obstacle slides along its edge: it is put to the point of the edge that is nearest
        to where it would be. One whose way leads through an obstacle, or beyond its
        middle, stops where it would enter. One that finds no place between obstacles that
        overlap stays where it was before.

        Args:
            positions: `(n, dim)`, a float64 array that can be written to.
            before: where they were, `(n, dim)`, outside all obstacles; None: not known.

        Returns:
            Which agents are stopped, `(n,)`; no agent is inside any more.

        Raises:
            TypeError: `positions` cannot be changed in place.
            ValueError: an array does not have the axes of the obstacles.
        """
        if (
            not isinstance(positions, np.ndarray)
            or positions.dtype != np.float64
            or not positions.flags.writeable
        ):
            raise TypeError(
                "positions must be a float64 array that can be written to, because agents "
                f"are moved in place, got {validation.shown(positions)}; pass "
                "np.array(positions, dtype=float)."
            )
        self._checked(positions)
        radii = np.asarray(self.radii)
        stopped = np.zeros(len(positions), dtype=np.bool_)
        if before is None:
            put_outside(positions, self.centres, radii, stopped)
            return stopped
        earlier = self._checked(before)
        if earlier.shape != positions.shape:
            raise ValueError(
                f"before must have the shape of positions, {positions.shape}, got "
                f"{earlier.shape}."
            )
        stop_on_the_way(earlier, positions, self.centres, radii, stopped)
        return stopped

    def _checked(self, positions: FloatArray) -> FloatArray:
        x = validation.as_array(positions)
        dim = np.shape(self.centres)[1]
        if x is None or x.ndim != 2 or x.shape[1] != dim:
            got = validation.shown(positions) if x is None else f"shape {x.shape}"
            raise ValueError(
                f"positions must have {dim} coordinates each, as the obstacles have, "
                f"got {got}."
            )
        return checked_positions(x)


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
def _any_inside(
    positions: FloatArray, centres: FloatArray, radii: FloatArray, inside: BoolArray
) -> None:
    for i in range(positions.shape[0]):
        inside[i] = False
        for k in range(radii.size):
            inside[i] |= _distance(positions[i], centres[k]) < radii[k]


@njit
def put_outside(
    positions: FloatArray, centres: FloatArray, radii: FloatArray, moved: BoolArray
) -> None:
    """Put positions `(n, dim)` inside circles to their edges; mark them in `moved`.

    Where circles overlap this is repeated, a little farther from the edge each time.
    """
    for i in range(positions.shape[0]):
        for turn in range(MOST_TURNS):
            inside = False
            for k in range(radii.size):
                if _distance(positions[i], centres[k]) < radii[k]:
                    inside = moved[i] = True
                    _put_to_edge(positions[i], centres[k], radii[k], turn)
            if not inside:
                break


@njit
def stop_on_the_way(
    before: FloatArray,
    positions: FloatArray,
    centres: FloatArray,
    radii: FloatArray,
    stopped: BoolArray,
) -> None:
    """Stop agents on their way from `before` to `positions`; see `Obstacles.stop`."""
    n, dim = positions.shape
    slid = np.empty(radii.size, np.bool_)  # along which circles an agent has slid
    entry = np.empty(dim)
    for i in range(n):
        slid[:] = False
        for turn in range(MOST_TURNS + 1):
            first, hit = np.inf, -1
            for k in range(radii.size):
                share = _entry(before[i], positions[i], centres[k], radii[k], slid[k])
                if share < first:
                    first, hit = share, k
            if hit < 0:
                break
            stopped[i] = True
            if turn == MOST_TURNS:
                positions[i] = before[i]
                break
            in_front = 0.0
            for axis in range(dim):
                start = before[i, axis]
                entry[axis] = start + first * (positions[i, axis] - start)
                in_front += (entry[axis] - centres[hit, axis]) * (
                    positions[i, axis] - centres[hit, axis]
                )
            within = _distance(positions[i], centres[hit]) < radii[hit]
            if within and (slid[hit] or in_front > 0.0):
                slid[hit] = True
            else:
                positions[i] = entry
            if _distance(positions[i], centres[hit]) < radii[hit]:
                _put_to_edge(positions[i], centres[hit], radii[hit], turn)


@njit
def _entry(
    before: FloatArray,
    after: FloatArray,
    centre: FloatArray,
    radius: float,
    only_the_end: bool,
) -> float:
    """At which share of the way a circle is entered, in [0, 1]; infinity: nowhere.

    A way that only touches the edge enters nothing, whatever rounding makes of it.
    """
    ahead = length = 0.0
    for axis in range(before.size):
        d = after[axis] - before[axis]
        ahead -= (before[axis] - centre[axis]) * d
        length += d * d
    nearest_share = 0.0
    if length > 0.0 and ahead > 0.0:
        nearest_share = min(1.0, ahead / length)
    square = 0.0  # of the distance of the line from the middle
    if length > 0.0:
        for axis in range(before.size):
            d = after[axis] - before[axis]
            y = before[axis] + ahead / length * d - centre[axis]
            square += y * y
    inside = _distance(after, centre) < radius
    if not inside:
        passes = 0.0 < nearest_share < 1.0 and np.sqrt(square) < radius * TOUCHING
        if only_the_end or not passes:
            return np.inf
    if length == 0.0 or ahead <= 0.0 or np.sqrt(square) >= radius:
        return 1.0
    back = np.sqrt(max(0.0, radius * radius - square) / length)
    return float(max(0.0, min(1.0, ahead / length - back)))


@njit
def _put_to_edge(
    position: FloatArray, centre: FloatArray, radius: float, turn: int
) -> None:
    """Put a position inside a circle to its edge, never inside by rounding.

    Args:
        position: is changed.
        centre: of the circle.
        radius: of the circle.
        turn: how often this was tried; each time the distance kept from the edge doubles,
            so that a gap between circles is found in the end.
    """
    distance = _distance(position, centre)
    direction = np.zeros(position.size)
    direction[0] = 1.0  # in the middle any one is as good
    if distance > 0.0:
        for axis in range(position.size):
            direction[axis] = (position[axis] - centre[axis]) / distance
    margin = 0.0 if turn == 0 else EPSILON * 2.0**turn
    while True:
        for axis in range(position.size):
            position[axis] = centre[axis] + direction[axis] * (radius * (1.0 + margin))
        if not _distance(position, centre) < radius:
            break
        margin = max(EPSILON, 2.0 * margin)


@njit
def _distance(one: FloatArray, other: FloatArray) -> float:
    square = 0.0
    for axis in range(one.size):
        y = one[axis] - other[axis]
        square += y * y
    return math.sqrt(square)
