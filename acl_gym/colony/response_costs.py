"""Costs of a response: how one state variable goes from where it was to a target."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from acl_gym.colony.cost import Cost
from acl_gym.colony.episodes import Episodes
from acl_gym.utils import validation
from acl_gym.utils.serialization import make_plain
from acl_gym.utils.typing import FloatArray


@dataclass(frozen=True)
class _Response(Cost):
    """A measure of how one state variable goes from where it was to a target.

    Attributes:
        variable: index of the state variable.
        target: its desired value.
    """

    variable: int
    target: float

    @property
    @abstractmethod
    def period(self) -> float | None:
        """The period of a circular variable, > 0; else None."""

    def __post_init__(self) -> None:
        make_plain(self)
        validation.integer("variable", self.variable, at_least=0)
        validation.number("target", self.target)
        if self.period is not None:
            validation.number("period", self.period, above=0)

    def _error(self, episodes: Episodes) -> FloatArray:
        """Target less value, `(longest + 1, n)`; circular: to the nearest target."""
        period = self.period
        values = episodes.variable(self.variable, period)
        target = np.full(len(episodes), self.target)
        if period is not None:
            # Unwrapped, the target lies at every period: the one where the ant ends.
            target += period * np.round((values[-1] - target) / period)
        return np.asarray(target - values)


@dataclass(frozen=True)
class RiseTime(_Response):
    """The time from `low` to `high` of the way to the target.

    Crossings are interpolated between samples. A solution that never gets as far as
    `high` costs its whole duration; one that begins at the target costs 0.

    Attributes:
        low: fraction of the way, in [0, 1).
        high: fraction of the way, in (low, 1].
        sampling_time: s, the time of a step.
        period: of a circular variable.
    """

    low: float = 0.1
    high: float = 0.9
    sampling_time: float = 1.0
    period: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.number("low", self.low, at_least=0, below=1)
        validation.number("high", self.high, above=self.low, at_most=1)
        validation.number("sampling_time", self.sampling_time, above=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        error = self._error(episodes)
        span = error[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            progress = np.where(span == 0.0, 1.0, 1.0 - error / span)
        begin = _first_crossing(progress, self.low)
        end = _first_crossing(progress, self.high)
        steps = episodes.lengths.astype(np.float64)
        np.subtract(end, begin, out=steps, where=np.isfinite(end))
        return np.asarray(self.sampling_time * steps)


@dataclass(frozen=True)
class SettlingTime(_Response):
    """The time after which the variable stays within a band around the target.

    A solution that ends outside the band costs its whole duration, as does one that
    enters it with its last step.

    Attributes:
        tolerance: half-width of the band, > 0, in units of the variable.
        sampling_time: s, the time of a step.
        period: of a circular variable.
    """

    tolerance: float = 0.05
    sampling_time: float = 1.0
    period: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.number("tolerance", self.tolerance, above=0)
        validation.number("sampling_time", self.sampling_time, above=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        outside = np.abs(self._error(episodes)) > self.tolerance
        times = np.arange(len(outside))[:, None]
        # The first time of those after which it is inside for good.
        settled = np.max(np.where(outside, times + 1, 0), axis=0)
        return np.asarray(self.sampling_time * np.minimum(settled, episodes.lengths))


@dataclass(frozen=True)
class Overshoot(_Response):
    """How far the variable goes beyond the target, seen from where it began.

    In units of the variable; 0 without overshoot, so that it cannot be used alone,
    because 1 / J would be infinite: add another cost or a constant.

    Attributes:
        period: of a circular variable.
    """

    period: float | None = None

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        error = self._error(episodes)
        beyond = -np.sign(error[0]) * error
        return np.asarray(np.max(beyond, axis=0, initial=0.0))


def _first_crossing(progress: FloatArray, level: float) -> FloatArray:
    """When each column first reaches `level`, interpolated; inf where it never does."""
    above = progress >= level
    step = np.argmax(above, axis=0)
    columns = np.arange(progress.shape[1])
    after, before = progress[step, columns], progress[np.maximum(step - 1, 0), columns]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(step > 0, (after - level) / (after - before), 0.0)
    return np.where(above.any(axis=0), step - part, np.inf)
