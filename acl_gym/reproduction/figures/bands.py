"""Measures over the trials: the mean of the runs, and the band from least to most."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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


def bands(experiment: Experiment, evidence: Evidence) -> Figure:
    """Small multiples, a panel a study, on one scale."""
    measure = experiment.options.get("measure", "policy_cost")
    count = len(experiment.studies)
    columns = experiment.options.get("columns", count if count < _FEW else 3)
    if count == _FEW:
        columns = 2
    rows = math.ceil(count / columns)
    figure = drawing.new_figure(0.55 + 1.7 * rows)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for ax, study in zip(axes.flat, experiment.studies, strict=False):
        draw_band(ax, study, evidence, measure)
        ax.set_title(study.label, fontsize=SMALL, loc="left")
    for ax in axes.flat[count:]:
        ax.remove()
    _finish(axes.flat[0], measure)
    figure.supxlabel("trial", fontsize=SMALL)
    figure.supylabel(NAMES[measure], fontsize=SMALL)
    return figure


def measures(experiment: Experiment, evidence: Evidence) -> Figure:
    """The other measures of §3.6.1, a row a study."""
    names = ("ants_cost", "policy_variation", "sensitivity")
    rows = len(experiment.studies)
    figure = drawing.new_figure(0.55 + 1.7 * rows)
    axes = figure.subplots(rows, len(names), sharex=True, sharey="col", squeeze=False)
    for line, study in zip(axes, experiment.studies, strict=True):
        for ax, name in zip(line, names, strict=True):
            draw_band(ax, study, evidence, name)
            ax.set_title(f"{NAMES[name]}, {study.label}", fontsize=TINY, loc="left")
    for ax, name in zip(axes[0], names, strict=True):
        _finish(ax, name)
    figure.supxlabel("trial", fontsize=SMALL)
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
    ax.fill_between(trials, low, high, color="0.8", linewidth=0)
    ax.plot(trials, values.mean(axis=0), color="black", linewidth=1.0)
    optimum = optimal_cost(study.setting)
    if measure == "policy_cost" and optimum is not None:
        ax.axhline(optimum, color="#0072B2", linewidth=0.9, linestyle="--")
    ax.set_xlim(0, trials[-1])


def optimal_cost(setting: Setting) -> float | None:
    """J* of a setting's system on its evaluation states, None where it is not known."""
    if setting.env_id == PENDULUM:
        return 38.5  # by value iteration on fine cells
    if setting.env_id in (GRID_1D, GRID_2D):
        from acl_gym.reproduction.claims.grids import optimal_grid_cost

        return optimal_grid_cost(setting)
    return None


def _finish(ax: Any, measure: str) -> None:
    if measure in _LOGARITHMIC:
        drawing.plain_log(ax.yaxis, sparse=True)
    else:
        ax.set_ylim(bottom=0.0)
