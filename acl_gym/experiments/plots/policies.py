"""Which policies are drawn; the modules of the systems say how."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

from matplotlib.figure import Figure

from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.plots import grid, navigation, pendulum
from acl_gym.experiments.plots.parts import Shown, in_symbols, reference
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import digits
from acl_gym.experiments.study import (
    GRID_1D,
    GRID_2D,
    NAVIGATION,
    PENDULUM,
    Experiment,
    Study,
)

SYSTEMS: dict[str, ModuleType] = {
    PENDULUM: pendulum,
    NAVIGATION: navigation,
    GRID_1D: grid,
    GRID_2D: grid,
}


def policies(experiment: Experiment, results: Results) -> Figure:
    """The last policy of each study's run with the cheapest one."""
    shown = best(experiment, results)
    return _drawing("policies", shown, paths=True)


def baseline(experiment: Experiment, results: Results) -> Figure:
    """The policy of each reference, which dynamic programming has found."""
    shown = []
    for label, study in experiment.references.items():
        discount = results.last(study, "discount")[0]
        shown.append(_shown(f"{label}, discount {discount:g}", study, results, 0))
    return _drawing("policies", shown, paths=True)


def policy_maps(experiment: Experiment, results: Results) -> Figure:
    """The reference, and the last policy of the median run of each study."""
    return _drawing("policies", _with_reference(experiment, results))


def swing(experiment: Experiment, results: Results) -> Figure:
    """The pendulum swung up from rest by the policies of `policies`."""
    return _drawing("trajectories", best(experiment, results))


def trajectories(experiment: Experiment, results: Results) -> Figure:
    """What the policies of `policy_maps` do."""
    return _drawing("trajectories", _with_reference(experiment, results))


def _drawing(name: str, shown: list[Shown], **options: Any) -> Figure:
    module = SYSTEMS[shown[0].study.task.env_id]
    figure: Figure = getattr(module, name)(shown, **options)
    return figure


def best(experiment: Experiment, results: Results) -> list[Shown]:
    """The last policy of each study's run with the cheapest one."""
    return [
        _shown(label, study, results, results.best_run(study))
        for label, study in experiment.studies.items()
    ]


def _with_reference(experiment: Experiment, results: Results) -> list[Shown]:
    known = reference(experiment, results)
    name, symbol = "Best policy known", "cost"
    if known.symbol == "J*":
        name, symbol = "Optimum", "J* ="
    first = _shown(name, known.study, results, 0)
    return [
        replace(first, title=f"{name}\n{symbol} {digits(known.cost)}"),
        *(
            _shown(label, study, results, results.median_run(study))
            for label, study in experiment.studies.items()
        ),
    ]


def _shown(label: str, study: Study, results: Results, run: int) -> Shown:
    found = results.runs(study)[run]
    last = found.rows.iloc[-1]
    seed = "" if study.method == "planning" else f" (seed {found.seed})"
    label = f"{in_symbols(label)}{seed}"
    title = f"{label}\ncost {digits(last['policy_cost'])}"
    policy = restore_policy(study, found)
    return Shown(label, title, study, policy, float(last["success_rate"]))
