"""The usual controller of an inner loop: linear state feedback with saturation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


@dataclass(frozen=True, init=False)
class StateFeedback:
    """The controller u = -K (x - r), clipped to the limits of the inputs.

    x are the d variables of an observation, u the m inputs, K is the gain and r the set
    point. Whichever of K and r is left out is a parameter, which `InnerLoop` lets the
    learner choose: a row of parameters is the set point, or the rows of the gain one
    after the other, or first the gain and then the set point. With both given it is a
    controller without parameters, such as the baseline of a `Shield`.

    Args:
        gain: K, `(m, d)`, or `(d,)` for a single input; None: a parameter.
        set_point: r, `(d,)`; None: a parameter.
        circular: variables that wrap around, whose error is taken the short way: their
            numbers, where the period is 2 pi, or number -> period, > 0.
        low: the least inputs, a number or `(m,)`; None: no limit.
        high: the greatest inputs, in the same form, not less than `low`.
        n_inputs: m, 1 to 1,000, where the gain is a parameter; else it says itself.

    Attributes:
        gain: K as rows, or None.
        set_point: r, or None.
        circular: pairs of a variable and its period.
        low: the least inputs, m numbers.
        high: the greatest inputs, m numbers.
        n_inputs: m.

    Raises:
        TypeError: `circular` or `n_inputs` are not integers.
        ValueError: an array has the wrong shape or is not finite, or the arguments do not
            fit each other.

    Example:
        >>> hold = StateFeedback(
        ...     [2.5, 0.3], [3.14, 0.0], circular=[0], low=-0.8, high=0.8
        ... )
        >>> hold([[3.04, 0.0], [0.1, 0.0]]).round(3).tolist()
        [[0.25], [0.8]]
    """

    gain: tuple[tuple[float, ...], ...] | None
    set_point: tuple[float, ...] | None
    circular: tuple[tuple[int, float], ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    n_inputs: int

    def __init__(
        self,
        gain: Any = None,
        set_point: Any = None,
        *,
        circular: Iterable[int] | Mapping[int, float] = (),
        low: Any = None,
        high: Any = None,
        n_inputs: int = 1,
    ) -> None:
        n_inputs = validation.integer("n_inputs", n_inputs, at_least=1, at_most=1_000)
        size = None
        if gain is not None:
            rows = np.atleast_2d(validation.real_array("gain", gain))
            if rows.ndim != 2:
                raise ValueError(
                    "gain must have shape (n_inputs, d), or (d,) for a single input, got "
                    f"{rows.shape}."
                )
            n_inputs, size = rows.shape
            gain = tuple(map(tuple, rows.tolist()))
        if set_point is not None:
            point = validation.real_array("set_point", set_point, ndim=1)
            if size is not None and point.size != size:
                raise ValueError(
                    f"set_point must have the {size} variables that gain has columns, "
                    f"got {point.size}."
                )
            size = point.size
            set_point = tuple(point.tolist())
        periods = _periods(circular, size)
        least = _limit("low", low, -math.inf, n_inputs)
        most = _limit("high", high, math.inf, n_inputs)
        if any(a > b for a, b in zip(least, most, strict=True)):
            raise ValueError(f"low must not exceed high, got {least} and {most}.")
        values = (gain, set_point, periods, least, most, n_inputs)
        names = ("gain", "set_point", "circular", "low", "high", "n_inputs")
        for name, value in zip(names, values, strict=True):
            object.__setattr__(self, name, value)

    def __call__(self, observations: Any, parameters: Any = None) -> FloatArray:
        """The inputs for some observations.

        Args:
            observations: `(n, d)`.
            parameters: a row for each observation, `(n, p)`: what the constructor was not
                given. None where it was given both gain and set point.

        Returns:
            The inputs, `(n, m)`.

        Raises:
            ValueError: the shapes do not fit.
        """
        seen = validation.real_array("observations", observations, finite=False)
        if seen.ndim != 2:
            raise ValueError(
                f"observations must be rows of variables, (n, d), got {seen.shape}."
            )
        gain, set_point = self._settings(seen.shape, parameters)
        error = seen - set_point
        for axis, period in self.circular:
            half = 0.5 * period
            error[:, axis] = np.mod(error[:, axis] + half, period) - half
        inputs = -np.einsum("...md,...d->...m", gain, error)
        return np.asarray(np.clip(inputs, self.low, self.high))

    def _settings(
        self, shape: tuple[int, ...], parameters: Any
    ) -> tuple[FloatArray, FloatArray]:
        """Gain and set point, of all observations or for each."""
        n, d = shape
        fixed = (
            self.set_point if self.set_point is not None else (self.gain or ((),))[0]
        )
        if fixed and len(fixed) != d:
            raise ValueError(
                f"observations must have {len(fixed)} variables, as gain and set_point "
                f"have, got {d}."
            )
        if any(axis >= d for axis, _ in self.circular):
            raise ValueError(
                f"circular must be among the variables 0..{d - 1} of the observations, "
                f"got {[axis for axis, _ in self.circular]}."
            )
        width = self.n_inputs * d * (self.gain is None) + d * (self.set_point is None)
        rows: FloatArray = np.zeros((n, 0))
        if parameters is not None and np.shape(parameters) != (n, 0):
            rows = validation.real_array("parameters", parameters, finite=False)
        if rows.shape != (n, width):
            raise ValueError(
                f"parameters must be rows of {width} numbers, shape {(n, width)}, got "
                f"{rows.shape}: {self._meaning(d)}."
            )
        gain, point = np.array(self.gain), np.array(self.set_point)
        if self.gain is None:
            taken = self.n_inputs * d
            gain, rows = rows[:, :taken].reshape(n, self.n_inputs, d), rows[:, taken:]
        if self.set_point is None:
            point = rows
        return gain, point

    def _meaning(self, d: int) -> str:
        parts = []
        if self.gain is None:
            parts.append(f"{self.n_inputs} x {d} gains")
        if self.set_point is None:
            parts.append(f"{d} set points")
        return " and ".join(parts) or "gain and set_point are given already"


def _periods(
    circular: Iterable[int] | Mapping[int, float], size: int | None
) -> tuple[tuple[int, float], ...]:
    """Pairs of a variable and its period, in order."""
    given = validation.elements(circular)
    if given is None:
        raise TypeError(
            "circular must hold numbers of variables, or map them to periods, got "
            f"{validation.shown(circular)}."
        )
    pairs = []
    for each in given:
        axis = validation.integer("circular", each, at_least=0)
        period = circular[each] if isinstance(circular, Mapping) else 2.0 * math.pi
        pairs.append((axis, validation.number("the period", period, above=0)))
    axes = [axis for axis, _ in pairs]
    if len(set(axes)) < len(axes) or (
        size is not None and max(axes, default=0) >= size
    ):
        raise ValueError(
            f"circular must hold different variables{'' if size is None else f' of 0..{size - 1}'}"
            f", got {axes}."
        )
    return tuple(sorted(pairs))


def _limit(name: str, value: Any, none: float, n_inputs: int) -> tuple[float, ...]:
    """One number for each input; infinite where there is no limit."""
    if value is None:
        return (none,) * n_inputs
    array: NDArray[np.float64] = validation.real_array(name, value)
    if array.shape not in ((), (n_inputs,)):
        raise ValueError(
            f"{name} must be a number, or one for each of {n_inputs} inputs, got "
            f"{validation.shown(value)}."
        )
    return tuple(np.broadcast_to(array, n_inputs).tolist())
