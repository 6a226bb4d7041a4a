"""What the runs say, as a report needs it: JSON types."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from acl_gym.reproduction.claims import CLAIMS
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Experiment, Runnable
from acl_gym.reproduction.verdicts import interval
from acl_gym.reproduction.versus.findings import FINDINGS

Outcome = dict[str, Any]
"""All that a report needs, JSON types: `experiments`, `claims`, `runs`, `made`."""

CURVES = ("policy_cost", "ants_cost", "policy_variation", "sensitivity")
"""The measures that are kept trial by trial for the report."""

_BAND = "Black, the mean of the runs; grey, from the lowest to the highest of them"
_LAST = "Cost of the last policies, and the interquartile mean with its interval"
CAPTIONS = {
    "bands": f"{_BAND}; dashed, the optimal cost where it is known.",
    "measures": f"{_BAND}.",
    "policies": "The last policy of the run whose last policy is the cheapest.",
    "baseline": "Forces at rest, and ways to the goal.",
    "bands_and_policies": f"{_BAND}; dashed, the optimal cost. Below, the last policy of "
    "the run whose last policy is the cheapest: white is the full positive torque, black "
    "the negative one, grey none.",
    "swing": "Angle (the line is upright), velocity, torque and cost from hanging at "
    "rest, by the last policy of the run whose last policy is the cheapest.",
    "level_band": "The pheromone of the one pair in q: simulated runs between the bounds "
    "on their expectation.",
    "race": "Median of the runs, the middle half of them, and faintly all; the line is the "
    "best cost that dynamic programming finds. Right, the last policy of each run, and "
    "the interquartile mean with its interval.",
    "harder": f"{_LAST}.",
    "sweep": f"{_LAST}, faintly each run.",
    "order": "On the line nothing depends on the order of the slots.",
    "policy_gap": "Where the blue and the orange region do not overlap, Delta is "
    "positive.",
}


def runs_made(results: Iterable[dict[str, Any]]) -> dict[str, list[str]]:
    """By which commits, when and on what processors runs were made."""
    made = [result["made"] for result in results]
    return {
        name: sorted({str(each.get(name) or "unknown") for each in made})
        for name in ("commit", "date", "cpu")
    }


def outcome_of(
    experiments: Sequence[Experiment],
    evidence: Evidence,
    runs: int,
    first_seed: int,
    made: dict[str, Any],
) -> Outcome:
    """What the runs say: each experiment summed up, each claim judged."""
    return {
        "runs": runs,
        "first_seed": first_seed,
        "experiments": [summary(each, evidence) for each in experiments],
        "claims": [claim.judge(evidence, runs) for claim in CLAIMS],
        "made": made,
    }


def summary(experiment: Experiment, evidence: Evidence) -> dict[str, Any]:
    """What an experiment found, JSON types: each study with its last policies' cost."""
    found = []
    for study in experiment.studies:
        costs = evidence.last(study.setting)
        centre = interval(costs)
        found.append(
            {
                "label": study.label,
                "setting": study.setting.about,
                "parameters": study.setting.text,
                "positions": study.setting.positions(),
                "runs": len(costs),
                "policy_cost": {
                    "interquartile_mean": centre.value,
                    "low": centre.low,
                    "high": centre.high,
                    "min": float(costs.min()),
                    "max": float(costs.max()),
                },
                "success_rate": float(
                    evidence.last(study.setting, "success_rate").mean()
                ),
                "seconds": float(
                    np.median([run["seconds"] for run in evidence.runs(study.setting)])
                ),
                "curves": curves(study.setting, evidence),
            }
        )
    return {
        "name": experiment.name,
        "title": experiment.title,
        "section": experiment.section,
        "text": experiment.text,
        "claims": list(experiment.claims),
        "explains": list(experiment.explains),
        "caption": CAPTIONS[experiment.drawing],
        "studies": found,
        "findings": None
        if not experiment.findings
        else FINDINGS[experiment.findings](experiment, evidence),
    }


def curves(setting: Runnable, evidence: Evidence) -> dict[str, Any]:
    """Mean, least and largest value of each measure after each trial, 5 digits."""
    found = {}
    for measure in CURVES:
        if measure not in evidence.runs(setting)[0]["rows"]:
            continue
        values = evidence.rows(setting, measure)
        found[measure] = {
            name: [float(f"{value:.5g}") for value in line]
            for name, line in (
                ("mean", values.mean(axis=0)),
                ("low", values.min(axis=0)),
                ("high", values.max(axis=0)),
            )
        }
    return found


def figures_only(outcome: Outcome) -> Outcome:
    """An outcome without its curves, to be printed."""
    return {
        **outcome,
        "experiments": [
            {
                **each,
                "studies": [
                    {name: value for name, value in study.items() if name != "curves"}
                    for study in each["studies"]
                ],
            }
            for each in outcome["experiments"]
        ],
    }
