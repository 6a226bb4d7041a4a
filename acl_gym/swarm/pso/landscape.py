"""The environment of particle swarm optimization: particles in a fitness landscape."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.protocols import Environment
from acl_gym.swarm.pso import kernels
from acl_gym.swarm.pso.bounds import BOUNDARIES, search_space
from acl_gym.swarm.pso.coefficients import INERTIA, ORDERS, Inertia, of_each_particle
from acl_gym.swarm.pso.objective import Objective
from acl_gym.swarm.rows import FARTHEST
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_FLOAT64 = np.dtype(np.float64)


class ExplosionError(ValueError, OverflowError):
    """A particle is farther away than 1e150, or its velocity larger than floats can be."""


class Landscape(Environment):
    """Particles that move through a fitness landscape F(theta), §6.3.2.

    The state of particle i is x_i = [theta_i, nu_i], its position and its velocity. The
    dynamic agent adds u_i to the velocity, and the particle moves:

        nu(k + 1) = w(k) nu(k) + u(k)                            as in (6.2) and (6.3)
        theta(k + 1) = theta(k) + nu(k + 1)                      order="standard"
        theta(k + 1) = theta(k) + nu(k)                          order="literal", (6.1)

    The thesis prints the second one. Everybody else uses the first, and for a reason:
    with the old velocity a swarm is stable for far smaller accelerations only, and with
    the usual ones it explodes, or, within bounds, does not converge
    (`acl_gym.swarm.pso.stability`).

    The process is the function F itself, which does not change. F is a cost here: the
    lower, the better, where the thesis maximizes a fitness.

    Args:
        function: F, of an array of points `(n, d)`; returns their values, `(n,)`. It may
            return infinity, which is worse than every number; NaN counts as infinity,
            with one warning.
        bounds: a pair (lower, upper) for each variable, or `scipy.optimize.Bounds`. A
            variable whose bounds are equal is fixed. Bounds may be infinite if `x0` says
            where every particle begins.
        n_particles: N, >= 1.
        x0: where the first particle begins, `(d,)`, or the first m, `(m, d)`; the others
            begin uniformly distributed within the bounds. All begin with half the way to
            another such point as their velocity, which is 0 for variables whose bounds
            are not finite: a particle at rest that hears nobody would never move.
        inertia: w, the share of its velocity that a particle keeps: a number, one for
            each particle, or a function of k = 0, 1, .. that returns either, such as
            `acl_gym.Linear(0.9, 0.4, 1000)`.
        boundary: what happens to a variable that would leave its bounds:
            `"reflect"`: position and velocity are mirrored at the bound, as often as
            needed, so that the particle flies back as fast as it came;
            `"absorb"`: the position becomes the bound, and that velocity 0;
            `"clip"`: the position becomes the bound, and the velocity stays as it is, so
            that the particle stays there until it is attracted back;
            `"none"`: nothing. Bounds then only say where particles begin, and F is
            evaluated outside as well, up to 1e150: squares of such numbers are finite.
        velocity_limit: the largest absolute velocity, > 0, a number or `(d,)`; None: no
            limit.
        order: which velocity a particle moves with, see above.
        vectorized: whether `function` takes many points at once. If not, it is called
            with one point `(d,)` at a time and returns a number. Where there are as many
            particles as variables, a function of one point can be mistaken for one of
            many: such a function is given one point more in its first call, which is not
            counted.

    Attributes:
        x: [theta, nu], `(n, 2 d)`.
        objective: F, which counts its evaluations.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        bounds: Any,
        *,
        n_particles: int = 40,
        x0: ArrayLike | None = None,
        inertia: Inertia = INERTIA,
        boundary: str = "reflect",
        velocity_limit: ArrayLike | None = None,
        order: str = "standard",
        vectorized: bool = True,
    ) -> None:
        self.objective = Objective(function, vectorized)
        self.space = search_space(bounds)
        self.n_particles = validation.integer("n_particles", n_particles, at_least=1)
        validation.check_memory(
            f"{self.n_particles:,} particles in {self.space.d:,} variables",
            # Their states, bests, inputs and random numbers, and some copies.
            100 * self.n_particles * self.space.d,
            "use fewer particles",
        )
        self.x0 = None if x0 is None else validation.real_array("x0", x0)
        self.inertia = inertia
        self._w = self._inertia_at(0)
        self.boundary = validation.one_of("boundary", boundary, BOUNDARIES)
        self.velocity_limit = _limits(velocity_limit, self.space.d)
        self.order = validation.one_of("order", order, ORDERS)
        # Bad points are found at once, not when the run begins.
        self.space.initial_positions(
            self.n_particles, self.x0, np.random.default_rng(0)
        )

    @property
    def positions(self) -> FloatArray:
        """theta, `(n, d)`."""
        return self.x[:, : self.space.d]

    @property
    def velocities(self) -> FloatArray:
        """nu, `(n, d)`."""
        return self.x[:, self.space.d :]

    def reset(self, rng: np.random.Generator) -> None:
        """Draw initial positions and velocities; see `Environment.reset`."""
        positions = self.space.initial_positions(self.n_particles, self.x0, rng)
        velocities = self.space.initial_velocities(positions, rng)
        limit = self.velocity_limit
        self.x = np.hstack([positions, np.clip(velocities, -limit, limit)])
        self.iteration = 0

    def observe(self) -> dict[str, FloatArray]:
        """Evaluate F where the particles are: y_i = [F(theta_i), theta_i].

        Returns:
            `value`, F(theta), `(n,)`, and `position`, theta, `(n, d)`.
        """
        return self.evaluate(slice(None))

    def evaluate(self, rows: slice) -> dict[str, FloatArray]:
        """Observe some particles, see `observe`.

        Args:
            rows: which.
        """
        position = self.positions[rows].copy()
        return {"value": self.objective(position), "position": position}

    def step(self, u: FloatArray, rng: np.random.Generator) -> None:
        """Move all particles by one iteration.

        Args:
            u: what the agents add to the velocities, `(n, d)`.
            rng: not used, because the motion is deterministic.

        Raises:
            ValueError: `u` are not numbers of this shape.
            ExplosionError: a position is farther away than 1e150, or a velocity larger
                than a float can hold.
        """
        shape = (self.n_particles, self.space.d)
        given = validation.as_array(u)
        if given is None or given.dtype.kind not in "biuf":
            raise ValueError(
                f"u must be real numbers of the shape {shape}, a row for each particle, "
                f"got {validation.shown(u)}."
            )
        u = validation.float64(given)
        if u.shape == shape and np.isnan(u).any():
            particle = int(np.flatnonzero(np.isnan(u).any(axis=1))[0])
            raise ValueError(
                f"u must be numbers, got NaN for particle {particle}; look at what the "
                "agents decide, such as accelerations that are too large."
            )
        _check_shape(u, shape)
        self.begin_iteration()
        self.move(slice(None), u)

    def begin_iteration(self) -> None:
        """Set the inertia w(k) of the iteration that begins, and count it."""
        if callable(self.inertia):
            self._w = self._inertia_at(self.iteration)
        self.iteration += 1

    def move(self, rows: slice, u: FloatArray) -> None:
        """Move some particles.

        Args:
            rows: which.
            u: their inputs, one row for each.

        Raises:
            ValueError: `u` or `x` is of another shape.
            ExplosionError: see `step`.
        """
        w, d = self._w[rows], self.space.d
        _check_shape(u, (w.size, d))
        shape = (self.n_particles, 2 * d)
        if (
            type(self.x) is not np.ndarray
            or self.x.shape != shape
            or self.x.dtype != _FLOAT64
            or not self.x.flags.writeable
        ):
            raise ValueError(
                f"x must be a float64 array of shape {shape} that can be written to, got "
                f"{validation.shown(self.x)}; change entries of x, or assign "
                "np.array(x, dtype=float)."
            )
        x = self.x[rows]
        finite = kernels.move(
            x,
            u,
            w,
            self.space.lower,
            self.space.upper,
            BOUNDARIES[self.boundary],
            self.velocity_limit,
            self.order == "literal",
            FARTHEST,
        )
        if not finite:
            held = (np.abs(x[:, :d]) <= FARTHEST) & np.isfinite(x[:, d:])
            particle = (rows.start or 0) + int(held.all(axis=1).argmin())
            raise ExplosionError(
                f"positions must stay within {FARTHEST:g} and velocities finite, but the "
                f"swarm has exploded in iteration {self.iteration}, first seen at "
                f"particle {particle}; use "
                "order='standard', a smaller inertia or acceleration "
                "(acl_gym.swarm.pso.is_stable tells which), bounds or a velocity_limit."
            )

    def _inertia_at(self, k: int) -> FloatArray:
        value = self.inertia(k) if callable(self.inertia) else self.inertia
        return of_each_particle("inertia", value, self.n_particles)


def _check_shape(u: FloatArray, shape: tuple[int, int]) -> None:
    if u.shape != shape:
        raise ValueError(
            f"u must have the shape {shape}, a row for each particle, got {u.shape}."
        )


def _limits(limit: ArrayLike | None, d: int) -> FloatArray:
    """The largest absolute velocity of each variable, `(d,)`."""
    if limit is None:
        return np.full(d, np.inf)
    limits = validation.real_array("velocity_limit", limit, finite=False)
    if limits.shape not in ((), (d,)) or not (limits > 0).all():
        raise ValueError(
            f"velocity_limit must be a number > 0, or {d} of them, one for each "
            f"variable, got {validation.shown(limit)}."
        )
    return np.full(d, limits)
