"""The pendulum: policies over angle and velocity, and the swing-up from rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from acl_gym.experiments import drawing, wording
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.experiments.figures.policies import median_runs, run_title

Comparison = dict[str, Any]

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
GOAL: dict[str, Any] = {
    "color": "#D55E00",
    "marker": "o",
    "markersize": 5,
    "markerfacecolor": "#F0E442",
    "linestyle": "",
}


def policy_maps(comparison: Comparison) -> Figure:
    """The last policy of each agent's median seed and the optimum, as pictures.

    White is the largest torque and black the smallest, as in the thesis.
    """
    pictures = _pictures(comparison)
    torques = comparison["scene"]["torques"]
    order = np.argsort(torques)
    shade = np.argsort(order)  # of each action
    greys = [str(level) for level in np.linspace(0, 1, len(torques))]
    norm = BoundaryNorm(np.arange(len(torques) + 1) - 0.5, len(torques))
    # The circle closes: the first angle once more, a turn later.
    theta = np.array([*comparison["scene"]["theta"], 2 * math.pi])
    omega = np.array(comparison["scene"]["omega"])

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
        ax.plot(math.pi, 0.0, **GOAL)
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
    handles.append(Line2D([], [], **GOAL, label="goal"))
    drawing.legend(figure, handles, ncols=len(handles), loc="outside lower center")
    return figure


def _pictures(comparison: Comparison) -> list[tuple[str, list[list[int]]]]:
    """Titles and maps of actions, `[n_omega][n_theta]`."""
    reference = comparison["reference"]
    cells = " × ".join(map(str, reference["cells"]))
    pictures = [
        (run_title(run), run["picture"]["policy_map"])
        for run in median_runs(comparison)
    ]
    title = f"Optimum\nJ* = {wording.cost(reference['optimal_cost'])}, on {cells} cells"
    return [*pictures, (title, reference["picture"]["policy_map"])]


def trajectories(comparison: Comparison) -> Figure:
    """The swing-up from rest: last policy of each agent's median seed, and optimum."""
    runs = median_runs(comparison)
    drawn = [("Optimum", comparison["reference"]["picture"]["trajectory"], _OPTIMUM)]
    for run in runs:
        name = f"{run['label']} (seed {run['seed']})"
        drawn.append((name, run["picture"]["trajectory"], drawing.line(run["agent"])))
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
    _torque_rows(axes[2], drawn, comparison["scene"]["torques"])
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
