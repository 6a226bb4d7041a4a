"""Costs and times as points: of each run, and estimates with their intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acl_gym.experiments.comparison.experiments import LABELS
from acl_gym.experiments.plots.looks import LOOKS, Look, cost_line, look_of
from acl_gym.experiments.references import MARKS, reference
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.tables import summarise
from acl_gym.plotting import style
from acl_gym.plotting.intervals import (
    Interval,
    draw_intervals,
    draw_pairs,
    draw_points,
)

_NARROW = 1.05
"""An axis spans more than this factor, so that nothing looks like much."""


def strips(experiment: Experiment, results: Results) -> Figure:
    """The cost of the last policy of each run: a panel for each of `options["rows"]`."""
    rows = experiment.options["rows"]
    figure, axes = style.small_multiples(len(rows), len(rows), 2.0)
    for ax, (label, row) in zip(axes, rows.items(), strict=True):
        draw_strips(ax, [(LOOKS[name], each) for name, each in row.items()], results)
        style.plain_log(ax.yaxis)
        ax.set_title(label.replace(", ", "\n", 1), fontsize="medium")
    axes[0].set_ylabel("cost of the last policy")
    _legend(figure, experiment)
    return figure


def draw_strips(
    ax: Axes, studies: Sequence[tuple[Look, Study]], results: Results
) -> None:
    """Each run's last cost beside the interquartile mean with its interval."""
    ax.set_yscale("log")
    costs = [results.last(study) for _, study in studies]
    for place, ((look, _), values) in enumerate(zip(studies, costs, strict=True)):
        spread = np.linspace(-0.28, 0.04, len(values)) if len(values) > 1 else [-0.12]
        draw_points(ax, place + np.asarray(spread), values, look.color, look.marker)
        draw_intervals(
            ax, [place + 0.24], [estimate(values)], look.marker, color=look.color
        )
    low, high = np.min(np.concatenate(costs)), np.max(np.concatenate(costs))
    if high < _NARROW * low:
        ax.set_ylim(low / _NARROW, high * _NARROW)
    ax.set_xlim(-0.6, len(studies) - 0.4)
    names = [look.short for look, _ in studies]
    ax.set_xticks(range(len(studies)), labels=names, rotation=90 * (len(names) > 5))


def sweep(experiment: Experiment, results: Results) -> Figure:
    """The last cost of each method over what `options["rows"]` vary."""
    rows, x = experiment.options["rows"], experiment.options["x"]
    figure = style.new_figure(3.2, 5.0)
    ax = figure.subplots()
    names = list(next(iter(rows.values())))
    for place, name in enumerate(names):
        # Side by side, so that intervals do not hide each other.
        at = np.array(x) * 1.06 ** (place - (len(names) - 1) / 2)
        costs = [results.last(row[name]) for row in rows.values()]
        look = LOOKS[name]
        for where, values in zip(at, costs, strict=True):
            draw_points(ax, np.full(len(values), where), values, look.color, "_")
        draw_intervals(
            ax, at, [estimate(each) for each in costs], look.marker, **look.line
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xticks(x, labels=list(map(str, x)))
    ax.minorticks_off()
    style.plain_log(ax.yaxis)
    ax.set_xlabel(experiment.options["xlabel"])
    ax.set_ylabel("cost of the last policy")
    _legend(figure, experiment)
    return figure


def order(experiment: Experiment, results: Results) -> Figure:
    """Last costs with the slots in reverse order over those in order."""
    pairs = experiment.options["pairs"]
    figure, axes = style.small_multiples(len(pairs), len(pairs), 2.4)
    for ax, (label, (forth, back)) in zip(axes, pairs.items(), strict=True):
        runs = min(len(results.runs(forth)), len(results.runs(back)))
        x, y = results.last(forth)[:runs], results.last(back)[:runs]
        low, high = min(x.min(), y.min()), max(x.max(), y.max())
        room = 0.08 * (high - low) or 0.01 * high
        ax.plot([low - room, high + room], [low - room, high + room], **style.BOUND)
        look = look_of(forth)
        draw_points(ax, x, y, look.color, look.marker, markersize=4, alpha=0.8)
        ax.set_aspect("equal")
        ax.set_title(label)
        ax.set_xlabel("cost, slots in order")
    axes[0].set_ylabel("cost, in reverse order")
    return figure


def _legend(figure: Figure, experiment: Experiment) -> None:
    handles = [
        Line2D([], [], marker=LOOKS[key].marker, **LOOKS[key].line, label=LABELS[key])
        for key in next(iter(experiment.options["rows"].values()))
    ]
    style.legend(figure, handles, ncols=min(4, len(handles)))


def summary(experiment: Experiment, results: Results) -> Figure:
    """Medians of costs, and of the time until policies were close to the reference."""
    known, entries = reference(experiment, results), summarise(experiment, results)
    colors = [look_of(study).color for study in experiment.studies.values()]
    figure = style.new_figure(1.3 + 0.36 * len(entries))
    axes = figure.subplots(1, 3, sharey=True, width_ratios=(1.2, 1, 1))
    axes[0].set_yticks(range(len(entries)), [entry["label"] for entry in entries])
    axes[0].set_ylim(len(entries) - 0.5, -0.7)
    close = [f"within {mark}%" for mark in MARKS]
    panels = (
        ("policy cost", "{}_policy_cost", ("final", "best"), ["last", "best policy"]),
        ("seconds of learning", "seconds_to_{}", MARKS, close),
        ("interactions", "env_steps_to_{}", MARKS, close),
    )
    for ax, (title, key, which, names) in zip(axes, panels, strict=True):
        ax.set_title(title, pad=21)
        pairs = [
            [Interval.of(entry[key.format(each)], entry["seeds"]) for each in which]
            for entry in entries
        ]
        draw_pairs(ax, pairs, colors, names)
    axes[0].set_xlim(left=0.94 * known.cost)
    cost_line(axes[0], known, vertical=True)
    style.plain_log(axes[0].xaxis)
    style.plain_numbers(axes[1].xaxis)
    return figure
