"""The part of a state space that fits on paper: one or two variables, others fixed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from acl_gym.plotting import style
from acl_gym.plotting.subject import Subject, Variable
from acl_gym.utils import validation
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray

Key = str | int
"""A state variable: its name, with or without its unit, or its number from 0."""


@dataclass(frozen=True)
class Plane:
    """One or two variables along the axes, and the values of all others.

    Attributes:
        variables: all of the subject.
        shown: the numbers of those along the axes, one or two.
        fixed: the values of the others by their number.
        middle: the numbers of those that the user has not fixed.
    """

    variables: tuple[Variable, ...]
    shown: tuple[int, ...]
    fixed: dict[int, float]
    middle: frozenset[int]

    @property
    def axes(self) -> tuple[Variable, ...]:
        """The variables along the axes."""
        return tuple(self.variables[i] for i in self.shown)

    def points(self) -> tuple[FloatArray, ...]:
        """The middle of each piece along each axis."""
        return tuple(0.5 * (axis.edges[1:] + axis.edges[:-1]) for axis in self.axes)

    def states(self, subject: Subject) -> NDArray[Any]:
        """A state for each piece, as observed; the second axis varies slowest."""
        mesh = [grid.ravel() for grid in np.meshgrid(*self.points())]
        values = np.empty((mesh[0].size, len(self.variables)))
        for i, value in self.fixed.items():
            values[:, i] = value
        for i, points in zip(self.shown, mesh, strict=True):
            values[:, i] = points
        return subject.observations(values)

    def shape(self) -> tuple[int, ...]:
        """Of values in `states`: rows and columns of an image, or one row."""
        return tuple(axis.edges.size - 1 for axis in reversed(self.axes))

    def words(self) -> str:
        """Where the other variables are: "at v1 = 0 m/s, v2 = 0 m/s"."""
        if not self.fixed:
            return ""
        parts = []
        for i, value in self.fixed.items():
            variable = self.variables[i]
            number = digits(value).replace("-", "\N{MINUS SIGN}")
            unit = f" {variable.unit}" if variable.unit else ""
            parts.append(f"{style.symbol(variable.symbol)} = {number}{unit}")
        ending = " (middle)" if self.middle else ""
        return f"at {', '.join(parts)}{ending}"

    def label(self, ax: Axes) -> None:
        """Names, limits and ticks of the axes."""
        for place, variable in enumerate(self.axes):
            axis = ax.xaxis if place == 0 else ax.yaxis
            axis.set_label_text(style.symbol(variable.name))
            limits = (variable.low, variable.high)
            (ax.set_xlim if place == 0 else ax.set_ylim)(*limits)
            full = math.isclose(variable.high - variable.low, 2 * math.pi)
            if variable.unit == "rad" and full:
                style.multiples_of_pi(axis)


def plane_of(
    subject: Subject,
    axes: Sequence[Key] | None = None,
    slice: Mapping[Key, float] | None = None,
) -> Plane:
    """Choose what is drawn.

    Args:
        subject: with variables.
        axes: which one or two variables lie along the axes; None takes the first two
            that are not in `slice`.
        slice: the values of other variables; what is neither here nor along an axis is
            in the middle of its range.

    Raises:
        ValueError: a variable does not exist, has two places, or nothing is left.
    """
    variables = subject.variables
    if not isinstance(slice, Mapping | None):
        raise TypeError(
            "slice must be a dict from state variables to values, such as "
            f"{{{variables[-1].symbol!r}: 0.0}}, got {validation.shown(slice)}."
        )
    given = {
        number_of(variables, key): _within(variables, key, value)
        for key, value in (slice or {}).items()
    }
    free = [i for i in range(len(variables)) if i not in given]
    if axes is None:
        shown = _default_axes(subject, free)
    else:
        if isinstance(axes, str) or not isinstance(axes, Sequence):
            raise TypeError(
                "axes must be one or two state variables, got "
                f"{validation.shown(axes)}; name them in "
                "a tuple."
            )
        shown = [number_of(variables, key) for key in axes]
    unique = len(set(shown)) == len(shown)
    if not 1 <= len(shown) <= 2 or not unique or set(shown) & set(given):
        raise ValueError(
            "one or two state variables must be left for the axes, each once, got "
            f"{len(shown)} of {_names(variables)} with slice={slice!r}; fix fewer."
        )
    middle = [i for i in free if i not in shown]
    fixed = {
        i: given[i] if i in given else variables[i].middle()
        for i in range(len(variables))
        if i not in shown
    }
    return Plane(variables, tuple(shown), fixed, frozenset(middle))


def number_of(variables: Sequence[Variable], key: Any) -> int:
    """The number of a state variable, which may be named in any way of `called`.

    Raises:
        ValueError: there is none, or more than one.
    """
    if isinstance(key, Integral) and not isinstance(key, bool):
        found = [int(key)] if 0 <= int(key) < len(variables) else []
    else:
        found = [i for i, v in enumerate(variables) if key in v.called()]
    if len(found) != 1:
        raise ValueError(
            f"a state variable must be one of {_names(variables)} or a number "
            f"0..{len(variables) - 1}, got {validation.shown(key)}."
        )
    return found[0]


def _names(variables: Sequence[Variable]) -> str:
    return ", ".join(repr(variable.symbol) for variable in variables)


def _within(variables: Sequence[Variable], key: Key, value: Any) -> float:
    variable = variables[number_of(variables, key)]
    name = f"slice[{key!r}]"
    return validation.number(name, value, at_least=variable.low, at_most=variable.high)


def _default_axes(subject: Subject, free: list[int]) -> list[int]:
    """Two positions rather than a position and its velocity; what can vary."""
    variables = subject.variables
    places = [i for i in free if variables[i].unit == "m"]
    if len(places) == 2:
        return places
    wide = [i for i in free if variables[i].edges.size > 2]
    return sorted((wide + [i for i in free if i not in wide])[:2])
