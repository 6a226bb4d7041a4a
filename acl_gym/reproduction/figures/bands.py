"""Measures over the trials: the mean of the runs, and the band from least to most."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from acl_gym.experiments import drawing
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import (
    GRID_1D,
    GRID_2D,
    PENDULUM,
    Experiment,
    Setting,
    Study,
)

NAMES = {
    "policy_cost": "policy cost $J^h$",
    "ants_cost": "cost of the ants",
    "policy_variation": "policy variation",
    "sensitivity": "sensitivity",
}
_LOGARITHMIC = ("policy_cost", "ants_cost")
_FEW = 4  # panels that stand in one row
_BAND: dict[str, Any] = {"color": "0.8", "linewidth": 0}
_MEAN: dict[str, Any] = {"color": "black", "linewidth": 1.0}
_OPTIMUM: dict[str, Any] = {"color": "#0072B2", "linewidth": 0.9, "linestyle": "--"}

_GREEK = {
    r"\balpha\b": "\N{GREEK SMALL LETTER ALPHA}",
    r"\bgamma\b": "\N{GREEK SMALL LETTER GAMMA}",
    r"\bepsilon\b": "\N{GREEK SMALL LETTER EPSILON}",
    r"\brho\b": "\N{GREEK SMALL LETTER RHO}",
    r"\btau0\b": r"$\\tau_0$",
    r"\bomega_max\b": r"$\\omega_{\\max}$",
}


def in_greek(label: str) -> str:
    """A label with its parameters as the thesis writes them."""
    for name, letter in _GREEK.items():
        label = re.sub(name, letter, label)
    return label


def band_handles(evidence: Evidence, studies: Sequence[Study], optimum: bool) -> Any:
    """What line and band stand for, and the optimum where one is drawn."""
    runs = len(evidence.runs(studies[0].setting))
    handles: list[Any] = [
        Line2D([], [], **_MEAN, label=f"mean of {runs} runs"),
        Patch(**_BAND, label="from the lowest to the highest"),
    ]
    if optimum and any(optimal_cost(each.setting) for each in studies):
        handles.append(Line2D([], [], **_OPTIMUM, label="optimal cost"))
    return handles


def bands(experiment: Experiment, evidence: Evidence) -> Figure:
    """Small multiples, a panel a study, on one scale."""
    measure = experiment.options.get("measure", "policy_cost")
    count = len(experiment.studies)
    columns = experiment.options.get("columns", count if count < _FEW else 3)
    if count == _FEW:
        columns = 2
    rows = math.ceil(count / columns)
    figure = drawing.new_figure(0.75 + 1.7 * rows)
    long = len({study.setting.trials for study in experiment.studies}) > 1
    axes = figure.subplots(
        *(rows, columns), sharex=not long, sharey=True, squeeze=False
    )
    for ax, study in zip(axes.flat, experiment.studies, strict=False):
        draw_band(ax, study, evidence, measure)
        ax.set_title(in_greek(study.label), fontsize=SMALL, loc="left")
    for ax in axes.flat[count:]:
        ax.remove()
    _finish(axes.flat[0], measure)
    for place in range(max(count - columns, 0), count):  # the lowest of each column
        axes.flat[place].set_xlabel("trial", fontsize=SMALL)
        axes.flat[place].tick_params(labelbottom=True)
    figure.supylabel(NAMES[measure], fontsize=SMALL)
    handles = band_handles(evidence, experiment.studies, measure == "policy_cost")
    drawing.legend(figure, handles, ncols=3, loc="outside lower center")
    return figure


def measures(experiment: Experiment, evidence: Evidence) -> Figure:
    """The other measures of §3.6.1, a row a study."""
    names = ("ants_cost", "policy_variation", "sensitivity")
    rows = len(experiment.studies)
    figure = drawing.new_figure(0.75 + 1.7 * rows)
    axes = figure.subplots(rows, len(names), sharex=True, sharey="col", squeeze=False)
    for line, study in zip(axes, experiment.studies, strict=True):
        for ax, name in zip(line, names, strict=True):
            draw_band(ax, study, evidence, name)
            title = in_greek(f"{NAMES[name]}, {study.label}")
            ax.set_title(title, fontsize=TINY, loc="left")
    for ax, name in zip(axes[0], names, strict=True):
        _finish(ax, name)
    for ax in axes[-1]:
        ax.set_xlabel("trial", fontsize=SMALL)
    handles = band_handles(evidence, experiment.studies, optimum=False)
    drawing.legend(figure, handles, ncols=2, loc="outside lower center")
    return figure


def draw_band(
    ax: Axes, study: Study, evidence: Evidence, measure: str = "policy_cost"
) -> None:
    """One study in one panel, with the optimal cost where it is known."""
    drawing.prepare(ax)
    values = evidence.rows(study.setting, measure)
    trials = np.arange(1, values.shape[1] + 1)
    low, high = values.min(axis=0), values.max(axis=0)
    if measure in _LOGARITHMIC:
        ax.set_yscale("log")
    ax.fill_between(trials, low, high, **_BAND)
    ax.plot(trials, values.mean(axis=0), **_MEAN)
    optimum = optimal_cost(study.setting)
    if measure == "policy_cost" and optimum is not None:
        ax.axhline(optimum, **_OPTIMUM)
    ax.set_xlim(0, trials[-1])


def optimal_cost(setting: Setting) -> float | None:
    """J* of a setting's system on its evaluation states, None where it is not known."""
    if setting.env_id == PENDULUM:
        # By value iteration on fine cells, for the bound on the velocity taken here.
        return None if "omega_max" in setting.env else 38.5
    if setting.env_id in (GRID_1D, GRID_2D):
        from acl_gym.reproduction.claims.exact import optimal_grid_cost

        return optimal_grid_cost(setting)
    return None


def _finish(ax: Any, measure: str) -> None:
    if measure in _LOGARITHMIC:
        drawing.plain_log(ax.yaxis, sparse=True)
    else:
        ax.set_ylim(bottom=0.0)
