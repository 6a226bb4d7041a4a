"""What policies are measured against, and the figures of a study relative to it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment, Study
from acl_gym.utils.typing import FloatArray

MARKS = (25, 10)
"""Percent above the reference that count as close, the wider first."""

UNITS = {"env_steps": "interactions", "seconds": "seconds"}
TIMES = {
    f"{x}_to_{mark}": f"{unit} to within {mark}%"
    for mark in MARKS
    for x, unit in UNITS.items()
}
"""What it takes to come close to the reference, by its key."""


class Reference(NamedTuple):
    """What policies are measured against: a study, its cost, and whether that is J*.

    Without a model there is no such study; the cost is then the lowest of all runs.
    """

    study: Study | None
    cost: float
    optimal: bool

    @property
    def symbol(self) -> str:
        """What the cost is called."""
        return "J*" if self.optimal else "best known"

    def within(self, percent: float) -> float:
        """The cost that is so much above this one; costs may be below 0."""
        if self.cost >= 0.0:
            return self.cost * (1 + percent / 100)
        return self.cost * (1 - percent / 100)

    def gap(self, costs: FloatArray) -> FloatArray:
        """Percent above this cost; NaN where it is 0."""
        if self.cost == 0.0:
            return np.full_like(costs, np.nan)
        gap = 100 * (costs / self.cost - 1)
        return gap if self.cost > 0.0 else -gap


def reference(experiment: Experiment, results: Results) -> Reference:
    """The first reference; an option says whether it is the optimum.

    Without one, the best policy of all runs.
    """
    for study in experiment.references.values():
        cost = float(results.last(study)[0])
        return Reference(study, cost, experiment.options["optimum"])
    costs = [results.best(study).min() for study in experiment.studies.values()]
    return Reference(None, float(min(costs)), optimal=False)


def measured(study: Study, results: Results, known: Reference) -> dict[str, FloatArray]:
    """The figures of a study that tables show, `(runs,)` each.

    NaN where nothing is known: of success in environments of other packages.
    """
    final, best = results.last(study), results.best(study)
    rates = [np.full(len(final), np.nan)] * 2
    if results.knows(study, "success_rate"):
        rates = [f(study, "success_rate") for f in (results.last, results.best)]
    return {
        "final_policy_cost": final,
        "final_gap_percent": known.gap(final),
        "final_success_rate": rates[0],
        "best_policy_cost": best,
        "best_gap_percent": known.gap(best),
        "best_success_rate": rates[1],
        "env_steps": results.last(study, "env_steps"),
        "seconds": results.last(study, "seconds"),
        **{
            f"{x}_to_{mark}": results.first_within(study, known.within(mark), x)
            for mark in MARKS
            for x in UNITS
        },
    }
