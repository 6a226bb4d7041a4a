"""Where the episodes of a plant begin: states, a box of them, or a user's function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control import sampling
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray

Draw = Callable[[np.random.Generator, int], FloatArray]
"""Draws so many states `(state_size, n)`."""


class InitialStates:
    """The argument `initial` of `acl_gym.plant`.

    Args:
        initial: None, a Box, states, or a function of a generator and a number.
        widths: how many numbers one state may have, that of the variables first.
        checked_rows: returns states that are rows, checked, with parameters where these
            are given; its second argument is what messages call them.
        draw: anywhere within the bounds.
        reached: whether states `(state_size, n)` lie in the goal.

    Attributes:
        rows: the states, where some are given, `(n, ...)`; else None.

    Raises:
        ValueError: `initial` is not valid, or nearly all states lie in the goal.
    """

    def __init__(
        self,
        initial: Any,
        widths: tuple[int, ...],
        checked_rows: Callable[[Any, str], FloatArray],
        draw: Draw,
        reached: Callable[[FloatArray], BoolArray],
    ) -> None:
        self._checked_rows, self._draw, self._reached = checked_rows, draw, reached
        self.rows: FloatArray | None = None
        self._ends: FloatArray | None = None  # of a box, (2, state_size)
        self._function: Callable[[np.random.Generator, int], Any] | None = None
        if isinstance(initial, spaces.Box):
            ends = np.stack([initial.low, initial.high]).reshape(2, -1)
            checked_rows(ends, "initial")
            self._ends = ends.astype(np.float64)
        elif callable(initial):
            self._function = initial
            self._of_function(initial, np.random.default_rng(0), 3)
            return
        elif initial is not None:
            rows = validation.real_array("initial", initial)
            one = rows.ndim == 1 and rows.size in widths
            self.rows = checked_rows(rows[None] if one else rows, "initial")
            return
        drawn = self._in_box(np.random.default_rng(0), 1000)
        if reached(drawn).mean() > 0.99:
            raise ValueError(
                "the goal must leave 1% or more of the initial states outside it; "
                "narrow the goal or the tolerance, or give other initial states."
            )

    def draw(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw states; those of a box lie outside the goal.

        Args:
            rng: the generator.
            count: how many.

        Returns:
            `(state_size, count)`, with parameters only where these are given.
        """
        if self.rows is not None:
            chosen = self.rows[rng.integers(len(self.rows), size=count)]
            return np.ascontiguousarray(chosen.T)
        if self._function is not None:
            rows = self._of_function(self._function, rng, count)
            return np.ascontiguousarray(rows.T)
        return sampling.sample_outside(
            lambda n: self._in_box(rng, n), self._reached, count
        )

    def _in_box(self, rng: np.random.Generator, count: int) -> FloatArray:
        if self._ends is None:
            return self._draw(rng, count)
        low, high = self._ends[:, :, None]
        return np.asarray(low + (high - low) * rng.random((len(low), count)))

    def _of_function(
        self,
        function: Callable[[np.random.Generator, int], Any],
        rng: np.random.Generator,
        count: int,
    ) -> FloatArray:
        """What the user's function returns, checked, `(count, ...)`.

        Raises:
            ValueError: it raises, or does not return so many states.
        """
        expected = "initial(rng, n) must return n states, one a row"
        try:
            given = function(rng, count)
        except Exception as error:  # whatever the user's code raises
            raise ValueError(
                f"{expected}, but it raised {error!r} for n = {count}."
            ) from error
        try:
            rows = self._checked_rows(given, "states")
        except (ValueError, TypeError) as error:
            raise ValueError(f"{expected}: for n = {count}, {error}") from error
        if len(rows) != count:
            raise ValueError(f"{expected}, got {len(rows)} rows for n = {count}.")
        return rows
