"""The tables beside the figures of swarms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, median
from acl_gym.experiments.study import Experiment
from acl_gym.experiments.swarms.measures import (
    SOLVED,
    mean_ranks,
    settling_steps,
    size_swing,
    solved,
)
from acl_gym.experiments.swarms.study import SwarmStudy
from acl_gym.experiments.tables import Table
from acl_gym.utils.text import digits


def aggregation(experiment: Experiment[SwarmStudy], results: Results) -> Table:
    """Drift, speed, size, parts and settling of each swarm."""
    headings = [
        *("Channel", "drift of the centre", "its speed in the end", "rms distance"),
        *("outermost agent", "swing of the size", "parts", "steps to settle"),
    ]
    rows = []
    for label, study in experiment.studies.items():
        ends = [
            estimate(results.last(study, measure))
            for measure in ("drift", "centre_speed", "rms", "size")
        ]
        parts = results.last(study, "parts")
        rows.append(
            [
                *(label, *map(str, ends)),
                f"{median(size_swing(results, study)):.1%}",
                f"{digits(parts.mean())}\n{parts.min():.0f} to {parts.max():.0f}",
                f"{median(settling_steps(results, study)):.0f}",
            ]
        )
    return Table(headings, rows)


def foraging(experiment: Experiment[SwarmStudy], results: Results) -> Table:
    """How far agents and centre are from the goal, for each profile and channel."""
    return _by_rows(
        experiment,
        lambda study: (
            f"{estimate(results.last(study, 'miss'))}\ncentre: "
            f"{estimate(results.last(study, 'centre_miss'))}"
        ),
    )


def pso(experiment: Experiment[SwarmStudy], results: Results) -> Table:
    """The median value and the share of solved runs of each function in each channel."""

    def cell(study: SwarmStudy) -> str:
        value = float(median(results.last(study, "value")))
        text = "solved" if value < SOLVED else digits(value)
        return f"{text}\n{solved(results, study):.0%} of runs"

    table = _by_rows(experiment, cell)
    ranks = mean_ranks(results, experiment.options["rows"])
    table.headings.append("mean rank")
    for row, rank in zip(table.rows, ranks, strict=True):
        row.append(f"{rank:.1f}")
    table.best.append([int(ranks.argmin()), len(table.headings) - 1])
    return table


def colonies(experiment: Experiment[SwarmStudy], results: Results) -> Table:
    """How many levels of the pheromone differ."""
    headings = ["Colony", "levels", "changed by learning", "different", "same draws"]
    rows = []
    for label, study in experiment.studies.items():
        entries, learned, differing, same = (
            results.last(study, measure)
            for measure in ("entries", "learned", "differing", "same_draws")
        )
        rows.append(
            [
                *(label, f"{entries[0]:.0f}", f"{learned.min():.0f} or more"),
                *(f"{differing.max():.0f}", f"{same.mean():.0%} of runs"),
            ]
        )
    return Table(headings, rows)


def _by_rows(
    experiment: Experiment[SwarmStudy], cell: Callable[[SwarmStudy], str]
) -> Table:
    """A column for each of `options["rows"]`, a row for each channel."""
    groups: Mapping[str, Mapping[str, SwarmStudy]] = experiment.options["rows"]
    labels = next(iter(groups.values()))
    rows = [[label, *(cell(row[label]) for row in groups.values())] for label in labels]
    return Table(["Channel", *groups], rows)


SWARM_TABLES: dict[str, Callable[[Experiment[Any], Results], Table]] = {
    "aggregation": aggregation,
    "foraging": foraging,
    "pso": pso,
    "colonies": colonies,
}
"""The tables by name."""
