"""The figures that every system has: costs and times, learning curves."""

from __future__ import annotations

import math
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from acl_gym.experiments import drawing, statistics, wording
from acl_gym.experiments.drawing import SMALL, TINY

Comparison = dict[str, Any]

_HIGHEST = 10  # times J*; the first policies cost far more than what matters


def summary_dots(comparison: Comparison) -> Figure:
    """What each agent's policies cost, and when they came close to J*.

    Each agent has a row of medians over seeds with their intervals.
    """
    reference = comparison["reference"]
    optimal_cost = wording.reference_cost(reference)
    symbol = wording.symbol(reference)
    summary = statistics.summarise(comparison["runs"], optimal_cost)
    figure = drawing.new_figure(1.2 + 0.36 * len(summary))
    axes = figure.subplots(1, 3, sharey=True, width_ratios=(1.2, 1, 1))
    marks = statistics.MARKS
    of_it = " of J*" if symbol == "J*" else ""  # another name would be too long
    close = (f"within {marks[0]}%", f"within {marks[1]}%{of_it}")
    panels: tuple[tuple[str, str, tuple[Any, Any], tuple[str, str]], ...] = (
        (
            "Policy cost",
            "{}_policy_cost",
            ("final", "best"),
            ("last policy", "best policy"),
        ),
        ("Wall-clock time (s)", "seconds_to_{}", marks, close),
        ("Environment steps", "env_steps_to_{}", marks, close),
    )
    for ax, (title, key, which, names) in zip(axes, panels, strict=True):
        drawing.prepare(ax)
        ax.set_xscale("log")
        ax.set_title(title, fontsize=SMALL, loc="left", pad=19)
        keys = [key.format(name) for name in which]
        end = _horizon(ax, summary, keys)
        ax.xaxis.set_minor_formatter(NullFormatter())
        for row, entry in enumerate(summary):
            for shift, name in zip((-0.16, 0.16), keys, strict=True):
                _dot(ax, row + shift, entry, name, end=end, hollow=name == keys[0])
        handles = [
            Line2D([], [], **drawing.marker("0.3", hollow=hollow), label=name)
            for hollow, name in zip((True, False), names, strict=True)
        ]
        drawing.legend(
            ax,
            handles,
            ncols=2,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.03),
            borderpad=0.0,
            borderaxespad=0.3,
            handlelength=1.0,
            handletextpad=0.4,
        )
    axes[0].set_xlim(left=0.94 * optimal_cost)
    drawing.optimal_cost_line(axes[0], optimal_cost, symbol, vertical=True)
    drawing.plain_log(axes[0].xaxis, sparse=True)
    drawing.plain_numbers(axes[1].xaxis)
    axes[0].set_yticks(range(len(summary)), [entry["label"] for entry in summary])
    axes[0].set_ylim(len(summary) - 0.5, -0.7)
    return figure


def _horizon(ax: Axes, summary: list[dict[str, Any]], keys: list[str]) -> float:
    """Set the x limits; right of the value returned is where "never" is written."""
    estimates = [entry[key] for entry in summary for key in keys]
    finite = [
        each[end]
        for each in estimates
        for end in ("low", "median", "high")
        if each[end] is not None
    ]
    low, high = (min(finite), max(finite)) if finite else (1.0, 10.0)
    if "cost" not in keys[0] and high < 10 * low:
        # Whole powers of ten, so that the axis has ticks to read it by.
        low = 10.0 ** math.floor(math.log10(low))
        high = 10.0 ** (math.floor(math.log10(high)) + 1)
    margin = max(high / low, 1.5) ** 0.06
    end = high * margin
    unreached = any(
        entry[key].get("reached", entry["seeds"]) < entry["seeds"]
        for entry in summary
        for key in keys
    )
    ax.set_xlim(low / margin, end * margin**7 if unreached else end)
    return float(end)


def _dot(
    ax: Axes, y: float, entry: dict[str, Any], key: str, *, end: float, hollow: bool
) -> None:
    """Median and interval of one estimate; in words, how many seeds have no value."""
    estimate = entry[key]
    color = drawing.style(entry["agent"]).color
    if estimate["low"] is not None:
        open_ = estimate["high"] is None
        high = end if open_ else estimate["high"]
        ax.plot([estimate["low"], high], [y, y], color=color, linewidth=1.5)
        if open_:
            ax.plot(end, y, color=color, marker=">", markersize=4)
    if estimate["median"] is not None:
        ax.plot(estimate["median"], y, **drawing.marker(color, hollow=hollow))
    reached, seeds = estimate.get("reached", entry["seeds"]), entry["seeds"]
    if reached < seeds:
        ax.annotate(
            f"{reached} of {seeds}" if reached else "never",
            (0.99, y),
            xycoords=("axes fraction", "data"),
            va="center",
            ha="right",
            fontsize=TINY,
            color="0.3",
        )


def learning_curves(comparison: Comparison) -> Figure:
    """Policy cost against environment steps and seconds, at the time and best so far.

    Median over seeds, and from the least to the largest.
    """
    runs = statistics.by_agent(comparison["runs"])
    reference = comparison["reference"]
    optimal_cost = wording.reference_cost(reference)
    symbol = wording.symbol(reference)
    figure = drawing.new_figure(5.2)
    axes = figure.subplots(2, 2, sharex="col", sharey=True)
    columns: tuple[Literal["env_steps", "seconds"], ...] = ("env_steps", "seconds")
    highest = 1.2 * optimal_cost
    for row, best_so_far in zip(axes, (False, True), strict=True):
        for ax, x in zip(row, columns, strict=True):
            drawing.prepare(ax)
            ax.set_xscale("log")
            ax.set_yscale("log")
            for agent, own in runs.items():
                band = statistics.curve_band(own, x, best_so_far=best_so_far)
                look = drawing.line(agent)
                ax.fill_between(
                    band.x,
                    band.low,
                    band.high,
                    step="post",
                    color=look["color"],
                    alpha=0.18,
                    linewidth=0,
                )
                ax.plot(
                    band.x,
                    band.median,
                    drawstyle="steps-post",
                    label=own[0]["label"],
                    **look,
                )
                highest = max(highest, 1.1 * band.high.max())
            drawing.optimal_cost_line(ax, optimal_cost, symbol)
    drawing.plain_log(axes[0, 0].yaxis)
    axes[0, 0].set_ylim(0.85 * optimal_cost, min(highest, _HIGHEST * optimal_cost))
    axes[0, 0].set_ylabel("Cost of the policy at the time", fontsize=SMALL)
    axes[1, 0].set_ylabel("Cost of the best policy so far", fontsize=SMALL)
    axes[1, 0].set_xlabel("Environment steps", fontsize=SMALL)
    axes[1, 1].set_xlabel("Wall-clock time (s)", fontsize=SMALL)
    drawing.plain_numbers(axes[1, 1].xaxis)
    handles = [
        Line2D([], [], **drawing.line(agent), label=own[0]["label"])
        for agent, own in runs.items()
    ]
    width = len(handles) if len(handles) <= 5 else math.ceil(len(handles) / 2)
    drawing.legend(figure, handles, ncols=width, loc="outside upper center")
    return figure
