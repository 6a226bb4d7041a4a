"""Prior knowledge of actions: the heuristic eta, and the levels to begin with (§7.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.partitions import Partition
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

Heuristic = ArrayLike | Callable[[Any, Partition], ArrayLike]
"""eta as an array `(n_cells, n_actions)`, or a function of environment and partition."""


def as_heuristic(
    heuristic: Heuristic | None, env: Any, partition: Partition, shape: tuple[int, int]
) -> FloatArray | None:
    """A heuristic as an array of its own, which cannot be written to.

    Args:
        heuristic: an array, a function that returns one, or None.
        env: first argument of the function.
        partition: second argument of the function.
        shape: `(n_cells, n_actions)`.

    Raises:
        ValueError: it is not an array of that shape, finite, >= 0 and positive
            somewhere in each row.
    """
    if heuristic is None:
        return None
    found = heuristic(env, partition) if callable(heuristic) else heuristic
    return checked_heuristic(found, shape)


def checked_heuristic(found: Any, shape: tuple[int, ...]) -> FloatArray:
    """A new array of heuristic values, which cannot be written to.

    Raises:
        ValueError: they do not have that shape, or are not finite, >= 0 and positive
            somewhere in each row.
    """
    eta = _table("heuristic", found, shape, finite=False, boolean=True)
    valid = np.isfinite(eta) & (eta >= 0.0)
    if not valid.all():
        cell, action = np.argwhere(~valid)[0]
        raise ValueError(
            "heuristic must be finite and >= 0, got "
            f"{eta[cell, action]:g} for action {action} in cell {cell}."
        )
    some = (eta > 0.0).any(axis=1)
    if not some.all():
        raise ValueError(
            "heuristic must be positive for at least one action of each cell, got only 0 "
            f"in cell {int(np.argmin(some))}; give 1 to all actions of a cell of which "
            "nothing is known."
        )
    eta.flags.writeable = False
    return eta


def to_the_power(heuristic: FloatArray, exponent: float) -> FloatArray:
    """eta^exponent, each row divided by its largest, `(n_cells, n_actions)`.

    The scale of a row has no effect, because actions are compared within a cell. An
    action that is ruled out, eta = 0, stays so with an exponent of 0.
    """
    powers = (heuristic / heuristic.max(axis=1, keepdims=True)) ** exponent
    return np.where(heuristic > 0.0, powers, 0.0)


def as_initial(
    initial: Heuristic | None,
    env: Any,
    partition: Partition,
    shape: tuple[int, int],
    tau0: float,
) -> FloatArray | None:
    """The levels to begin with as an array, of which none is below tau0.

    tau0 is the level to which visited pairs decay, eq. (4.12). A level below it would
    rise with every visit, so that trying a pair in vain would recommend it.

    Args:
        initial: an array, a function that returns one, or None.
        env: first argument of the function.
        partition: second argument of the function.
        shape: `(n_cells, n_actions)`.
        tau0: the lowest level.

    Raises:
        ValueError: it is not an array of that shape, finite and >= tau0.
    """
    if initial is None:
        return None
    found = initial(env, partition) if callable(initial) else initial
    levels = checked_initial(found, shape)
    if (levels < tau0).any():
        cell, action = np.argwhere(levels < tau0)[0]
        raise ValueError(
            f"initial must be at least tau0 = {tau0:g}, to which visited pairs decay, got "
            f"{levels[cell, action]:g} for action {action} in cell {cell}; raise it, or "
            "lower tau0."
        )
    return levels


def checked_initial(found: Any, shape: tuple[int, ...]) -> FloatArray:
    """A new array of levels, which cannot be written to.

    Raises:
        ValueError: they do not have that shape, or are not finite.
    """
    levels = _table("initial", found, shape)
    levels.flags.writeable = False
    return levels


def _table(name: str, found: Any, shape: tuple[int, ...], **how: bool) -> FloatArray:
    """A new array with a row per cell and a column per action.

    Args:
        name: what messages call it.
        found: the candidate.
        shape: `(n_cells, n_actions)`.
        how: see `validation.real_array`.

    Raises:
        ValueError: it is no array of numbers, or has another shape.
    """
    wanted = f"shape {shape}, a row per cell and a column per action"
    lengths = {len(row) for row in found} if _is_ragged(found) else set()
    if len(lengths) > 1:
        raise ValueError(
            f"{name} must be an array of real numbers of {wanted}, got {len(found)} rows "
            f"of {min(lengths)} to {max(lengths)} entries."
        )
    table = validation.real_array(name, found, **how)
    if table.shape != shape:
        raise ValueError(f"{name} must have {wanted}, got {table.shape}.")
    return table


def _is_ragged(found: Any) -> bool:
    """Whether it is a list of lists, which may differ in length."""
    return isinstance(found, (list, tuple)) and all(
        isinstance(row, (list, tuple)) for row in found
    )
