"""Which policies are drawn; the modules of the systems say how."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

from matplotlib.figure import Figure

from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.plots import grid, navigation, pendulum
from acl_gym.experiments.plots.parts import (
    REFERENCE,
    Shown,
    in_symbols,
    look,
    reference,
)
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
    return _maps(best(experiment, results), paths=True)


def baseline(experiment: Experiment, results: Results) -> Figure:
    """The policy of each reference, which dynamic programming has found."""
    shown = []
    for label, study in experiment.references.items():
        discount = results.last(study, "discount")[0]
        label = f"{label}, discount {discount:g}"
        shown.append(_shown(label, study, results, 0))
    return _maps(shown, paths=True)


def policy_maps(experiment: Experiment, results: Results) -> Figure:
    """The reference, and the last policy of the median run of each study."""
    return _maps(_with_reference(experiment, results))


def swing(experiment: Experiment, results: Results) -> Figure:
    """The pendulum swung up from rest by the policies of `policies`."""
    return pendulum.trajectories(best(experiment, results))


def trajectories(experiment: Experiment, results: Results) -> Figure:
    """What the policies of `policy_maps` do."""
    shown = _with_reference(experiment, results)
    figure: Figure = SYSTEMS[shown[0].study.task.env_id].trajectories(shown)
    return figure


def best(experiment: Experiment, results: Results) -> list[Shown]:
    """The last policy of each study's run with the cheapest one."""
    return [
        _shown(label, study, results, results.best_run(study))
        for label, study in experiment.studies.items()
    ]


def _with_reference(experiment: Experiment, results: Results) -> list[Shown]:
    known = reference(experiment, results)
    name = "Optimum" if known.symbol == "J*" else "Best policy known"
    first = _shown(name, known.study, results, 0)
    return [
        replace(first, title=f"{name}\n{known.symbol} = {digits(known.cost)}"),
        *(
            _shown(label, study, results, results.median_run(study))
            for label, study in experiment.studies.items()
        ),
    ]


def _shown(label: str, study: Study, results: Results, run: int) -> Shown:
    found = results.runs(study)[run]
    last: Any = found.rows.iloc[-1]
    name = in_symbols(label)
    planned = study.method == "planning"
    return Shown(
        label=name if planned else f"{name} (seed {found.seed})",
        title=f"{name}{'' if planned else f' (seed {found.seed})'}\n"
        f"cost {digits(last['policy_cost'])}",
        study=study,
        policy=restore_policy(study, found),
        success_rate=float(last["success_rate"]),
        look=REFERENCE if planned else look(study),
    )


def _maps(shown: list[Shown], **options: Any) -> Figure:
    figure: Figure = SYSTEMS[shown[0].study.task.env_id].policies(shown, **options)
    return figure
