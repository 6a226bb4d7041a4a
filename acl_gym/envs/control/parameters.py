"""Checks of parameters and states that several systems share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

MOST_SUBSTEPS = 10_000
"""Integration steps in one sampling time: a kernel cannot be interrupted, and with more
a step of an environment would take longer than one waits."""


def set_canonical(system: ControlSystem, values: dict[str, Any]) -> None:
    """Set the fields of a frozen dataclass to plain tuples and numbers.

    The parameters stay immutable and can be hashed and written as JSON.

    Args:
        system: a dataclass.
        values: of those fields that are not floats; the others become floats.
    """
    for field in fields(system):  # type: ignore[arg-type]
        value = values.get(field.name)
        if value is None:
            value = float(getattr(system, field.name))
        object.__setattr__(system, field.name, value)


def is_weight(matrix: FloatArray, size: int) -> bool:
    """Whether a matrix is symmetric, positive semi-definite and of shape (size, size)."""
    # Rounding may leave the smallest eigenvalue of v v' slightly below zero.
    slack = 1e-12 * float(np.abs(matrix).max())
    return bool(
        matrix.shape == (size, size)
        and np.array_equal(matrix, matrix.T)
        and np.linalg.eigvalsh(matrix)[0] >= -slack
    )


def real_states(states: Any, variables: Sequence[str]) -> FloatArray:
    """Return states of several real variables as a new array `(n, len(variables))`.

    Args:
        states: the candidate.
        variables: their names.

    Raises:
        ValueError: the shape is wrong, or a state is not finite.
    """
    array = validation.real_array("states", states, finite=False)
    if array.ndim != 2 or array.shape[1] != len(variables):
        raise ValueError(
            f"states must be rows [{', '.join(variables)}], shape "
            f"(n, {len(variables)}), got {array.shape}."
        )
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ValueError(
            f"states must be finite, got {array[row].tolist()} in row {row}."
        )
    return array


def numbered_states(states: Any, n_states: int, hint: str) -> FloatArray:
    """Return states that are numbers, `(n,)` or `(n, 1)`, as a new array `(n, 1)`.

    Args:
        states: the candidate.
        n_states: they must be integers of 0..n_states - 1.
        hint: what the error message adds about the numbers.

    Raises:
        ValueError: the shape is wrong, or a state is not such an integer.
    """
    array = validation.real_array("states", states, finite=False)
    if array.shape not in ((array.size,), (array.size, 1)):
        raise ValueError(
            f"states must be one integer each, shape (n,) or (n, 1), got {array.shape}."
        )
    array = array.reshape(-1, 1)
    good = (array >= 0) & (array < n_states) & (array == np.floor(array))
    if not good.all():
        row = int(np.flatnonzero(~good[:, 0])[0])
        raise ValueError(
            f"states must be integers of 0..{n_states - 1}, got {array[row, 0]:g} in "
            f"row {row}; {hint}."
        )
    return array + 0.0  # no -0
