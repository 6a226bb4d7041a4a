"""What the numbers of a system mean: its observations, and the inputs behind actions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from acl_gym.utils import validation

_FLOATS = ("float16", "float32", "float64")


@dataclass(frozen=True)
class Signals:
    """Names of observations and inputs, and the input values of each action.

    A policy that is taken home says with them what it reads and what it sets.

    Attributes:
        observations: for each variable of an observation its name and unit, such as
            "angular velocity, rad/s"; empty if unknown.
        inputs: the same for each input of the plant.
        values: for each action the value of each input, `(n_actions, n_inputs)`.
        dtype: the type of the inputs that the plant takes, "float64" or another of
            NumPy's floats.

    Raises:
        ValueError: `values` are not finite numbers with a column for each input, or
            `dtype` is no type of floats.
    """

    observations: tuple[str, ...]
    inputs: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]
    dtype: str = "float64"

    def __post_init__(self) -> None:
        values = validation.real_array("values", self.values, ndim=2)
        if values.shape[1] != len(self.inputs):
            raise ValueError(
                f"values must have a column for each of the inputs {self.inputs}, got "
                f"shape {values.shape}."
            )
        validation.one_of("dtype", self.dtype, _FLOATS)
        object.__setattr__(self, "observations", tuple(map(str, self.observations)))
        object.__setattr__(self, "inputs", tuple(map(str, self.inputs)))
        object.__setattr__(self, "values", tuple(map(tuple, values.tolist())))

    @classmethod
    def of_inputs(cls, values: Any, observations: Sequence[str] = ()) -> Self:
        """Name the inputs u[0], u[1], ...

        Args:
            values: `(n_actions, n_inputs)`, or `(n_actions,)` for a single input.
            observations: names of the observations.

        Raises:
            ValueError: `values` are not finite numbers in one of these shapes.
        """
        array = validation.real_array("inputs", values)
        if array.ndim == 1:
            array = array[:, None]
        if array.ndim != 2:
            raise ValueError(
                "inputs must hold a number or a row of numbers for each action, shape "
                f"(n_actions,) or (n_actions, n_inputs), got {np.shape(values)}."
            )
        names = tuple(f"u[{i}]" for i in range(array.shape[1]))
        return cls(tuple(observations), names, tuple(map(tuple, array.tolist())))
