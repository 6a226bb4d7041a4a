"""How two agents act on each other: attraction and repulsion, (6.5)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import xlogy

from acl_gym.swarm.aggregation.kernels import BOUNDED, UNBOUNDED
from acl_gym.swarm.rows import FARTHEST, per_agent
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_LEAST_SPREAD = 1e-300
"""1 / c is finite."""

Parameter = float | FloatArray
"""One number for all agents, or an array with one for each."""


class Coefficients(NamedTuple):
    """An interaction as kernels take it.

    Attributes:
        kind: `BOUNDED` or `UNBOUNDED`.
        attraction: a of each agent, `(n,)`.
        repulsion: b, `(n,)`.
        rate: 1 / c, `(n,)`; 0 where the repulsion has no c.
    """

    kind: int
    attraction: FloatArray
    repulsion: FloatArray
    rate: FloatArray


class Interaction(ABC):
    """A function g(y) = -y [g_a(|y|) - g_r(|y|)] of the class (6.5), y = x_i - x_j.

    It is what agent j adds to the input u_i of agent i. g_a attracts, g_r repels. Compiled
    kernels sum `BoundedRepulsion` and `UnboundedRepulsion`. A subclass of yours needs
    `net_attraction` only, and NumPy sums it, which is slower.

    Parameters are numbers, or arrays with one value for each agent: then the swarm is
    heterogeneous (Definition 6.8), and agent i moves by the i-th values.

    Example:
        >>> class Constant(Interaction):
        ...     def net_attraction(self, distance):
        ...         return 1.0 - 0.5 / np.maximum(distance, 1e-9)
        >>> Constant()([2.0, 0.0])
        array([-1.5, -0. ])
    """

    @abstractmethod
    def net_attraction(self, distance: ArrayLike) -> FloatArray:
        """g_a - g_r at a distance, > 0 where agents attract each other.

        Args:
            distance: r = |y|, >= 0; `(..., n)` where the parameters are arrays, and
                wherever a swarm of n agents is summed: a distance for each receiver.

        Returns:
            An array of the shape of `distance`; what it holds where r = 0 does not count.
        """

    def __call__(self, y: ArrayLike) -> FloatArray:
        """g(y) of (6.5).

        Args:
            y: x_i - x_j, `(..., dim)`; `(..., n, dim)` where the parameters are arrays.

        Returns:
            An array of the shape of `y`; 0 where y is 0, since two agents in one place
            have no direction to part in.

        Raises:
            ValueError: `y` are not such numbers, or the parameters are for another
                number of agents.
        """
        y = _checked("y", y)
        if y.ndim == 0:
            raise ValueError(
                f"y must have an axis of coordinates, got the number {y:g}; use "
                "net_attraction for a distance."
            )
        distance = np.sqrt(np.square(y).sum(axis=-1))
        net = validation.as_array(self.net_attraction(distance))
        if net is None or net.dtype.kind not in "iuf":
            raise ValueError(
                f"net_attraction of {type(self).__name__} must return numbers, got "
                f"{validation.shown(net)}."
            )
        if net.shape not in ((), distance.shape):
            raise ValueError(
                f"net_attraction of {type(self).__name__} must have the shape of the "
                f"distances, {distance.shape}, got {net.shape}; parameters with one value "
                "for each agent need y with a row for each."
            )
        strength = np.where(distance > 0, net, 0.0)
        return np.asarray(-y * strength[..., None])


class _Summed(Interaction):
    """An interaction that kernels sum: its attraction is a constant, g_a = a, a spring.

    Attributes:
        kind: `BOUNDED` or `UNBOUNDED`.
        attraction: a.
        repulsion: b.
    """

    kind: ClassVar[int]

    attraction: Parameter
    repulsion: Parameter

    @abstractmethod
    def potential(self, distance: ArrayLike) -> FloatArray:
        """V(r), of which g is the descent: g(y) = -grad V(|y|).

        Args:
            distance: r = |y|, >= 0.
        """

    @property
    @abstractmethod
    def rest_distance(self) -> FloatArray:
        """delta, the distance at which two or three agents rest: g_a = g_r.

        0 where the attraction prevails at any distance, infinity where there is none.
        """

    @property
    @abstractmethod
    def _rate(self) -> Parameter:
        """1 / c."""

    def _distances(self, distance: ArrayLike) -> FloatArray:
        """Distances as an array, whose last axis is that of the agents, if they differ."""
        r = _checked("distance", distance)
        if (r < 0.0).any():
            raise ValueError(f"distance must be >= 0, got {r.min():g}.")
        n = max(np.size(each) for each in (self.attraction, self.repulsion, self._rate))
        if n > 1 and r.shape[-1:] not in ((), (1,), (n,)):
            raise ValueError(
                f"distance must be a number or have shape (..., {n}), because the "
                f"parameters have one value for each of {n} agents, got shape {r.shape}."
            )
        return r

    def coefficients(self, n: int) -> Coefficients:
        """The parameters of n agents, for kernels.

        Args:
            n: the number of agents, >= 1.

        Raises:
            ValueError: a parameter has values for another number of agents.
        """
        columns = []
        for name, value in (
            ("attraction", self.attraction),
            ("repulsion", self.repulsion),
            ("spread", self._rate),
        ):
            array = np.asarray(value, dtype=np.float64)
            if array.shape not in ((), (n,)):
                raise ValueError(
                    f"{name} must be a number or have one value for each of the {n} "
                    f"agents, got {array.size} values."
                )
            columns.append(np.array(np.broadcast_to(array, n)))
        return Coefficients(self.kind, *columns)


@dataclass(frozen=True, eq=False, kw_only=True)
class BoundedRepulsion(_Summed):
    """g(y) = -y [a - b exp(-|y|^2 / c)], the bounded repulsion of Gazi and Passino.

    The defaults are those of Gazi and Passino (2003): agents rest 0.774 apart.

    Attributes:
        attraction: a, 1/s for kinematic particles, >= 0.
        repulsion: b, in the unit of a, >= 0. Agents keep a distance where b > a.
        spread: c, the square of a length, >= 1e-300: at the distance sqrt(c) the
            repulsion is b / e.

    Raises:
        ValueError: a parameter is out of range.
    """

    kind = BOUNDED

    attraction: Parameter = 1.0
    repulsion: Parameter = 20.0
    spread: Parameter = 0.2

    def __post_init__(self) -> None:
        _set(self, "attraction")
        _set(self, "repulsion")
        _set(self, "spread", at_least=_LEAST_SPREAD)

    def net_attraction(self, distance: ArrayLike) -> FloatArray:
        """a - b exp(-r^2 / c); see `Interaction.net_attraction`."""
        square = np.square(self._distances(distance))
        with np.errstate(over="ignore"):  # exp(-inf) is 0
            decay = np.exp(-square / self.spread)
        return np.asarray(self.attraction - self.repulsion * decay)

    def potential(self, distance: ArrayLike) -> FloatArray:
        """V(r) = a r^2 / 2 + (b c / 2) exp(-r^2 / c), of which g is the descent.

        Args:
            distance: r = |y|, >= 0.

        Returns:
            V, g(y) = -grad V(|y|).
        """
        square = np.square(self._distances(distance))
        height = 0.5 * self.repulsion * self.spread
        pull = 0.5 * self.attraction * square
        with np.errstate(over="ignore"):
            return np.asarray(pull + height * np.exp(-square / self.spread))

    @property
    def rest_distance(self) -> FloatArray:
        """delta = sqrt(c ln(b / a)), at which two or three agents rest: g_a = g_r.

        0 where the attraction prevails at any distance, infinity where there is none.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.asarray(self.repulsion) / np.asarray(self.attraction)
            square = self.spread * np.log(np.maximum(ratio, 1.0))
        # Without either, nothing moves, at any distance.
        return np.sqrt(np.where(np.isnan(square), 0.0, square))

    @property
    def _rate(self) -> Parameter:
        return 1.0 / self.spread


