"""How a colony is compared with another method.

A colony is compared with each rival by the ratio of interquartile means with its bootstrap
interval. It wins or loses where the whole interval lies on one side of 1; otherwise these
runs show no difference. ACL is a rival of the returning colony.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from acl_gym.experiments.comparison.experiments import LABELS, LONG
from acl_gym.experiments.statistics import Estimate, ratio
from acl_gym.utils.typing import FloatArray

FEW = 5
"""With fewer runs no method is said to win."""

SLACK = 1e-3
"""Ratios that are no farther from 1 are taken for 1."""

WINS, LOSES, EVEN, OPEN = "wins", "loses", "no difference", "undecided"
NEITHER = "neither"
"""Of times: neither gets there in more than half of its runs."""


class Comparison(NamedTuple):
    """A method against a rival by one measure; less is better.

    Attributes:
        where: the task; "" where there is one.
        measure: what is compared.
        method: the name of the method.
        rival: the name of the other one.
        verdict: WINS, LOSES, EVEN, NEITHER or OPEN, of the method.
        ratio: how many times the rival's figure that of the method is.
    """

    where: str
    measure: str
    method: str
    rival: str
    verdict: str
    ratio: Estimate

    def as_json(self) -> dict[str, Any]:
        """JSON types: `ratio`, with its interval from `low` to `high`."""
        return {**self._asdict(), **self.ratio.as_json("ratio")}


def compare(
    where: str, measure: str, names: tuple[str, str], values: Sequence[FloatArray]
) -> Comparison:
    """Compare a method with a rival, by the values of the runs of both.

    Args:
        where: see `Comparison`.
        measure: what the values are.
        names: of the method and of the rival.
        values: one a run, > 0 or infinite, of either.
    """
    found = ratio(values[0], values[1])
    if min(map(len, values)) < FEW:
        verdict = OPEN
    elif all(math.isinf(np.median(each)) for each in values):
        verdict = NEITHER
    elif found.low > 1 + SLACK:
        verdict = LOSES
    else:
        verdict = WINS if found.high < 1 - SLACK else EVEN
    return Comparison(where, measure, *names, verdict, found)


def compared(
    where: str, measure: str, values: Mapping[str, FloatArray]
) -> list[Comparison]:
    """Each colony against each rival by the values under their labels."""
    thesis, returning = LABELS["acl"], LABELS["returning"]
    colonies = [name for name in values if name in (thesis, LABELS[LONG], returning)]
    return [
        compare(where, measure, (colony, name), (values[colony], values[name]))
        for colony in colonies
        for name in values
        if name not in colonies or (colony, name) == (returning, thesis)
    ]
