"""Profiles of the environment: what a foraging swarm likes and dislikes where it is.

A profile sigma gives every place a value: low where there is food, high where there is
danger. Agents descend it: -grad sigma(x_i) is part of their input (Gazi and Passino,
2004, "Stability analysis of social foraging swarms").
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.rows import FARTHEST
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray

NARROWEST = 1e-150
"""Squares of widths from this on are not rounded to 0."""


class Profile(ABC):
    """A differentiable function of the position."""

    @abstractmethod
    def value(self, positions: FloatArray) -> FloatArray:
        """sigma at `(..., dim)` positions, `(...)`."""

    @abstractmethod
    def gradient(self, positions: FloatArray) -> FloatArray:
        """grad sigma at `(..., dim)` positions, an array of the same shape."""


@dataclass(frozen=True, eq=False)
class Plane(Profile):
    """sigma(x) = A' x: the swarm drifts in the direction -A for ever.

    Attributes:
        slope: A, `(dim,)`.

    Raises:
        ValueError: it is no such array.
    """

    slope: FloatArray

    def __post_init__(self) -> None:
        _set(self, slope=validation.real_array("slope", self.slope, ndim=1))

    def value(self, positions: FloatArray) -> FloatArray:
        """See `Profile.value`."""
        return np.asarray(_checked(positions, self.slope) @ self.slope)

    def gradient(self, positions: FloatArray) -> FloatArray:
        """A everywhere; see `Profile.gradient`."""
        x = _checked(positions, self.slope)
        return np.array(np.broadcast_to(self.slope, x.shape))


@dataclass(frozen=True, eq=False)
class Quadratic(Profile):
    """sigma(x) = (A / 2) |x - c|^2, a bowl: the centre of the swarm tends to c as e^(-A t).

    Attributes:
        centre: c, `(dim,)`.
        curvature: A; < 0 for a hill, which agents leave for ever.

    Raises:
        ValueError: an attribute is not finite.
    """

    centre: FloatArray
    curvature: float = 1.0

    def __post_init__(self) -> None:
        _set(
            self,
            centre=validation.real_array("centre", self.centre, ndim=1),
            curvature=validation.number("curvature", self.curvature),
        )

    def value(self, positions: FloatArray) -> FloatArray:
        """See `Profile.value`."""
        y = _checked(positions, self.centre) - self.centre
        return np.asarray(0.5 * self.curvature * np.square(y).sum(axis=-1))

    def gradient(self, positions: FloatArray) -> FloatArray:
        """A (x - c); see `Profile.gradient`."""
        x = _checked(positions, self.centre)
        return np.asarray(self.curvature * (x - self.centre))


@dataclass(frozen=True, eq=False)
class Gaussians(Profile):
    """sigma(x) = -sum_k d_k exp(-|x - c_k|^2 / (2 s_k^2)): valleys and hills.

    In the terms of Gazi and Passino, A_sigma = 2 d and l_sigma = 2 s^2.

    Attributes:
        centres: c_k, `(count, dim)`.
        depths: d_k, one for each or one for all; < 0 for a hill.
        widths: s_k, > 0, a length, one for each or one for all: a valley is steepest at
            the distance s from its centre.

    Raises:
        ValueError: an attribute is out of range, or there is not one for each centre.
    """

    centres: FloatArray
    depths: float | FloatArray = 1.0
    widths: float | FloatArray = 1.0

    def __post_init__(self) -> None:
        centres = validation.real_array("centres", self.centres, ndim=2)
        depths = for_each("depths", self.depths, len(centres))
        widths = for_each("widths", self.widths, len(centres))
        if not (widths >= NARROWEST).all():
            raise ValueError(
                f"widths must be > 0, and {NARROWEST:g} or more, as their squares are "
                f"divided by, got {widths.min():g}."
            )
        _set(self, centres=centres, depths=depths, widths=widths)

    def value(self, positions: FloatArray) -> FloatArray:
        """See `Profile.value`."""
        return self._evaluated(positions)[0]

    def gradient(self, positions: FloatArray) -> FloatArray:
        """See `Profile.gradient`."""
        return self._evaluated(positions)[1]

    @property
    def least(self) -> float:
        """A lower bound on sigma: minus the sum of the depths of all valleys."""
        return -float(np.maximum(self.depths, 0.0).sum())

    def _evaluated(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        x = _checked(positions, np.asarray(self.centres)[0])
        rows = x.reshape(-1, x.shape[-1])
        value, gradient = np.empty(len(rows)), np.empty_like(rows)
        depths, widths = np.asarray(self.depths), np.asarray(self.widths)
        sum_gaussians(rows, self.centres, depths, widths, value, gradient)
        return value.reshape(x.shape[:-1]), gradient.reshape(x.shape)


@njit
def sum_gaussians(
    positions: FloatArray,
    centres: FloatArray,
    depths: FloatArray,
    widths: FloatArray,
    value: FloatArray,
    gradient: FloatArray,
) -> None:
    """The value and the gradient of `Gaussians` at `(n, dim)` positions."""
    n, dim = positions.shape
    for i in range(n):
        value[i] = 0.0
        gradient[i] = 0.0
        for k in range(depths.size):
            square = 0.0
            for axis in range(dim):
                y = positions[i, axis] - centres[k, axis]
                square += y * y
            variance = widths[k] * widths[k]
            part = depths[k] * np.exp(-0.5 * square / variance)
            value[i] -= part
            for axis in range(dim):
                y = positions[i, axis] - centres[k, axis]
                gradient[i, axis] += part / variance * y


def for_each(name: str, values: ArrayLike, count: int) -> FloatArray:
    """Return one value for each of `count` things, if need be the same one.

    Raises:
        ValueError: there are others than one or `count`, or one is not finite.
    """
    array = validation.real_array(name, values)
    if array.shape not in ((), (count,)):
        raise ValueError(
            f"{name} must be a number or have one value for each of the {count} "
            f"centres, got an array of shape {array.shape}."
        )
    return np.array(np.broadcast_to(array, count))


class HasGradient(Protocol):
    """A `Profile`, or `Obstacles`."""

    def gradient(self, positions: FloatArray) -> FloatArray:
        """The gradient at `(n, dim)` positions, an array of the same shape."""


def checked_gradient(
    part: HasGradient, positions: FloatArray, finite: bool = True
) -> FloatArray:
    """The gradient of a profile, which may be the user's own, or of obstacles.

    Args:
        part: whose; it is given a copy of the positions, which it may change.
        positions: where, `(n, dim)`.
        finite: whether to refuse gradients that are NaN or infinite.

    Raises:
        ValueError: the gradient has another shape, or is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # which is found below
        returned = part.gradient(positions.copy())
    gradient = validation.as_array(returned)
    kind = type(part).__name__
    if (
        gradient is None
        or gradient.shape != positions.shape
        or gradient.dtype.kind not in "biuf"
    ):
        raise ValueError(
            f"the gradient of {kind} must be real numbers of the shape of the positions, "
            f"{positions.shape}, got {validation.shown(returned)}; let it return a row "
            "for each position."
        )
    if finite and not np.isfinite(gradient).all():
        row = int(np.flatnonzero(~np.isfinite(gradient).all(axis=-1))[0])
        raise ValueError(
            f"the gradient of {kind} must be finite, got {gradient[row]} at the position "
            f"{positions[row]}; let it return finite numbers everywhere."
        )
    return gradient


def _checked(positions: FloatArray, centre: ArrayLike) -> FloatArray:
    x = validation.real_array("positions", positions)
    dim = np.size(centre)
    if x.ndim == 0 or x.shape[-1] != dim:
        raise ValueError(
            f"positions must have {dim} coordinates each, as the profile has, got an "
            f"array of shape {x.shape}."
        )
    if np.abs(x).max() > FARTHEST:
        raise ValueError(
            f"positions must be numbers of at most {FARTHEST:g}, got "
            f"{np.abs(x).max():g}; use another unit of length."
        )
    return x


def _set(profile: Profile, **values: FloatArray | float) -> None:
    """Keep checked attributes; arrays cannot be changed any more."""
    for name, value in values.items():
        kept = validation.read_only(value) if isinstance(value, np.ndarray) else value
        object.__setattr__(profile, name, kept)
