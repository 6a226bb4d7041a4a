"""Costs and times as points: of each run, and estimates with their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from acl_gym.experiments.comparison.experiments import LABELS
from acl_gym.experiments.plots.looks import LOOKS, Look, cost_line, look_of
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.tables import MARKS, reference, summarise
from acl_gym.plotting import style
from acl_gym.utils.typing import FloatArray

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
        _points(ax, place + np.asarray(spread), values, look)
        _estimates(ax, [place + 0.24], [values], look)
    low, high = np.min(np.concatenate(costs)), np.max(np.concatenate(costs))
    if high < _NARROW * low:
        ax.set_ylim(low / _NARROW, high * _NARROW)
    ax.set_xlim(-0.6, len(studies) - 0.4)
    ax.set_xticks(range(len(studies)), labels=[look.short for look, _ in studies])


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
        for where, values in zip(at, costs, strict=True):
            _points(ax, np.full(len(values), where), values, LOOKS[name], marker="_")
        _estimates(ax, at, costs, LOOKS[name], **LOOKS[name].line)
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
        _points(ax, x, y, look_of(forth), markersize=4, alpha=0.8)
        ax.set_aspect("equal")
        ax.set_title(label)
        ax.set_xlabel("cost, slots in order")
    axes[0].set_ylabel("cost, in reverse order")
    return figure


def _points(ax: Axes, x: Any, y: FloatArray, look: Look, **options: Any) -> None:
    """Values of runs, faintly."""
    options = {"marker": look.marker, "markersize": 2.5, "alpha": 0.45, **options}
    ax.plot(x, y, linestyle="", color=look.color, **options)


def _estimates(
    ax: Axes, x: Any, costs: list[FloatArray], look: Look, **line: Any
) -> None:
    """Interquartile means with their intervals."""
    value, low, high = np.array([estimate(each) for each in costs]).T
    ends = np.nan_to_num([value - low, high - value])
    line = {"color": look.color, "linestyle": "", "linewidth": 1.2, **line}
    ax.errorbar(x, value, ends, marker=look.marker, **line)


def _legend(figure: Figure, experiment: Experiment) -> None:
    handles = [
        Line2D([], [], marker=LOOKS[key].marker, **LOOKS[key].line, label=LABELS[key])
        for key in next(iter(experiment.options["rows"].values()))
    ]
    style.legend(figure, handles, ncols=len(handles))


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
        ax.set_xscale("log")
        ax.set_title(title, pad=21)
        ax.xaxis.set_minor_formatter(NullFormatter())
        rows = [
            (row + shift, entry[key.format(each)], entry["seeds"], color, shift < 0)
            for row, (entry, color) in enumerate(zip(entries, colors, strict=True))
            for each, shift in zip(which, (-0.16, 0.16), strict=True)
        ]
        for y, found, runs, color, hollow in rows:
            _draw_median(ax, y, found, runs, color, hollow=hollow)
        end = ax.get_xlim()[1]
        for y, found, _, color, _ in rows:  # of some runs there is no value
            if found["low"] is not None and found["high"] is None:
                ax.plot([found["low"], end], [y, y], color=color)
                ax.plot(end, y, color=color, marker=">", clip_on=False)
        ax.set_xlim(right=end)
        handles = [
            Line2D([], [], **_marker("0.3", hollow=hollow), label=name)
            for hollow, name in zip((True, False), names, strict=True)
        ]
        style.legend(
            *(ax, handles), ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.02),
            borderpad=0.0, borderaxespad=0.3, handlelength=1.0, handletextpad=0.4,
        )  # fmt: skip
    axes[0].set_xlim(left=0.94 * known.cost)
    cost_line(axes[0], known, vertical=True)
    style.plain_log(axes[0].xaxis)
    style.plain_numbers(axes[1].xaxis)
    return figure


def _draw_median(
    ax: Axes, y: float, found: dict[str, Any], runs: int, color: str, *, hollow: bool
) -> None:
    """A median and its interval; beside the panel how many runs have a value if few."""
    if found["low"] is not None and found["high"] is not None:
        ax.plot([found["low"], found["high"]], [y, y], color=color)
    if found["median"] is not None:
        ax.plot(found["median"], y, **_marker(color, hollow=hollow))
    reached = found.get("reached", runs)
    if reached < runs:
        text = f"{reached} of {runs}" if reached else "never"
        place: Any = {"transform": ax.get_yaxis_transform(), "va": "center"}
        ax.text(1.02, y, text, fontsize="small", color="0.3", **place)


def _marker(color: str, *, hollow: bool) -> dict[str, Any]:
    look = {"marker": "o", "linestyle": "", "markersize": 5, "markeredgewidth": 1.2}
    return {"color": color, "markerfacecolor": "white" if hollow else color, **look}
