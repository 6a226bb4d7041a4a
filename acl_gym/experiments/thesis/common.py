"""What the chapters share: sweeps, and how claims and attempts are put together."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from importlib.resources import files
from typing import Any, TypeVar

import numpy as np

from acl_gym.experiments.claims import Claim, Part, Tried
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, median, ratio
from acl_gym.experiments.study import AnyStudy, Experiment, Study
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray

T = TypeVar("T")
S = TypeVar("S", bound=AnyStudy)

_WORDS = tomllib.loads(
    files("acl_gym.experiments.thesis")
    .joinpath("claims.toml")
    .read_text(encoding="utf-8")
)

Attempt = Callable[[Results], Tried]
Attempts = tuple[Attempt, ...]
Decide = Callable[[Results], Iterator[Part]]

NEARLY_ONE = 0.999999
"""Stands for gamma = 1, which lies outside [0, 1), the range of eq. (3.11)."""

KINDS = ("crisp", "fuzzy")
FUZZY_FIRST = ("fuzzy", "crisp")

READINGS = {
    "in turn": "in_turn",
    "once an ant": "once_per_ant",
    "once a trial": "once_per_trial",
}
"""Other readings of the local update than "each visit", as settings of the agent."""

FEWER = 10
"""Runs of studies beside those of the thesis that take long."""

LATE = 20
"""How many trials at the end count as late."""


def number(value: Any) -> str:
    """The value of a parameter as labels show it; words stay as they are."""
    if isinstance(value, str):
        return value
    return "1" if value == NEARLY_ONE else f"{value:g}"


def sweep(symbol: str, values: Iterable[Any], make: Callable[[Any], T]) -> dict[str, T]:
    """What is made of each value of a parameter, by its label in figures."""
    return {f"{symbol} = {number(value)}": make(value) for value in values}


def fewer(studies: Mapping[str, S]) -> dict[str, S]:
    """The same studies with at most `FEWER` runs."""
    return {label: replace(s, most_runs=FEWER) for label, s in studies.items()}


def experiment(
    name: str,
    title: str,
    section: str,
    studies: Mapping[str, Study],
    claims: str = "",
    plot: str = "bands",
    explains: str = "",
    **more: Any,
) -> Experiment:
    """An experiment with one figure; the names of claims are separated by spaces."""
    return Experiment(
        name=name,
        title=title,
        section=section,
        studies=studies,
        plots=(plot,),
        claims=tuple(claims.split()),
        explains=tuple(explains.split()),
        **more,
    )


def late_cost(results: Results, study: Study, trials: int = LATE) -> FloatArray:
    """The mean policy cost over the last trials of each run, `(runs,)`."""
    late: FloatArray = results.values(study)[:, -trials:].mean(axis=1)
    return late


def late_swing(costs: FloatArray, trials: int = LATE) -> FloatArray:
    """How far each run's policy cost swings at the end: (max - min) / median.

    Args:
        costs: `(runs, trials)`.
        trials: how many trials count as the end.
    """
    late = costs[:, -trials:]
    return np.asarray((late.max(axis=1) - late.min(axis=1)) / median(late))


def centres(values: Mapping[Any, FloatArray]) -> dict[Any, float]:
    """The interquartile mean over the runs, for each value of a parameter."""
    return {key: estimate(each).value for key, each in values.items()}


def listed(values: Mapping[Any, Any], between: str = ", ") -> str:
    """Figures in one line, each after the value of the parameter that was varied."""
    texts = {
        key: digits(each) if isinstance(each, float) else each
        for key, each in values.items()
    }
    return between.join(f"{number(key)}: {text}" for key, text in texts.items())


def percentages(shares: Iterable[float]) -> str:
    """Shares in one line."""
    return ", ".join(f"{share:.0%}" for share in shares)


def below_one(statement: str, first: FloatArray, second: FloatArray) -> Part:
    """A statement that holds if the interval of a ratio lies below 1."""
    found = ratio(first, second)
    statement += ": the interval of the ratio lies below 1"
    return Part(statement, str(found), found.high < 1)


def above_one(statement: str, first: FloatArray, second: FloatArray) -> Part:
    """A statement that holds if the interval of a ratio lies above 1."""
    found = ratio(first, second)
    statement += ": the interval of the ratio lies above 1"
    return Part(statement, str(found), found.low > 1)


def for_each(values: Iterable[T], *attempts: Callable[[T, Results], Tried]) -> Attempts:
    """Attempts with each value as their first argument."""
    return tuple(partial(each, value) for value in values for each in attempts)


def claim(*tried: Attempt) -> Callable[[Decide], Claim]:
    """Make a claim, see `claims.Claim`, of a function that yields its statements.

    Its name is that of the function, C1 of `_c1`, and its words are in claims.toml.
    """

    def made(decide: Decide) -> Claim:
        def parts(results: Results) -> list[Part]:
            return list(decide(results))

        name = decide.__name__.lstrip("_").upper()
        return Claim(name=name, decide=parts, tried=tried, **_WORDS[name])

    return made
