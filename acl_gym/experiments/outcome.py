"""Summaries of results, as JSON types, for results.json and for reports."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.experiments import plots
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.tables import TABLES
from acl_gym.utils.typing import FloatArray

Outcome = dict[str, Any]
"""JSON types."""

CURVES = ("policy_cost", "ants_cost", "policy_variation", "sensitivity")
"""The measures whose curves a report shows."""

POINTS = 250
"""How many points a curve has at most: one of `every` is kept."""


def summary(
    experiment: Experiment, results: Results, group: str = "Experiments"
) -> Outcome:
    """What an experiment found.

    Args:
        experiment: which.
        results: its runs.
        group: the heading of a report under which it stands.

    Returns:
        Name, title, section, text and claims; its `figures`, each with file, caption
        and alternative text; its `table`, see `tables`; and its `studies`, each with
        the costs of its last policies and its curves.
    """
    make_table = TABLES.get(experiment.table)
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
        "studies": [
            _study(label, study, results)
            for label, study in {**experiment.studies, **experiment.references}.items()
        ],
    }


def _study(label: str, study: Study, results: Results) -> Outcome:
    costs, points = results.last(study), study.curve_points()
    every = -(-results.values(study).shape[1] // POINTS)
    seconds = [run.seconds for run in results.runs(study)]
    return {
        "label": label,
        "key": study.key,
        "setting": study.inputs,
        "parameters": str(study),
        "runs": len(costs),
        "policy_cost": {
            **estimate(costs).as_json("interquartile_mean"),
            "min": float(costs.min()),
            "max": float(costs.max()),
        },
        "success_rate": float(results.last(study, "success_rate").mean())
        if results.knows(study, "success_rate")
        else None,
        "seconds": float(np.median(seconds)),
        "every": every,
        "positions": points and points[::every],
        "curves": {
            measure: _curve(results.values(study, measure)[:, ::every])
            for measure in CURVES
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
