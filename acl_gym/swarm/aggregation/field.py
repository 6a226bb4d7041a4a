"""The environment of an aggregating swarm: bodies in a field with food and obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.aggregation.obstacles import Obstacles
from acl_gym.swarm.aggregation.particles import Kinematic, Particles
from acl_gym.swarm.aggregation.profiles import Profile, checked_gradient
from acl_gym.swarm.protocols import Environment
from acl_gym.swarm.rows import FARTHEST, all_finite, checked_positions, checked_rows
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

MOST_DRAWS = 1_000
"""How often a start inside an obstacle is drawn anew."""

_ARRAYS = 8
"""Arrays of the size of the positions that a step makes, or keeps."""


class Field(Environment):
    """Particles in a plane or a space, with a profile and obstacles.

    The process of Definition 6.4 is virtual here: the artificial potential field of the
    profile and the obstacles, which does not change.

    Agents observe, each for itself: `"position"`, `"velocity"` where particles have one,
    and `"slope"`, the gradient of the profile and of the obstacles' potential where they
    are.

    Args:
        start: initial positions `(n, dim)`; or the number of agents n, whose positions
            are then drawn uniformly from `bounds`, outside of the obstacles.
        particles: how bodies move; None takes `Kinematic()`.
        time_step: s, > 0.
        profile: what the swarm feeds on; None: nothing.
        obstacles: what stands in the way; None: nothing.
        bounds: lowest and highest coordinates of positions that are drawn, the same for
            all `dim` axes.
        dim: the number of axes where positions are drawn, >= 1.

    Attributes:
        x: states, `(n, dim)` of kinematic particles, `(n, 2 dim)` of point masses, which
            start at rest.
        time: s, since the last `reset`.

    Raises:
        TypeError: an argument is of the wrong kind.
        ValueError: an argument is out of range, or an initial position lies inside an
            obstacle.
    """

    def __init__(
        self,
        start: ArrayLike | int,
        particles: Particles | None = None,
        *,
        time_step: float = 0.01,
        profile: Profile | None = None,
        obstacles: Obstacles | None = None,
        bounds: tuple[float, float] = (-3.0, 3.0),
        dim: int = 2,
    ) -> None:
        self.particles = Kinematic() if particles is None else particles
        for name, part, kind in (
            ("particles", self.particles, Particles),
            ("profile", profile, Profile),
            ("obstacles", obstacles, Obstacles),
        ):
            if part is not None and not isinstance(part, kind):
                raise TypeError(
                    f"{name} must be of a subclass of {kind.__name__}, got "
                    f"{validation.shown(part)}."
                )
        self.time_step = validation.number("time_step", time_step, above=0)
        self.profile, self.obstacles = profile, obstacles
        self._start: FloatArray | None = None
        self._dim = validation.integer("dim", dim, at_least=1)
        self._bounds = _checked_bounds(bounds)
        if validation.as_array(start) is not None and np.ndim(start) == 0:
            self._count = validation.integer("start", start, at_least=1)
        else:
            self._start = _checked_start(start)
            self._count, self._dim = self._start.shape
        validation.check_memory(
            f"{self._count:,} agents with {self._dim:,} coordinates each",
            _ARRAYS * 8 * self._count * self._dim,
            "use fewer",
        )
        validation.integer(
            f"variables of {type(self.particles).__name__}",
            getattr(self.particles, "variables", None),
            at_least=1,
            at_most=2,
        )
        self.particles.check(self._count)
        # Whether the field has as many coordinates as the positions.
        self.slope(np.zeros((self._count, self._dim)), finite=False)
        if self._start is not None and obstacles is not None:
            _check_outside(self._start, obstacles)
        self.time = 0.0

    @property
    def positions(self) -> FloatArray:
        """Where the agents are, `(n, dim)`."""
        return self._known[:, : self._dim]

    @property
    def velocities(self) -> FloatArray | None:
        """How fast they move, `(n, dim)`; None where particles have no velocity."""
        return self._known[:, self._dim :] if self.particles.variables == 2 else None

    @property
    def _known(self) -> FloatArray:
        if not hasattr(self, "x"):
            raise RuntimeError(
                "a Field must be reset before agents have states; call reset(rng), or run."
            )
        return self.x

    def reset(self, rng: np.random.Generator) -> None:
        """Put all agents to their initial positions, at rest."""
        places = self._drawn(rng) if self._start is None else self._start
        self.x = np.zeros((self._count, self.particles.variables * self._dim))
        self.x[:, : self._dim] = places
        self.time = 0.0

    def observe(self) -> dict[str, FloatArray]:
        """What each agent observes, see the class; new arrays."""
        seen = {"position": self.positions.copy(), "slope": self.slope(self.positions)}
        if self.velocities is not None:
            seen["velocity"] = self.velocities.copy()
        return seen

    def step(self, u: Any, rng: np.random.Generator) -> None:
        """Move all agents by one time step; an obstacle stops those that reach it.

        Args:
            u: their inputs, `(n, dim)`: velocities, or forces on point masses.
            rng: is not used.

        Raises:
            ValueError: an input is not a finite number, or a position comes to be none,
                or to be farther away than 1e150.
        """
        inputs = checked_rows("u", u, (self._count, self._dim))
        if not all_finite(inputs):
            agent = int(np.flatnonzero(~np.isfinite(inputs).all(axis=1))[0])
            raise ValueError(
                f"inputs must be finite, got {inputs[agent]} for agent {agent}: agents "
                "may have come too close for b / r^2; take a smaller time_step, or the "
                "bounded repulsion."
            )
        before = self.positions
        moved = self.particles.advance(self.x.copy(), inputs, self.time_step)
        name = f"what {type(self.particles).__name__}.advance returns"
        self.x = np.array(checked_rows(name, moved, self.x.shape))
        checked_positions(self.positions, self._count)
        if self.obstacles is not None:
            stopped = self.obstacles.stop(self.positions, before)
            if self.velocities is not None:
                self.velocities[stopped] = 0.0
        self.time += self.time_step

    def slope(self, positions: FloatArray, *, finite: bool = True) -> FloatArray:
        """The gradient of profile and obstacles together at `(m, dim)` positions.

        Args:
            positions: where.
            finite: whether to refuse gradients that are NaN or infinite.

        Raises:
            ValueError: a gradient has another shape, or is not finite.
        """
        total = np.zeros(np.shape(positions))
        for part in (self.profile, self.obstacles):
            if part is not None:
                total += checked_gradient(part, positions, finite)
        return total

    def _drawn(self, rng: np.random.Generator) -> FloatArray:
        low, high = self._bounds
        places = rng.uniform(low, high, (self._count, self._dim))
        if self.obstacles is None:
            return places
        for _ in range(MOST_DRAWS):
            again = np.flatnonzero(self.obstacles.inside(places))
            if not again.size:
                return places
            places[again] = rng.uniform(low, high, (again.size, self._dim))
        raise ValueError(
            "bounds must leave room beside the obstacles, got "
            f"{validation.shown(self._bounds)}, where {MOST_DRAWS:,} draws found none "
            "for some agents; widen them, or give initial positions."
        )


def _checked_start(start: Any) -> FloatArray:
    array = validation.real_array("start", start, ndim=2)
    if np.abs(array).max() > FARTHEST:
        raise ValueError(
            f"start must hold coordinates of at most {FARTHEST:g}, got "
            f"{np.abs(array).max():g}; use another unit of length."
        )
    return array


def _check_outside(start: FloatArray, obstacles: Obstacles) -> None:
    inside = np.flatnonzero(obstacles.inside(start))
    if inside.size:
        agent = int(inside[0])
        raise ValueError(
            f"start must lie outside the obstacles, got {start[agent]} for agent {agent}; "
            "move it, or let positions be drawn."
        )


def _checked_bounds(bounds: Any) -> tuple[float, float]:
    pair = validation.real_array("bounds", bounds, ndim=1)
    if pair.size != 2 or not -FARTHEST <= pair[0] <= pair[1] <= FARTHEST:
        raise ValueError(
            "bounds must be the lowest and the highest coordinate, both within "
            f"{FARTHEST:g} of 0, got {validation.shown(bounds)}; use another unit of "
            "length if they are larger."
        )
    return float(pair[0]), float(pair[1])
