"""Angles of which an observation shows the cosine and the sine.

Many environments show an angle so, since the pair does not jump where the angle goes
round. For cells, one circular variable is better than two that depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

FULL_CIRCLE = 2.0 * math.pi

ROUNDING = 1e-4
"""By how much the squares of a cosine and a sine may miss 1; observations are often
rounded to float32."""

DIFFERENT = 10
"""How many directions must have been seen before two numbers count as cosine and sine."""


class Angles:
    """Which numbers of an observation are cosine and sine of one variable.

    The variable takes the place of its cosine; its sine is left out.

    Args:
        pairs: for each angle the numbers of its cosine and its sine in an observation.
        n_variables: how many variables there are, an angle counting as one.

    Attributes:
        pairs: the same, in the order of the variables.
        n_observed: how many numbers an observation has.
        columns: of each variable its number in an observation; of an angle that of its
            cosine.
        circular: which variables are angles.

    Raises:
        ValueError: `pairs` are no different numbers of an observation, two for each.
    """

    def __init__(self, pairs: Any, n_variables: int) -> None:
        listed = validation.elements(pairs)
        rows = [validation.elements(pair) or [] for pair in listed or ()]
        self.n_observed = n_variables + len(rows)
        flat: list[Any] = [number for row in rows for number in row]
        good = (
            listed is not None
            and all(len(row) == 2 for row in rows)
            and len(rows) <= n_variables
            and all(
                isinstance(number, int | np.integer)
                and not isinstance(number, bool)
                and 0 <= number < self.n_observed
                for number in flat
            )
            and len(set(flat)) == len(flat)
        )
        if not good:
            raise ValueError(
                "angles must be pairs of different numbers, those of a cosine and a "
                f"sine among the 0..{self.n_observed - 1} of an observation, got "
                f"{validation.shown(pairs)}; each pair is one of the {n_variables} "
                "variables."
            )
        self.pairs = tuple(sorted((int(cosine), int(sine)) for cosine, sine in rows))
        sine_of = dict(self.pairs)
        sines = set(sine_of.values())
        self.columns = tuple(i for i in range(self.n_observed) if i not in sines)
        self._sines = tuple(sine_of.get(column) for column in self.columns)
        self.circular = tuple(
            axis for axis, sine in enumerate(self._sines) if sine is not None
        )

    def __eq__(self, other: object) -> bool:
        """Whether both read observations in the same way."""
        return isinstance(other, Angles) and (
            (self.pairs, self.n_observed) == (other.pairs, other.n_observed)
        )

    def __hash__(self) -> int:
        """Of what is compared."""
        return hash((self.pairs, self.n_observed))

    def variables(self, observations: NDArray[Any]) -> NDArray[Any]:
        """Turn observations into variables, `(n, n_observed)` into `(n, n_variables)`.

        Angles are in [-pi, pi], those of infinite numbers NaN.
        """
        if not self.pairs:
            return observations
        given = np.asarray(observations, dtype=np.float64)
        variables = given[:, self.columns]
        for axis in self.circular:
            cosine, sine = variables[:, axis], given[:, self._sines[axis]]
            finite = np.isfinite(cosine) & np.isfinite(sine)
            variables[:, axis] = np.where(finite, np.arctan2(sine, cosine), np.nan)
        return variables

    def observations(self, variables: FloatArray) -> FloatArray:
        """Turn variables into observations, `(n, n_variables)` into `(n, n_observed)`."""
        if not self.pairs:
            return variables
        observations = np.empty((len(variables), self.n_observed))
        observations[:, self.columns] = variables
        for axis, (cosine, sine) in zip(self.circular, self.pairs, strict=True):
            observations[:, cosine] = np.cos(variables[:, axis])
            observations[:, sine] = np.sin(variables[:, axis])
        return observations


def find_angles(observations: NDArray[Any]) -> list[tuple[int, int]]:
    """Find what could be cosine and sine of an angle, in observations of any kind.

    Their squares add up to 1 every time, and they take `DIFFERENT` pairs of values or
    more: flags of which one is set do so too, but are no angle.

    Args:
        observations: finite, `(n, d)`.

    Returns:
        Pairs of their numbers; none has a number twice.
    """
    given = np.asarray(observations, dtype=np.float64)
    free = [
        column
        for column in range(given.shape[1])
        if np.abs(given[:, column]).max() <= 1.0 + ROUNDING
        and np.ptp(given[:, column]) > 0.0
    ]
    pairs = []
    while free:
        cosine = free.pop(0)
        for sine in free:
            miss = given[:, cosine] ** 2 + given[:, sine] ** 2 - 1.0
            both = given[:, [cosine, sine]]
            if (
                np.abs(miss).max() <= ROUNDING
                and len(np.unique(both, axis=0)) >= DIFFERENT
            ):
                pairs.append((cosine, sine))
                free.remove(sine)
                break
    return pairs


def periods_with_angles(
    periods: Sequence[float | None], angles: Angles
) -> list[float | None]:
    """The periods of all variables, where that of an angle may have been left out.

    Raises:
        ValueError: the period of an angle is another than 2 pi.
    """
    complete = list(periods)
    for axis in angles.circular:
        if complete[axis] not in (None, FULL_CIRCLE):
            raise ValueError(
                f"periods[{axis}] must be 2 pi or None, since variable {axis} is an "
                f"angle given by cosine and sine, got {complete[axis]}."
            )
        complete[axis] = FULL_CIRCLE
    return complete
