"""What is measured of the runs of swarms, for claims, tables and figures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.stats import rankdata

from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import median
from acl_gym.experiments.swarms.study import SwarmStudy
from acl_gym.utils.typing import FloatArray

SOLVED = 1e-10
"""A value of a benchmark function below which it counts as solved, and as this."""

SETTLED = 0.05
"""A swarm has settled when its rms distance stays within this share of the last one."""


def settling_steps(results: Results, study: SwarmStudy) -> FloatArray:
    """The recorded step from which on the size of each run stays near its end, `(runs,)`."""
    rms = results.values(study, "rms")
    near = np.abs(rms - rms[:, -1:]) <= SETTLED * rms[:, -1:]
    from_end = np.logical_and.accumulate(near[:, ::-1], axis=1)[:, ::-1]
    points = np.array(study.curve_points())
    return np.asarray(points[from_end.argmax(axis=1)])


def least_values(results: Results, study: SwarmStudy) -> FloatArray:
    """The least value of each run, or `SOLVED` where it is below, `(runs,)`."""
    return np.maximum(results.last(study, "value"), SOLVED)


def solved(results: Results, study: SwarmStudy) -> float:
    """The share of runs that end below `SOLVED`."""
    return float((results.last(study, "value") < SOLVED).mean())


def mean_ranks(
    results: Results, rows: Mapping[str, Mapping[str, SwarmStudy]]
) -> FloatArray:
    """The mean over functions of the rank of each channel's median value; 1 is the best.

    Channels that have solved a function share their ranks.
    """
    medians = [
        [median(least_values(results, study)) for study in row.values()]
        for row in rows.values()
    ]
    return np.asarray(np.mean([rankdata(each) for each in medians], axis=0))


def late_speed(results: Results, study: SwarmStudy) -> FloatArray:
    """The mean speed of the centre over the last quarter of each run, `(runs,)`."""
    return np.asarray(_late(results, study, "centre_speed").mean(axis=1))


def size_swing(results: Results, study: SwarmStudy) -> FloatArray:
    """How far the rms distance swings in the last quarter: (max - min) / median, `(runs,)`."""
    late = _late(results, study, "rms")
    return np.asarray(np.ptp(late, axis=1) / median(late))


def _late(results: Results, study: SwarmStudy, measure: str) -> FloatArray:
    values = results.values(study, measure)
    return values[:, -(values.shape[1] // 4) :]
