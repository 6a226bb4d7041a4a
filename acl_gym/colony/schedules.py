"""Parameters that change from trial to trial: epsilon and alpha of the colony.

Exploration may be annealed "with the progress of the algorithm" (§4.2.2), or vanish
as the analysis requires (§3.4.7). A schedule is a function of the trial number
k = 0, 1, ..., so that learning in two parts is the same as learning in one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from acl_gym.utils import validation
from acl_gym.utils.serialization import Savable, from_settings, make_plain


class Schedule(Savable, ABC):
    """A number for each trial."""

    @abstractmethod
    def __call__(self, trial: int) -> float:
        """The value in trial k = 0, 1, ..."""


@dataclass(frozen=True)
class Linear(Schedule):
    """From `start` to `end` in equal steps over `trials` trials, then constant.

    Attributes:
        start: value in trial 0.
        end: value from trial `trials` on.
        trials: >= 1.

    Example:
        >>> [Linear(1.0, 0.5, 2)(trial) for trial in range(4)]
        [1.0, 0.75, 0.5, 0.5]
    """

    start: float
    end: float
    trials: int

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("start", self.start)
        validation.number("end", self.end)
        validation.integer("trials", self.trials, at_least=1)

    def __call__(self, trial: int) -> float:
        """See `Schedule`."""
        done = min(trial / self.trials, 1.0)
        return self.start + done * (self.end - self.start)


@dataclass(frozen=True)
class Exponential(Schedule):
    """`start` * `factor`^k in trial k, but not beyond `end`.

    Attributes:
        start: value in trial 0, > 0.
        factor: > 0; below 1 the value falls, above 1 it rises.
        end: where it stops; None: nowhere.

    Example:
        >>> [Exponential(0.5, 0.5, end=0.2)(trial) for trial in range(3)]
        [0.5, 0.25, 0.2]
    """

    start: float
    factor: float
    end: float | None = None

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("start", self.start, above=0)
        validation.number("factor", self.factor, above=0)
        if self.end is not None:
            validation.number("end", self.end, at_least=0)

    def __call__(self, trial: int) -> float:
        """See `Schedule`."""
        try:
            value = self.start * self.factor**trial
        except OverflowError:
            value = float("inf")
        if self.end is None:
            return value
        return max(value, self.end) if self.factor < 1 else min(value, self.end)


@dataclass(frozen=True)
class Harmonic(Schedule):
    """`start` / (1 + k / `trials`): halved after `trials` trials, summing to infinity.

    With an exploration that vanishes this slowly every action is still tried infinitely
    often.

    Attributes:
        start: value in trial 0, >= 0.
        trials: after how many the value has halved, >= 1.

    Example:
        >>> [Harmonic(0.6, 10)(trial) for trial in (0, 10, 30)]
        [0.6, 0.3, 0.15]
    """

    start: float
    trials: int

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("start", self.start, at_least=0)
        validation.integer("trials", self.trials, at_least=1)

    def __call__(self, trial: int) -> float:
        """See `Schedule`."""
        return self.start / (1 + trial / self.trials)


Setting = float | Callable[[int], float]
"""A number, a `Schedule`, or a function of the trial number."""

_KINDS = (Linear, Exponential, Harmonic)


def schedule_from_settings(name: str, settings: Any) -> Any:
    """A number or schedule from the settings in a file.

    Raises:
        ValueError: they are those of neither.
    """
    return from_settings(name, settings, _KINDS)
