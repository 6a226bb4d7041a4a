"""How bodies move: kinematic particles, (6.4), and point masses."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from acl_gym.swarm.aggregation.interaction import Parameter
from acl_gym.swarm.rows import all_finite, per_agent
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray


class Particles(ABC):
    """The state transition g of the particles, Definition 6.5.

    Attributes:
        variables: how many state variables there are for each coordinate: the position,
            and perhaps the velocity.
    """

    variables: int

    def check(self, n: int) -> None:  # noqa: B027
        """Check that the parameters are those of n agents; by default nothing.

        Args:
            n: the number of agents, >= 1.

        Raises:
            ValueError: a parameter has values for another number of agents.
        """

    @abstractmethod
    def advance(self, x: FloatArray, u: FloatArray, time_step: float) -> FloatArray:
        """The states after a step in which the inputs are held constant.

        Args:
            x: states, `(n, variables * dim)`: the position, then the velocity.
            u: inputs, `(n, dim)`.
            time_step: s, > 0.

        Returns:
            A new array of the shape of `x`.

        Raises:
            TypeError: `time_step` is not a number.
            ValueError: it is out of range, a state or an input is not finite, or states,
                inputs and parameters are not those of as many agents.
        """


@dataclass(frozen=True, eq=False, kw_only=True)
class Kinematic(Particles):
    """Particles that move at the velocity that they are given, dx/dt = u, (6.4).

    Since the input is held constant over a step, x + u * time_step is exact.

    Attributes:
        max_speed: a velocity of a larger norm is shortened to it, > 0, one for all
            agents or one for each; infinity by default.

    Raises:
        ValueError: it is out of range.
    """

    variables = 1

    max_speed: Parameter = math.inf

    def __post_init__(self) -> None:
        _set(self, "max_speed", infinite=True)

    def check(self, n: int) -> None:
        """See `Particles.check`."""
        _check_sizes(self, ("max_speed",), n)

    def advance(self, x: FloatArray, u: FloatArray, time_step: float) -> FloatArray:
        """See `Particles.advance`."""
        x, u = _checked(self, x, u, time_step)
        with np.errstate(over="ignore"):  # `Field` refuses positions that are infinite
            return np.asarray(x + time_step * shortened(u, self.max_speed))


@dataclass(frozen=True, eq=False, kw_only=True)
class PointMass(Particles):
    """Particles with inertia: m dv/dt = u - D v, dx/dt = v, u being a force.

    A step is the exact solution for a constant force, so that large steps are stable.

    Attributes:
        mass: m, kg, > 0, one for all agents or one for each.
        damping: D, kg/s, >= 0, likewise.
        max_force: a force of a larger norm is shortened to it, > 0, likewise; infinity
            by default.

    Raises:
        ValueError: an attribute is out of range.
    """

    variables = 2

    mass: Parameter = 1.0
    damping: Parameter = 1.0
    max_force: Parameter = math.inf

    def __post_init__(self) -> None:
        _set(self, "mass")
        _set(self, "damping", or_zero=True)
        _set(self, "max_force", infinite=True)

    def check(self, n: int) -> None:
        """See `Particles.check`."""
        _check_sizes(self, ("mass", "damping", "max_force"), n)

    def advance(self, x: FloatArray, u: FloatArray, time_step: float) -> FloatArray:
        """See `Particles.advance`."""
        x, u = _checked(self, x, u, time_step)
        n, dim = u.shape
        force = shortened(u, self.max_force)
        moved = np.empty((n, 2 * dim))
        mass, damping = (
            np.array(np.broadcast_to(each, n)) for each in (self.mass, self.damping)
        )
        move_masses(x, force, mass, damping, time_step, moved)
        return moved


def shortened(vectors: FloatArray, longest: Parameter) -> FloatArray:
    """Return vectors `(n, dim)`, those that are longer than allowed shortened.

    Args:
        vectors: finite.
        longest: the largest norm, > 0, one for all or one for each.

    Raises:
        ValueError: there are others than one or n of these.
    """
    limit = np.asarray(longest)
    _check_size("longest", limit, len(vectors))
    if limit.ndim == 0 and limit == math.inf:
        return vectors
    short = np.empty(vectors.shape)
    _shorten(vectors, limit.reshape(-1), short)
    return short


@njit
def _shorten(vectors: FloatArray, limits: FloatArray, short: FloatArray) -> None:
    """Write vectors of at most the norm `limits[i]`, or `limits[0]`, into `short`."""
    n, dim = vectors.shape
    for i in range(n):
        limit = limits[i] if limits.size == n else limits[0]
        largest = 0.0
        for k in range(dim):
            largest = max(largest, abs(vectors[i, k]))
        scale, square = 1.0, 0.0
        if largest > 0.0:
            # Divided by the largest coordinate, none has a square that overflows.
            for k in range(dim):
                square += (vectors[i, k] / largest) ** 2
            norm = np.sqrt(square)
            if norm > limit / largest:
                scale = limit / largest / norm
        for k in range(dim):
            short[i, k] = vectors[i, k] * scale


@njit
def move_masses(
    x: FloatArray,
    force: FloatArray,
    mass: FloatArray,
    damping: FloatArray,
    time_step: float,
    moved: FloatArray,
) -> None:
    """The exact step of `PointMass`, from `x` to `moved`, both `(n, 2 dim)`."""
    n, dim = force.shape
    for i in range(n):
        lag = damping[i] * time_step / mass[i]
        decay = np.exp(-lag)
        if lag < 1e-2:
            # Taylor series: the formulas below would subtract nearly equal numbers.
            of_speed = 1.0 - lag / 2.0 * (
                1.0
                - lag / 3.0 * (1.0 - lag / 4.0 * (1.0 - lag / 5.0 * (1.0 - lag / 6.0)))
            )
            of_force = 0.5 * (
                1.0
                - lag
                / 3.0
                * (
                    1.0
                    - lag
                    / 4.0
                    * (1.0 - lag / 5.0 * (1.0 - lag / 6.0 * (1.0 - lag / 7.0)))
                )
            )
        else:
            of_speed = -np.expm1(-lag) / lag
            of_force = (1.0 - of_speed) / lag
        push = time_step / mass[i]
        for k in range(dim):
            speed = x[i, dim + k]
            moved[i, k] = x[i, k] + time_step * (
                of_speed * speed + of_force * push * force[i, k]
            )
            moved[i, dim + k] = decay * speed + of_speed * push * force[i, k]


def _check_size(name: str, array: FloatArray, n: int) -> None:
    """Check that there is one number for all of n agents, or one for each."""
    if array.shape not in ((), (n,)):
        raise ValueError(
            f"{name} must be a number, or one for each of the {n} agents, got an array "
            f"of shape {array.shape}."
        )


def _check_sizes(particles: Particles, names: tuple[str, ...], n: int) -> None:
    for name in names:
        _check_size(name, np.asarray(getattr(particles, name)), n)


def _checked(
    particles: Particles, x: FloatArray, u: FloatArray, time_step: float
) -> tuple[FloatArray, FloatArray]:
    """States and inputs of as many agents as the parameters, in C order."""
    if type(time_step) is not float or not 0.0 < time_step < math.inf:
        validation.number("time_step", time_step, above=0)
    states, inputs = _numbers("x", x), _numbers("u", u)
    if inputs.ndim != 2:
        raise ValueError(
            f"u must have shape (n, dim), a row for each agent, got {inputs.shape}."
        )
    n, dim = inputs.shape
    if states.shape != (n, particles.variables * dim):
        raise ValueError(
            f"x must have shape ({n}, {particles.variables * dim}), {particles.variables} "
            f"for each input, got {states.shape}."
        )
    particles.check(n)
    return states, inputs


def _numbers(name: str, values: FloatArray) -> FloatArray:
    """Finite numbers as kernels take them, not copied if they are so already."""
    array = validation.as_array(values)
    if array is not None and array.dtype.kind in "iuf":
        rows = validation.float64(array)
        if all_finite(rows):
            return rows
    raise ValueError(
        f"{name} must be an array of finite real numbers, got "
        f"{validation.shown(values)}."
    )


def _set(
    particles: Particles, name: str, *, or_zero: bool = False, infinite: bool = False
) -> None:
    """Check a parameter > 0 and keep it as an array that cannot be changed."""
    end = {"at_least": 0.0} if or_zero else {"above": 0.0}
    given = getattr(particles, name)
    array = per_agent(name, given, None, infinite=infinite, **end)
    object.__setattr__(particles, name, validation.read_only(array))
