"""The figures of swarms of moving agents, chapter 6."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, median
from acl_gym.experiments.study import Experiment
from acl_gym.experiments.swarms.measures import late_speed, least_values, size_swing
from acl_gym.experiments.swarms.study import SwarmStudy
from acl_gym.plotting import style
from acl_gym.plotting.intervals import draw_points
from acl_gym.plotting.style import BLACK, BLUE, GREEN, ORANGE
from acl_gym.utils.typing import FloatArray

_ROUNDING = 1e-15
"""Drifts and speeds below this are rounding, and are drawn here: a logarithmic axis has
no 0."""

_ROW = 0.21
"""Inches, the height of a row of points."""


def centre(experiment: Experiment[SwarmStudy], results: Results) -> Figure:
    """Drift, size and parts at the end: a row for each channel."""
    studies = experiment.studies
    figure, axes = _shared_rows(3, list(studies), 1.1)
    for ax, measure, title in zip(
        axes,
        ("drift", "rms", "parts"),
        ("drift of the centre", "rms distance", "number of parts"),
        strict=True,
    ):
        for place, study in enumerate(studies.values()):
            values = np.maximum(results.last(study, measure), _ROUNDING)
            symmetric = results.values(study, "drift").max() < 1e-12
            _row(ax, place, values, BLUE if symmetric else ORANGE)
        ax.set_xlabel(title)
    axes[0].set_xscale("log")
    axes[2].set_xscale("log")
    style.plain_log(axes[2].xaxis)
    return figure


def delays(experiment: Experiment[SwarmStudy], results: Results) -> Figure:
    """Speed, swing of the size and parts in the end: a row for each delay."""
    figure, axes = _shared_rows(3, list(experiment.studies), 1.2)
    for place, study in enumerate(experiment.studies.values()):
        columns = (
            late_speed(results, study),
            100 * size_swing(results, study),
            results.last(study, "parts"),
        )
        for ax, values in zip(axes, columns, strict=True):
            _row(ax, place, np.maximum(values, _ROUNDING), BLUE)
    for ax, name, limit in zip(
        axes,
        ("speed of the centre (1/s)", "swing of the size (%)", "number of parts"),
        (0.01, 5.0, None),
        strict=True,
    ):
        ax.set_xlabel(name)
        ax.set_xscale("log")
        if limit is not None:
            ax.axvline(limit, **style.BOUND)
    axes[1].xaxis.set_major_locator(LogLocator(numticks=4))
    style.plain_log(axes[2].xaxis)
    return figure


def foraging(experiment: Experiment[SwarmStudy], results: Results) -> Figure:
    """How far agents and centre end from the goal: a panel for each profile."""
    groups: Mapping[str, Mapping[str, SwarmStudy]] = experiment.options["rows"]
    figure, axes = _shared_rows(
        len(groups), list(next(iter(groups.values()))), 1.5, 2 * _ROW
    )
    for ax, (profile, row) in zip(axes, groups.items(), strict=True):
        for place, study in enumerate(row.values()):
            _row(ax, place - 0.15, results.last(study, "miss"), BLUE)
            centre_miss = results.last(study, "centre_miss")
            _row(ax, place + 0.2, centre_miss, ORANGE, hollow=True)
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(numticks=4))
        style.plain_numbers(ax.xaxis)
        ax.set_title(profile)
        ax.set_xlabel("distance from the goal")
    handles = [
        Line2D([], [], color=BLUE, marker="o", linestyle="", label="agents, rms"),
        Line2D(
            [],
            [],
            color=ORANGE,
            marker="o",
            linestyle="",
            label="their centre",
            **_HOLLOW,
        ),
    ]
    style.legend(figure, handles)
    return figure


def optimum(experiment: Experiment[SwarmStudy], results: Results) -> Figure:
    """The least values of the runs: a panel for each function, a row for each channel."""
    groups: Mapping[str, Mapping[str, SwarmStudy]] = experiment.options["rows"]
    figure, axes = _shared_rows(len(groups), list(next(iter(groups.values()))), 1.2)
    for ax, (function, row) in zip(axes, groups.items(), strict=True):
        for place, (label, study) in enumerate(row.items()):
            values = least_values(results, study)
            color = _color_of(label)
            draw_points(ax, values, np.full(len(values), place), color, "o")
            middle = float(median(values))
            ax.plot(
                [middle] * 2, [place - 0.35, place + 0.35], color=color, linewidth=2
            )
        ax.set_xscale("log")
        ax.set_title(function)
        ax.minorticks_off()
        ax.xaxis.set_major_locator(LogLocator(numticks=3))
    return figure


def least_values_over_time(
    experiment: Experiment[SwarmStudy], results: Results
) -> Figure:
    """The least value over the evaluations: a line for each study."""
    figure = style.new_figure(3.4)
    ax = figure.subplots()
    looks = [(BLUE, "-"), (BLUE, "--"), (ORANGE, "-"), (ORANGE, "--"), (GREEN, "-")]
    looks.append((BLACK, ":"))
    handles = []
    for (color, dashes), (label, study) in zip(
        looks, experiment.studies.items(), strict=True
    ):
        line: dict[str, Any] = {"color": color, "linestyle": dashes, "linewidth": 1.3}
        values = results.values(study, "value")
        style.draw_band(ax, np.array(study.curve_points()), values, line, alpha=0.1)
        handles.append(Line2D([], [], label=label, **line))
    ax.set_yscale("log")
    ax.set_xlim(left=0)
    ax.set_xlabel("evaluations")
    ax.set_ylabel("least value so far")
    style.legend(figure, handles, ncols=2)
    return figure


def colonies(experiment: Experiment[SwarmStudy], results: Results) -> Figure:
    """The levels of a swarm over those of `ACL.learn`: a panel for each study."""
    count = len(experiment.studies)
    figure, axes = style.small_multiples(count, count, 1.9)
    for ax, (label, study) in zip(axes, experiment.studies.items(), strict=True):
        learned, swarm = results.runs(study)[0].table.reshape(2, -1)
        ends = [learned.min(), learned.max()]
        ax.plot(ends, ends, **style.BOUND)
        draw_points(ax, learned, swarm, BLUE, "o", markersize=3)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_title(label.replace(", ", "\n"))
        ax.set_box_aspect(1)
    style.label_outer(axes, count, "level, ACL.learn", "level, swarm")
    return figure


_HOLLOW: dict[str, Any] = {"markerfacecolor": "white"}


def _color_of(channel: str) -> str:
    """Of topologies, losses, delays; and of no messages at all."""
    if channel == "nobody":
        return BLACK
    ends = {"lost": ORANGE, "late": GREEN}
    return ends.get(channel.rpartition(" ")[2], BLUE)


def _shared_rows(
    count: int, labels: Sequence[str], room: float, height: float = _ROW
) -> tuple[Figure, list[Axes]]:
    """Panels side by side that share a row for each label."""
    figure = style.new_figure(room + height * len(labels))
    axes = list(figure.subplots(1, count, sharey=True))
    axes[0].set_yticks(range(len(labels)), labels)
    axes[0].set_ylim(len(labels) - 0.4, -0.6)
    return figure, axes


def _row(
    ax: Axes, place: float, values: FloatArray, color: str, hollow: bool = False
) -> None:
    """The runs as points, and the interquartile mean with its interval."""
    draw_points(ax, values, np.full(len(values), place), color, "o")
    found = estimate(values)
    ends = np.nan_to_num(np.array([[found.low], [found.high]]) - found.value)
    ax.errorbar(
        *([found.value], [place]),
        xerr=np.abs(ends),
        color=color,
        marker="o",
        markersize=4.5,
        **(_HOLLOW if hollow else {}),
    )
