"""Checks of arrays with one row for each agent, and of the memory that links need."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray

FARTHEST = 1e150
"""Squares of distances between positions up to this are finite. A run ends with an error
beyond it, and so does a search, as one that has exploded."""


BYTES_A_LINK = 48
"""The most memory that a link takes while links are being made."""


def checked_positions(positions: Any, n: int | None = None) -> FloatArray:
    """Return positions as a float64 array in C order, not copied if it is one already.

    Args:
        positions: of the agents, `(n, dim)`.
        n: how many agents there must be; None: any number >= 1.

    Raises:
        ValueError: they do not have this shape, or one is NaN or farther away than
            `FARTHEST`.
    """
    array = validation.as_array(positions)
    if (
        array is None
        or array.dtype.kind not in "iuf"
        or array.ndim != 2
        or array.size == 0
        or (n is not None and len(array) != n)
    ):
        raise _no_positions(positions, array, n)
    rows = validation.float64(array)
    agent = _first_beyond(rows, FARTHEST)
    if agent >= 0:
        raise ValueError(
            f"positions must be numbers of at most {FARTHEST:g}, got {rows[agent]} for "
            f"agent {agent}; look for what makes it diverge, such as too large a step."
        )
    return rows


def _no_positions(
    positions: Any, array: NDArray[Any] | None, n: int | None
) -> ValueError:
    """Say what is wrong with positions."""
    got = validation.shown(positions)
    if array is not None and array.ndim == 2 and array.dtype.kind not in "iuf":
        return ValueError(
            f"positions must be real numbers, got {got} of dtype {array.dtype}."
        )
    if n == 0 or (array is not None and array.ndim == 2 and len(array) == 0):
        return ValueError(
            f"positions must have a row for each agent, and there must be at least one "
            f"agent, got {got}."
        )
    many = "n" if n is None else n
    return ValueError(
        f"positions must be an array of numbers of shape ({many}, dim), a row for "
        f"each agent and dim >= 1, got {got}."
    )


def checked_rows(name: str, values: Any, shape: tuple[int, int]) -> FloatArray:
    """Check that there is a row of real numbers for each agent; they need not be finite.

    Args:
        name: of the argument, for the message.
        values: `(n, dim)`.
        shape: what it must be.

    Raises:
        ValueError: `values` does not have this shape, or holds no real numbers.
    """
    array = validation.as_array(values)
    if array is None or array.dtype.kind not in "iuf" or array.shape != shape:
        raise ValueError(
            f"{name} must be an array of numbers of shape {shape}, a row for each agent, "
            f"got {validation.shown(values)}."
        )
    return validation.float64(array)


def all_finite(rows: FloatArray) -> bool:
    """Whether an array has neither NaN nor infinity; faster than NumPy for few agents.

    Args:
        rows: float64, in C order.
    """
    return bool(_first_beyond(rows.reshape(1, -1), sys.float_info.max) < 0)


@njit
def _first_beyond(rows: FloatArray, limit: float) -> int:
    """The first row with an entry that is NaN or larger than the limit; -1: none."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            if not abs(rows[i, k]) <= limit:
                return i
    return -1


def check_room(
    n_links: int,
    remedy: str,
    *,
    n_agents: int = 0,
    bytes_an_agent: int = 24,
    bytes_a_link: int = BYTES_A_LINK,
) -> None:
    """Refuse links that do not fit into memory, before any is made.

    Every function that writes links out, or an entry for each, asks here first.

    Args:
        n_links: how many, or about how many.
        remedy: what to do about it, an imperative.
        n_agents: how many agents there are, where their number may be too large as well.
        bytes_an_agent: what is kept for each agent.
        bytes_a_link: what is kept for each link.

    Raises:
        ValueError: no memory is large enough.
    """
    what = f"{n_links:,} links"
    if n_agents:
        what = f"{n_agents:,} agents with {what}"
    n_bytes = bytes_a_link * n_links + bytes_an_agent * n_agents
    validation.check_memory(what, n_bytes, remedy)


def per_agent(
    name: str,
    value: ArrayLike,
    n: int | None = None,
    *,
    infinite: bool = False,
    **bounds: float,
) -> FloatArray:
    """Return a parameter of the agents: one number for all, or one for each.

    Args:
        name: what messages call it.
        value: a number, or `(n,)` numbers.
        n: how many agents there are; None: not known yet.
        infinite: whether infinity counts as inside the range.
        **bounds: of the range, see `validation.Range`.

    Returns:
        An array without axes, or with one.

    Raises:
        ValueError: it is neither, or out of range.
    """
    array = validation.real_array(name, value, finite=False)
    if array.ndim > 1 or (n is not None and array.ndim == 1 and array.size != n):
        many = "" if n is None else f" of the {n} agents"
        raise ValueError(
            f"{name} must be a number, or one for each{many}, got an array of shape "
            f"{array.shape}."
        )
    interval = validation.Range(**bounds)
    inside = np.isfinite(array)
    if interval.above is not None:
        inside &= array > interval.above
    if interval.at_least is not None:
        inside &= array >= interval.at_least
    if interval.at_most is not None:
        inside &= array <= interval.at_most
    if interval.below is not None:
        inside &= array < interval.below
    if infinite:
        inside |= array == np.inf
    if not inside.all():
        also = ", or be infinite" if infinite else ""
        bad = array[~inside].flat[0]
        raise ValueError(f"{name} must lie in {interval}{also}, got {bad:g}.")
    return array


def check_messages(messages: dict[str, NDArray[Any]], n: int) -> None:
    """Check that messages are arrays with a row for each agent.

    Raises:
        TypeError: they are not arrays under names.
        ValueError: an array does not have a row for each agent.
    """
    if not isinstance(messages, dict):
        raise TypeError(
            "messages must be a dict of arrays, such as {'value': values}, got "
            f"{validation.shown(messages)}."
        )
    for name, rows in messages.items():
        if not isinstance(rows, np.ndarray):
            raise TypeError(
                f"message {name!r} must be an array with a row for each agent, got "
                f"{validation.shown(rows)}."
            )
        if rows.ndim == 0 or rows.shape[0] != n:
            raise ValueError(
                f"message {name!r} must have a row for each of the {n} agents, got an "
                f"array of shape {rows.shape}."
            )
