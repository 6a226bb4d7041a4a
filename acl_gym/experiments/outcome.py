"""Summaries of results, as JSON types, for results.json and for reports."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from acl_gym.experiments import plots
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate
from acl_gym.experiments.study import AnyStudy, Experiment
from acl_gym.experiments.swarms.tables import SWARM_TABLES
from acl_gym.experiments.tables import TABLES
from acl_gym.utils.typing import FloatArray

Outcome = dict[str, Any]
"""JSON types."""


class Measure(NamedTuple):
    """A measure whose curves a report shows: its name, and whether the axis is logarithmic."""

    name: str
    logarithmic: bool = False


MEASURES = {
    "policy_cost": Measure("policy cost", True),
    "ants_cost": Measure("cost of the ants", True),
    "policy_variation": Measure("policy variation"),
    "sensitivity": Measure("sensitivity"),
    "size": Measure("distance of the outermost agent from the centre"),
    "rms": Measure("rms distance from the centre"),
    "drift": Measure("drift of the centre"),
    "centre_speed": Measure("speed of the centre"),
    "parts": Measure("number of parts"),
    "miss": Measure("rms distance of the agents from the goal"),
    "centre_miss": Measure("distance of the centre from the goal"),
    "value": Measure("least value so far", True),
    "differing": Measure("entries that differ"),
}
"""The measures whose curves a report shows."""

POINTS = 250
"""How many points a curve has at most: one of `every` is kept."""


def summary(
    experiment: Experiment[Any], results: Results, group: str = "Experiments"
) -> Outcome:
    """What an experiment found.

    Args:
        experiment: which.
        results: its runs.
        group: the heading of a report under which it stands.

    Returns:
        Name, title, section, text and claims; its `figures`, each with file, caption
        and alternative text; its `table`, see `tables`; and its `studies`, each with
        what its runs ended with (`last`) and its curves; and the `measures` of these.
    """
    make_table = {**TABLES, **SWARM_TABLES}.get(experiment.table)
    first = next(iter(experiment.studies.values()))
    return {
        "name": experiment.name,
        "title": experiment.title,
        "section": experiment.section,
        "text": experiment.text,
        "group": group,
        "claims": list(experiment.claims),
        "explains": list(experiment.explains),
        "figures": [
            {
                "file": plots.file_name(experiment, plot),
                "caption": plots.CAPTIONS[plot]["text"],
                "alt": f"{experiment.title}. {plots.CAPTIONS[plot]['alt']}",
            }
            for plot in experiment.plots
        ],
        "table": vars(make_table(experiment, results)) if make_table else None,
        "measure": MEASURES[first.measure].name,
        "measures": _known_measures(experiment, results),
        "studies": [
            _study(label, study, results)
            for label, study in {**experiment.studies, **experiment.references}.items()
        ],
    }


def _known_measures(experiment: Experiment[Any], results: Results) -> list[Outcome]:
    """The measures that some study of an experiment has, that of the studies first."""
    rows = [results.runs(study)[0].rows for study in experiment.everything]
    first = next(iter(experiment.studies.values())).measure
    names = [name for name in MEASURES if any(name in each for each in rows)]
    names.sort(key=lambda name: name != first)
    return [{"key": name, **MEASURES[name]._asdict()} for name in names]


def _study(label: str, study: AnyStudy, results: Results) -> Outcome:
    ends, points = results.last(study, study.measure), study.curve_points()
    every = -(-results.values(study, study.measure).shape[1] // POINTS)
    seconds = [run.seconds for run in results.runs(study)]
    return {
        "label": label,
        "key": study.key,
        "setting": study.inputs,
        "parameters": str(study),
        "runs": len(ends),
        "last": {
            **estimate(ends).as_json("interquartile_mean"),
            "min": float(ends.min()),
            "max": float(ends.max()),
        },
        "success_rate": float(results.last(study, "success_rate").mean())
        if results.knows(study, "success_rate")
        else None,
        "seconds": float(np.median(seconds)),
        "every": every,
        "positions": points and points[::every],
        "unit": study.unit,
        "curves": {
            measure: _curve(results.values(study, measure)[:, ::every])
            for measure in MEASURES
            if measure in results.runs(study)[0].rows
        },
    }


def _curve(values: FloatArray) -> dict[str, list[float]]:
    """Mean, lowest and highest value of the runs at each point, to 5 digits."""
    lines = (values.mean(axis=0), values.min(axis=0), values.max(axis=0))
    return {
        name: [float(f"{value:.5g}") for value in line]
        for name, line in zip(("mean", "low", "high"), lines, strict=True)
    }


def without_curves(outcome: Outcome) -> Outcome:
    """An outcome without its curves, to be printed."""
    studies = [
        [{k: v for k, v in study.items() if k != "curves"} for study in each["studies"]]
        for each in outcome["experiments"]
    ]
    experiments = zip(outcome["experiments"], studies, strict=True)
    return {**outcome, "experiments": [{**e, "studies": s} for e, s in experiments]}
