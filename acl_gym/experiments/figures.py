"""The figures of a comparison, each a function of it."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullFormatter

from acl_gym.experiments import drawing, statistics, wording
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.storage import write_atomically

Comparison = dict[str, Any]

DPI = 300

_HIGHEST = 10  # times J*; the first policies cost far more than what matters
_LATEST = 1.3  # times the last arrival at the goal; what follows there is hovering

_OPTIMUM: dict[str, Any] = {
    "color": "0.75",
    "linewidth": 3.5,
    "linestyle": "-",
    "zorder": 1.5,
}
_ARRIVAL: dict[str, Any] = {
    "marker": "o",
    "markersize": 4,
    "zorder": 3,
    "clip_on": False,
}
_GOAL: dict[str, Any] = {
    "color": "#D55E00",
    "marker": "o",
    "markersize": 5,
    "markerfacecolor": "#F0E442",
    "linestyle": "",
}


def save_figures(comparison: Comparison, directory: Path) -> dict[str, Path]:
    """Draw every figure and write it as a PNG, whole or not at all.

    Args:
        comparison: all of it.
        directory: exists.

    Returns:
        The path of each figure, in the order in which to show them.
    """
    paths = {}
    for name, draw in FIGURES.items():
        buffer = io.BytesIO()
        draw(comparison).savefig(buffer, format="png", dpi=DPI)
        paths[name] = directory / f"{name}.png"
        write_atomically(paths[name], buffer.getvalue())
    return paths


def summary_dots(comparison: Comparison) -> Figure:
    """What each agent's policies cost, and when they came close to J*.

    Each agent has a row of medians over seeds with their intervals.
    """
    optimal_cost = comparison["reference"]["optimal_cost"]
    summary = statistics.summarise(comparison["runs"], optimal_cost)
    figure = drawing.new_figure(1.2 + 0.36 * len(summary))
    axes = figure.subplots(1, 3, sharey=True, width_ratios=(1.2, 1, 1))
    marks = statistics.MARKS
    close = (f"within {marks[0]}%", f"within {marks[1]}% of J*")
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
    drawing.optimal_cost_line(axes[0], optimal_cost, vertical=True)
    drawing.plain_log(axes[0].xaxis)
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
    optimal_cost = comparison["reference"]["optimal_cost"]
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
            drawing.optimal_cost_line(ax, optimal_cost)
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
    drawing.legend(figure, handles, ncols=len(handles), loc="outside upper center")
    return figure


def policy_maps(comparison: Comparison) -> Figure:
    """The last policy of each agent's median seed and the optimum, as pictures.

    White is the largest torque and black the smallest, as in the thesis.
    """
    pictures = _pictures(comparison)
    torques = comparison["torques"]
    order = np.argsort(torques)
    shade = np.argsort(order)  # of each action
    greys = [str(level) for level in np.linspace(0, 1, len(torques))]
    norm = BoundaryNorm(np.arange(len(torques) + 1) - 0.5, len(torques))
    # The circle closes: the first angle once more, a turn later.
    theta = np.array([*comparison["map_axes"]["theta"], 2 * math.pi])
    omega = np.array(comparison["map_axes"]["omega"])

    columns = min(3, len(pictures))
    rows = math.ceil(len(pictures) / columns)
    width = 0.4 + (drawing.WIDTH - 0.4) * columns / 3
    figure = drawing.new_figure(0.5 + 2.1 * rows, width)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for ax, (title, actions) in zip(axes.flat, pictures, strict=False):
        ax.pcolormesh(
            theta,
            omega,
            shade[np.pad(np.array(actions), ((0, 0), (0, 1)), mode="wrap")],
            cmap=ListedColormap(greys),
            norm=norm,
            shading="nearest",
            rasterized=True,
        )
        ax.plot(math.pi, 0.0, **_GOAL)
        ax.set_title(title, fontsize=SMALL)
        ax.set_xlim(0.0, 2 * math.pi)
        ax.set_ylim(omega[0], omega[-1])
        ax.tick_params(labelsize=TINY)
        drawing.multiples_of_pi(ax.xaxis)
        ax.yaxis.set_major_locator(MaxNLocator(6, steps=(1, 2, 3, 5, 10)))
    for ax in axes.flat[len(pictures) :]:
        ax.remove()
    for ax in axes[:, 0]:
        ax.set_ylabel(r"$\omega$ (rad/s)", fontsize=SMALL)
    for ax in axes.flat[len(pictures) - columns : len(pictures)]:
        ax.set_xlabel(r"$\theta$ (rad)", fontsize=SMALL)
        ax.tick_params(labelbottom=True)
    handles: list[Any] = [
        Patch(facecolor=grey, edgecolor="0.3", label=drawing.torque(torques[action]))
        for action, grey in zip(order, greys, strict=True)
    ]
    handles.append(Line2D([], [], **_GOAL, label="goal"))
    drawing.legend(figure, handles, ncols=len(handles), loc="outside lower center")
    return figure


def _pictures(comparison: Comparison) -> list[tuple[str, list[list[int]]]]:
    """Titles and maps of actions, `[n_omega][n_theta]`."""
    runs = _median_runs(comparison)
    reference = comparison["reference"]
    cells = " × ".join(map(str, reference["cells"]))
    pictures = [
        (
            f"{run['label']} (seed {run['seed']})\n"
            f"cost {wording.cost(run['rows'][-1]['policy_cost'])}",
            run["policy_map"],
        )
        for run in runs
    ]
    title = f"Optimum\nJ* = {wording.cost(reference['optimal_cost'])}, on {cells} cells"
    return [*pictures, (title, reference["policy_map"])]


def _median_runs(comparison: Comparison) -> list[dict[str, Any]]:
    groups = statistics.by_agent(comparison["runs"]).values()
    return [statistics.median_run(own) for own in groups]


def trajectories(comparison: Comparison) -> Figure:
    """The swing-up from rest: last policy of each agent's median seed, and optimum."""
    runs = _median_runs(comparison)
    drawn = [("Optimum", comparison["reference"]["trajectory"], _OPTIMUM)]
    for run in runs:
        name = f"{run['label']} (seed {run['seed']})"
        drawn.append((name, run["trajectory"], drawing.line(run["agent"])))
    figure = drawing.new_figure(5.0 + 0.22 * len(drawn))
    axes = figure.subplots(
        4, 1, sharex=True, height_ratios=(1.9, 1.5, 0.25 + 0.25 * len(drawn), 1.5)
    )
    for ax in axes:
        drawing.prepare(ax)
    for _, path, look in drawn:
        for ax, key in zip(axes[[0, 1, 3]], ("theta", "omega", "cost"), strict=True):
            ax.plot(path["time"], path[key], **look)
            if path["reached"]:
                last = path["time"][-1], path[key][-1]
                ax.plot(*last, **_ARRIVAL, color=look["color"])
    _torque_rows(axes[2], drawn, comparison["torques"])
    axes[2].set_yticks(range(len(drawn)), ["Optimum", *(r["label"] for r in runs)])

    arrived = [path for _, path, _ in drawn if path["reached"]]
    longest = max(path["time"][-1] for _, path, _ in drawn)
    latest = max((path["time"][-1] for path in arrived), default=longest)
    axes[3].set_xlim(0.0, min(_LATEST * latest, longest))
    dearest = max(p["cost"][-1] for p in arrived or [path for _, path, _ in drawn])
    axes[3].set_ylim(0.0, 1.1 * dearest)
    axes[0].set_ylabel(r"$\theta$ (rad)", fontsize=SMALL)
    axes[1].set_ylabel(r"$\omega$ (rad/s)", fontsize=SMALL)
    axes[3].set_ylabel("Cost so far", fontsize=SMALL)
    axes[3].set_xlabel("Time (s)", fontsize=SMALL)
    drawing.multiples_of_pi(axes[0].yaxis)
    lowest, highest = axes[0].get_ylim()
    for goal in (-math.pi, math.pi):
        if lowest <= goal <= highest:
            axes[0].axhline(goal, **drawing.BOUND)
            axes[0].annotate(
                "goal",
                (1.005, goal),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=TINY,
            )
    handles = [
        Line2D([], [], **look, label=f"{name}: {_ending(path)}")
        for name, path, look in drawn
    ]
    drawing.legend(figure, handles, ncols=2, loc="outside upper center")
    return figure


