"""What a claim of the thesis is, and how a verdict on it is reached.

A claim consists of statements that hold or do not, each with its threshold in its
words: where all hold the claim holds, where some do it holds in part, where none
does it does not hold. Where runs are missing it is undecided.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from acl_gym.experiments.results import MissingRunsError, Results
from acl_gym.utils.typing import BoolArray, FloatArray

HOLDS, IN_PART, NOT, UNDECIDED = "holds", "holds in part", "does not hold", "undecided"

FEW = 3
"""With fewer runs of a study nothing is decided."""


class Tried(NamedTuple):
    """What was tried to understand a claim that does not hold.

    Attributes:
        what: what was done or measured differently.
        found: the outcome.
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
        name: "C1", "C2" and so on.
        text: the claim in this project's words.
        section: of the thesis.
        decide: returns its statements.
        tried: what is reported where it does not hold, or holds in part.
        understanding: what we make of it; "" if nothing.
    """

    name: str
    text: str
    section: str
    decide: Callable[[Results], list[Part]]
    tried: tuple[Callable[[Results], Tried], ...] = ()
    understanding: str = ""

    def judge(self, results: Results, runs: int = FEW) -> dict[str, Any]:
        """The verdict with all that led to it, JSON types.

        Args:
            results: the runs.
            runs: how many there are of each study; with fewer than `FEW` the figures
                are reported, and nothing is decided.
        """
        try:
            parts = self.decide(results)
        except MissingRunsError:
            parts = []
        decided = verdict(parts) if runs >= FEW else UNDECIDED
        tried = self._attempts(results) if decided in (IN_PART, NOT) else []
        return {
            "claim": self.name,
            "text": self.text,
            "section": self.section,
            "verdict": decided,
            "parts": [{**p._asdict(), "holds": bool(p.holds)} for p in parts],
            "tried": [each._asdict() for each in tried],
            # It was written with all runs in view, not with a part of them.
            "understanding": self.understanding if tried else "",
        }

    def _attempts(self, results: Results) -> list[Tried]:
        """What was tried, as far as its runs are there."""
        found = []
        for attempt in self.tried:
            try:
                found.append(attempt(results))
            except MissingRunsError:
                continue
        return found


def verdict(parts: list[Part]) -> str:
    """The verdict on a claim with these statements."""
    if not parts:
        return UNDECIDED
    count = sum(part.holds for part in parts)
    return HOLDS if count == len(parts) else IN_PART if count else NOT


def settled_from(reached: BoolArray) -> FloatArray:
    """The first trial from which on something is true to the end; infinity if never.

    Args:
        reached: after each trial of each run, `(runs, trials)`.
    """
    from_end = np.logical_and.accumulate(reached[:, ::-1], axis=1)[:, ::-1]
    first = from_end.argmax(axis=1) + 1.0
    return np.where(from_end.any(axis=1), first, np.inf)
