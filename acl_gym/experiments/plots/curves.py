"""Costs and other measures as learning goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from acl_gym.experiments.plots.dots import draw_strips
from acl_gym.experiments.plots.looks import cost_line, in_symbols, look_of
from acl_gym.experiments.plots.policies import best
from acl_gym.experiments.references import reference
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.systems import optimal_cost
from acl_gym.plotting import pendulum, style
from acl_gym.plotting.learning import AXES, draw_learning_curves

NAMES = {
    "policy_cost": "policy cost $J^h$",
    "ants_cost": "cost of the ants",
    "policy_variation": "policy variation",
    "sensitivity": "sensitivity",
}
_MEAN: dict[str, Any] = {"color": style.BLACK, "linewidth": 1.0}
_OPTIMUM: dict[str, Any] = {"color": style.BLUE, "linewidth": 0.9, "linestyle": "--"}
_HIGHEST = 10
"""Times the reference: the first policies cost far more than what matters."""


def bands(experiment: Experiment, results: Results) -> Figure:
    """Policy cost, or `options["measure"]`, over the trials: a panel for each study."""
    measure = experiment.options.get("measure", "policy_cost")
    studies = experiment.studies
    columns = experiment.options.get("columns", {1: 1, 2: 2, 4: 2}.get(len(studies), 3))
    alike = len({study.trials for study in studies.values()}) == 1
    shown = [(label, study, measure) for label, study in studies.items()]
    figure = _panels(experiment, results, shown, columns, sharex=alike, sharey=True)
    figure.supylabel(NAMES[measure])
    return figure


def measures(experiment: Experiment, results: Results) -> Figure:
    """The other measures of §3.6.1 over the trials: a row for each study."""
    shown = [
        (f"{NAMES[measure]}, {label}", study, measure)
        for label, study in experiment.studies.items()
        for measure in ("ants_cost", "policy_variation", "sensitivity")
    ]
    figure = _panels(experiment, results, shown, 3, sharex=True, sharey="col")
    for ax in figure.axes:
        ax.set_title(ax.get_title(loc="left"), fontsize="medium")
    return figure


def _panels(
    experiment: Experiment,
    results: Results,
    shown: list[tuple[str, Study, str]],
    columns: int,
    **sharing: Any,
) -> Figure:
    """A panel for each title, study and measure, those of a column with one scale."""
    figure, axes = style.small_multiples(len(shown), columns, 1.7, **sharing)
    for ax, (title, study, measure) in zip(axes, shown, strict=True):
        _band(ax, study, results, measure)
        ax.set_title(in_symbols(title))
    for ax, (_, _, measure) in zip(axes[:columns], shown, strict=False):
        _scale(ax, measure)
    style.label_outer(axes, columns, "trial")
    style.legend(figure, _handles(experiment, results, measure))
    return figure


def bands_and_policies(experiment: Experiment, results: Results) -> Figure:
    """Policy cost over the trials above, a policy of the pendulum below."""
    shown = best(experiment, results)
    figure = style.new_figure(4.6)
    axes = figure.subplots(2, len(shown), sharey="row", squeeze=False)
    studies = experiment.studies.values()
    for above, below, each, study in zip(*axes, shown, studies, strict=True):
        _band(above, study, results)
        above.set_title(each.label.partition(" (")[0])
        above.set_xlabel("trial")
        pendulum.draw_policy(below, each.env, each.policy)
        below.set_title(each.title)
        below.set_xlabel(pendulum.THETA)
    _scale(axes[0, 0], "policy_cost")
    axes[0, 0].set_ylabel(NAMES["policy_cost"])
    axes[1, 0].set_ylabel(pendulum.OMEGA)
    handles = pendulum.handles(shown[0].env)
    style.legend(figure, [*_handles(experiment, results), *handles])
    return figure


def _band(
    ax: Axes, study: Study, results: Results, measure: str = "policy_cost"
) -> None:
    values = results.values(study, measure)
    trials = np.arange(1, values.shape[1] + 1)
    if measure.endswith("cost"):
        ax.set_yscale("log")
    style.draw_band(ax, trials, values, _MEAN, centre=np.mean, alpha=0.2)
    optimum = optimal_cost(study)
    if measure == "policy_cost" and optimum is not None:
        ax.axhline(optimum, **_OPTIMUM)
    ax.set_xlim(0, trials[-1])


def _scale(ax: Axes, measure: str) -> None:
    if measure.endswith("cost"):
        style.plain_log(ax.yaxis)
    else:
        ax.set_ylim(bottom=0.0)


def _handles(
    experiment: Experiment, results: Results, measure: str = "policy_cost"
) -> list[Any]:
    studies = list(experiment.studies.values())
    label = f"mean of {len(results.runs(studies[0]))} runs"
    handles: list[Any] = [
        Line2D([], [], **_MEAN, label=label),
        Patch(color="0.8", label="from the lowest to the highest"),
    ]
    if measure == "policy_cost" and any(map(optimal_cost, studies)):
        handles.append(Line2D([], [], **_OPTIMUM, label="optimal cost"))
    return handles


def race(experiment: Experiment, results: Results) -> Figure:
    """Policy cost over interactions and over seconds, and the last policies."""
    known, studies = reference(experiment, results), experiment.studies.values()
    figure = style.new_figure(3.2)
    steps, seconds, last = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 0.8))
    seconds.sharey(steps)
    for ax, x in ((steps, "env_steps"), (seconds, "seconds")):
        _curves(ax, experiment, results, x, spans=((0.0, 1.0), (0.25, 0.75)))
        ax.axhline(known.cost, **style.BOUND)
    draw_strips(last, [(look_of(study), study) for study in studies], results)
    last.axhline(known.cost, **style.BOUND)  # its own scale: costs are close together
    last.set_xlabel("last policies")
    style.plain_log(last.yaxis)
    steps.set_ylabel(NAMES["policy_cost"])
    steps.set_ylim(bottom=known.cost / 1.4)  # room for the name of the line
    style.plain_log(steps.yaxis)
    seconds.tick_params(labelleft=False)
    cost_line(steps, known)
    return figure


def learning_curves(experiment: Experiment, results: Results) -> Figure:
    """Policy cost over interactions and seconds, at the time and best so far."""
    known = reference(experiment, results)
    figure, axes = style.small_multiples(4, 2, 2.3, sharex="col", sharey=True)
    for place, ax in enumerate(axes):
        x = list(AXES)[place % 2]
        _curves(ax, experiment, results, x, best_so_far=place > 1)
        cost_line(ax, known)
    for ax in axes[:2]:
        ax.set_xlabel("")
    highest = min(axes[0].get_ylim()[1], _HIGHEST * known.cost)
    axes[0].set_ylim(0.85 * known.cost, max(highest, 1.2 * known.cost))
    style.plain_log(axes[0].yaxis)
    axes[0].set_ylabel("cost of the policy at the time")
    axes[2].set_ylabel("cost of the best policy so far")
    return figure


def returns(experiment: Experiment, results: Results) -> Figure:
    """The return of the policy over interactions and seconds."""
    figure, axes = style.small_multiples(2, 2, 2.6, sharey=True)
    studies = experiment.studies
    logs = {
        name: [
            run.rows.assign(policy_cost=-run.rows["policy_cost"])
            for run in results.runs(study)
        ]
        for name, study in studies.items()
    }
    lines = [look_of(study).line for study in studies.values()]
    for x, ax in zip(AXES, axes, strict=True):
        draw_learning_curves(ax, logs, lines, x, yscale="linear")
    axes[0].set_ylabel("return of the policy")
    return figure


def _curves(
    ax: Axes, experiment: Experiment, results: Results, x: str, **options: Any
) -> None:
    """Policy costs over `x` for each study, and a legend of the figure."""
    studies = experiment.studies
    logs = {name: [run.rows for run in results.runs(studies[name])] for name in studies}
    lines = [look_of(study).line for study in studies.values()]
    draw_learning_curves(ax, logs, lines, x, **options)