def _torque_rows(
    ax: Axes, drawn: list[tuple[str, dict[str, Any], Any]], torques: list[float]
) -> None:
    """A row for each trajectory, as high as the largest torque."""
    largest = max(map(abs, torques)) or 1.0
    for row, (_, path, look) in enumerate(drawn):
        time = np.array(path["time"])
        torque = np.array(path["torque"], dtype=np.float64)
        # The last torque holds until the last state; a step is drawn to there.
        torque = np.append(torque, torque[-1:])[: len(time)]
        height = row - 0.38 * torque / largest
        ax.fill_between(
            time, row, height, step="post", color=look["color"], alpha=0.35, linewidth=0
        )
        ax.plot(
            time, height, drawstyle="steps-post", color=look["color"], linewidth=1.0
        )
    ax.set_title(
        f"Torque, in each row from {drawing.torque(-largest)} to "
        f"{drawing.torque(largest)}",
        fontsize=TINY,
        loc="left",
        pad=2,
    )
    ax.set_ylim(len(drawn) - 0.4, -0.6)


def _ending(path: dict[str, Any]) -> str:
    time, cost = path["time"][-1], wording.cost(path["cost"][-1])
    if path["reached"]:
        return f"goal at {time:.1f} s, cost {cost}"
    return f"no goal in {time:.0f} s, cost {cost}"


FIGURES = {
    "summary": summary_dots,
    "learning_curves": learning_curves,
    "policy_maps": policy_maps,
    "trajectories": trajectories,
}