@dataclass(frozen=True, eq=False, kw_only=True)
class UnboundedRepulsion(_Summed):
    """g(y) = -y [a - b / |y|^2]: a repulsion that no two agents can overcome.

    Attributes:
        attraction: a, 1/s for kinematic particles, >= 0.
        repulsion: b, in the unit of a times the square of a length, >= 0.

    Raises:
        ValueError: a parameter is out of range.
    """

    kind = UNBOUNDED

    attraction: Parameter = 1.0
    repulsion: Parameter = 0.6

    def __post_init__(self) -> None:
        _set(self, "attraction")
        _set(self, "repulsion")

    def net_attraction(self, distance: ArrayLike) -> FloatArray:
        """a - b / r^2, -infinity where r = 0; see `Interaction.net_attraction`."""
        square = np.square(self._distances(distance))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            # Without repulsion there is none in one place either, where b / r^2 is 0 / 0.
            repulsion = np.where(self.repulsion == 0.0, 0.0, self.repulsion / square)
        return np.asarray(self.attraction - repulsion)

    def potential(self, distance: ArrayLike) -> FloatArray:
        """V(r) = a r^2 / 2 - b ln(r); see `BoundedRepulsion.potential`."""
        r = self._distances(distance)
        pull = 0.5 * self.attraction * np.square(r)
        return np.asarray(pull - xlogy(self.repulsion, r))

    @property
    def rest_distance(self) -> FloatArray:
        """delta = sqrt(b / a); see `BoundedRepulsion.rest_distance`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            square = np.asarray(self.repulsion) / np.asarray(self.attraction)
        return np.sqrt(np.where(np.isnan(square), 0.0, square))

    @property
    def _rate(self) -> Parameter:
        return 0.0


def _checked(name: str, values: ArrayLike) -> FloatArray:
    """Numbers whose squares are finite, as an array."""
    array = validation.real_array(name, values)
    if np.abs(array).max() > FARTHEST:
        raise ValueError(
            f"{name} must hold numbers of at most {FARTHEST:g}, got "
            f"{np.abs(array).max():g}; use another unit of length."
        )
    return array


def check_interaction(interaction: object) -> None:
    """Check that something is an `Interaction`.

    Raises:
        TypeError: it is not.
    """
    if not isinstance(interaction, Interaction):
        raise TypeError(
            "interaction must be an Interaction, such as BoundedRepulsion(), got "
            f"{validation.shown(interaction)}."
        )


def coefficients_of(interaction: Interaction, n: int) -> Coefficients | None:
    """The parameters of n agents for kernels; None where no kernel sums the interaction.

    Args:
        interaction: g. A subclass that changes what `BoundedRepulsion` or
            `UnboundedRepulsion` computes is an interaction of its own.
        n: the number of agents, >= 1.

    Raises:
        TypeError: it is no `Interaction`.
        ValueError: a parameter has values for another number of agents.
    """
    check_interaction(interaction)
    for law in (BoundedRepulsion, UnboundedRepulsion):
        if isinstance(interaction, law):
            parameters = interaction.coefficients(n)
            kind = type(interaction)
            same = (getattr(kind, name) is getattr(law, name) for name in _MADE_OF)
            return parameters if all(same) else None
    return None


_MADE_OF = ("__call__", "net_attraction", "coefficients", "_rate", "kind")
"""What a subclass may change of an interaction that kernels sum."""


def _set(interaction: _Summed, name: str, at_least: float = 0.0) -> None:
    """Check a parameter and keep it as an array that cannot be changed."""
    array = per_agent(name, getattr(interaction, name), None, at_least=at_least)
    object.__setattr__(interaction, name, validation.read_only(array))
