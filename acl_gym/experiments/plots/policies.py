"""Which policies are drawn; the modules of the systems say how."""

from __future__ import annotations

from dataclasses import replace

from matplotlib.figure import Figure

from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.plots.looks import in_symbols, look_of
from acl_gym.experiments.references import reference
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment, Study
from acl_gym.plotting import Shown, draw_policies, draw_trajectories
from acl_gym.utils.text import digits


def policies(experiment: Experiment, results: Results) -> Figure:
    """The last policy of each study's run with the cheapest one."""
    return draw_policies(best(experiment, results), paths=True)


def baseline(experiment: Experiment, results: Results) -> Figure:
    """The policy of each reference, which dynamic programming has found."""
    shown = []
    for label, study in experiment.references.items():
        discount = results.last(study, "discount")[0]
        shown.append(_shown(f"{label}, discount {discount:g}", study, results, 0))
    return draw_policies(shown, paths=True)


def policy_maps(experiment: Experiment, results: Results) -> Figure:
    """The reference, and the last policy of the median run of each study."""
    return draw_policies(_with_reference(experiment, results))


def swing(experiment: Experiment, results: Results) -> Figure:
    """The pendulum swung up from rest by the policies of `policies`."""
    return draw_trajectories(best(experiment, results))


def trajectories(experiment: Experiment, results: Results) -> Figure:
    """What the policies of `policy_maps` do."""
    return draw_trajectories(_with_reference(experiment, results))


def best(experiment: Experiment, results: Results) -> list[Shown]:
    """The last policy of each study's run with the cheapest one."""
    return [
        _shown(label, study, results, results.best_run(study))
        for label, study in experiment.studies.items()
    ]


def _with_reference(experiment: Experiment, results: Results) -> list[Shown]:
    known = reference(experiment, results)
    name, symbol = (
        ("Optimum", "J* =") if known.optimal else ("Best policy known", "cost")
    )
    if known.study is None:
        raise ValueError("there is no policy of a reference; leave this figure out.")
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
    return Shown(
        label,
        f"{label}\ncost {digits(last['policy_cost'])}",
        study.task.make_system_env(1),
        restore_policy(study, found),
        float(last["success_rate"]),
        look_of(study).line,
    )
