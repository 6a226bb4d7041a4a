"""What a claim is, and the statistics by which it is decided.

A claim is taken apart into statements that hold or do not, each with its threshold
written into its words: all hold, the claim holds; some, it holds in part; none, it does
not hold. Where runs are missing it is undecided.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from acl_gym.reproduction.catalogue import EXPERIMENTS
from acl_gym.reproduction.evidence import Evidence, MissingRunsError
from acl_gym.utils.typing import FloatArray

HOLDS, IN_PART, NOT, UNDECIDED = "holds", "holds in part", "does not hold", "undecided"
RESAMPLES = 2_000
FEW = 3
"""With fewer runs of a setting nothing is decided."""

_NEVER = 1e100  # stands for infinity, of which a ratio would be NaN


class Tried(NamedTuple):
    """What was tried to understand a claim that does not hold.

    Attributes:
        what: what was done otherwise, or looked at otherwise.
        found: what came of it.
    """

    what: str
    found: str


class Part(NamedTuple):
    """One statement of a claim.

    Attributes:
        statement: with its threshold.
        measured: the figure, with its interval where it has one.
        holds: whether the figure keeps to the threshold.
    """

    statement: str
    measured: str
    holds: bool


@dataclass(frozen=True)
class Claim:
    """A claim of the thesis.

    Attributes:
        name: C1 .. C23.
        text: in this project's words.
        section: of the thesis.
        decide: takes it apart.
        tried: what is told where it does not hold, or holds in part.
        understanding: what to know about it in any case; "" if nothing.
    """

    name: str
    text: str
    section: str
    decide: Callable[[Evidence], list[Part]]
    tried: tuple[Callable[[Evidence], Tried], ...] = ()
    understanding: str = ""

    @property
    def experiments(self) -> list[str]:
        """The names of the experiments that decide it."""
        return [each.name for each in EXPERIMENTS if self.name in each.claims]

    @property
    def trials(self) -> list[str]:
        """The names of the experiments that were tried to understand it."""
        return [each.name for each in EXPERIMENTS if self.name in each.explains]

    def attempts(self, evidence: Evidence) -> list[Tried]:
        """What was tried, as far as its runs are there."""
        found = []
        for attempt in self.tried:
            try:
                found.append(attempt(evidence))
            except MissingRunsError:
                continue
        return found

    def judge(self, evidence: Evidence, runs: int = FEW) -> dict[str, Any]:
        """The verdict with all that led to it, JSON types.

        Args:
            evidence: the runs.
            runs: how many there are of each setting; with fewer than `FEW` the figures
                are told, and nothing is decided.
        """
        try:
            parts = self.decide(evidence)
        except MissingRunsError:
            parts = []
        decided = verdict(parts) if runs >= FEW else UNDECIDED
        wanting = decided in (IN_PART, NOT)
        tried = self.attempts(evidence) if wanting else []
        return {
            "claim": self.name,
            "text": self.text,
            "section": self.section,
            "experiments": self.experiments,
            "trials": self.trials,
            "verdict": decided,
            "parts": [{**p._asdict(), "holds": bool(p.holds)} for p in parts],
            "tried": [each._asdict() for each in tried],
            # What we make of all runs: not of a part of them.
            "understanding": self.understanding if tried else "",
        }


def verdict(parts: list[Part]) -> str:
    """Of a claim with these statements."""
    if not parts:
        return UNDECIDED
    count = sum(part.holds for part in parts)
    return HOLDS if count == len(parts) else IN_PART if count else NOT


class Interval(NamedTuple):
    """An estimate with its 95% bootstrap interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """For instance 1.23 [1.1, 1.4]."""
        return f"{digits(self.value)} [{digits(self.low)}, {digits(self.high)}]"


def digits(value: float) -> str:
    """A number to three digits, without powers of ten: 2590, 44.7."""
    return f"{float(f'{value:.3g}'):g}"


def iqm(values: FloatArray, axis: int = -1) -> Any:
    """The interquartile mean: that of the middle half of the values."""
    return stats.trim_mean(values, 0.25, axis=axis)


def interval(values: FloatArray, seed: int = 0) -> Interval:
    """The interquartile mean of runs.

    Args:
        values: one a run, `(runs,)`; infinity is allowed.
        seed: of the bootstrap.
    """
    drawn = _resample(values, np.random.default_rng(seed))
    low, high = np.quantile(iqm(drawn), [0.025, 0.975], method="inverted_cdf")
    return Interval(float(iqm(values)), float(low), float(high))


def ratio(first: FloatArray, second: FloatArray, seed: int = 0) -> Interval:
    """How many times the interquartile mean of one setting is that of another.

    The bootstrap is stratified: the runs of each setting are drawn apart.

    Args:
        first: one value a run, `(runs,)`.
        second: the same of the other setting, > 0.
        seed: of the bootstrap.
    """
    rng = np.random.default_rng(seed)
    first, second = np.minimum(first, _NEVER), np.minimum(second, _NEVER)
    drawn = iqm(_resample(first, rng)) / iqm(_resample(second, rng))
    low, high = np.quantile(drawn, [0.025, 0.975], method="inverted_cdf")
    return Interval(float(iqm(first) / iqm(second)), float(low), float(high))


def _resample(values: FloatArray, rng: np.random.Generator) -> FloatArray:
    data = np.asarray(values, dtype=np.float64)
    return data[rng.integers(data.size, size=(RESAMPLES, data.size))]


def rank_correlation(x: Any, y: Any) -> float:
    """Spearman's, from -1 to 1; 0 where one of both does not vary."""
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0
    return float(stats.spearmanr(x, y).statistic)


def middle_half(values: FloatArray) -> float:
    """The interquartile range."""
    low, high = np.quantile(values, [0.25, 0.75])
    return float(high - low)


def swing_at_the_end(costs: FloatArray, trials: int = 20) -> FloatArray:
    """How far each run's policy cost still swings: (max - min) / median, late trials.

    Args:
        costs: `(runs, trials)`.
        trials: how many count as late.
    """
    late = costs[:, -trials:]
    return np.asarray((late.max(axis=1) - late.min(axis=1)) / np.median(late, axis=1))


def trial_of(reached: NDArray[np.bool_]) -> FloatArray:
    """The first trial after which something is true to the end; infinity if never.

    Args:
        reached: after each trial of each run, `(runs, trials)`.
    """
    from_end = np.logical_and.accumulate(reached[:, ::-1], axis=1)[:, ::-1]
    first = from_end.argmax(axis=1) + 1.0
    return np.where(from_end.any(axis=1), first, np.inf)
