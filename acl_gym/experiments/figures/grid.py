"""Grids: the action of each method in each cell, over what it costs from there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from acl_gym.experiments import drawing
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.experiments.figures.policies import median_runs, reference_title, run_title

Comparison = dict[str, Any]

_WALL, _LINE = "0.25", "0.85"
BEST, OTHER = "0.1", "#D55E00"
SHADES = LinearSegmentedColormap.from_list("cost", ["#FFFFFF", "#9CC3DE"])
NEVER: dict[str, Any] = {
    "facecolor": "#F6D8C6",
    "hatch": "////",
    "edgecolor": "#DDA98B",
}
GOAL: dict[str, Any] = {
    "color": "#009E73",
    "marker": "o",
    "markersize": 5,
    "linestyle": "",
}


def policy_maps(comparison: Comparison) -> Figure:
    """The optimum, and the last policy of each method's median seed, as arrows."""
    scene, reference = comparison["scene"], comparison["reference"]
    panels = [(reference_title(reference), reference["picture"])]
    panels += [(run_title(run), run["picture"]) for run in median_runs(comparison)]
    longest = max(filter(None, reference["picture"]["cost_to_go"]), default=1.0)
    norm = Normalize(0.0, longest, clip=True)
    rows, columns = len(scene["rows"]), len(scene["rows"][0])
    is_strip = rows == 1
    if is_strip:
        shape = (len(panels), 1)
        figure = drawing.new_figure(0.75 + 0.52 * len(panels))
    else:
        shape = (math.ceil(len(panels) / 3), min(3, len(panels)))
        width = 0.6 + (drawing.WIDTH - 0.6) * shape[1] / 3
        height = (width - 0.6) / shape[1] * rows / columns
        figure = drawing.new_figure(0.35 + (height + 0.35) * shape[0], width)
    axes = figure.subplots(*shape, squeeze=False)
    for ax, (title, picture) in zip(axes.flat, panels, strict=False):
        draw_policy(ax, scene, picture, norm)
        if is_strip:
            ax.set_ylabel(title, fontsize=SMALL, rotation=0, ha="right", va="center")
        else:
            ax.set_title(title, fontsize=SMALL)
    for ax in axes.flat[len(panels) :]:
        ax.remove()
    shades = figure.colorbar(
        ScalarMappable(norm, SHADES),
        ax=list(axes.flat[: len(panels)]),
        shrink=0.8,
        pad=0.01,
        aspect=16 if is_strip else 30,
    )
    shades.set_label("Cost until the goal", fontsize=SMALL)
    shades.ax.tick_params(labelsize=TINY)
    shades.outline.set_visible(False)
    handles: list[Any] = [
        arrow_handle(BEST, "a best action"),
        arrow_handle(OTHER, "another action"),
        Patch(**NEVER, label="from here never to the goal"),
        Line2D([], [], **GOAL, label="goal"),
    ]
    drawing.legend(figure, handles, ncols=4, loc="outside lower center")
    return figure


def draw_policy(
    ax: Axes, scene: dict[str, Any], picture: dict[str, Any], norm: Normalize
) -> None:
    """An arrow a cell, over what the policy costs from there."""
    rows, columns = len(scene["rows"]), len(scene["rows"][0])
    cells = np.array(scene["cells"])
    shown = np.full((rows, columns), np.nan)
    for (row, column), cost in zip(cells, picture["cost_to_go"], strict=True):
        if cost is None:
            corner = (column - 0.5, row - 0.5)
            ax.add_patch(Rectangle(corner, 1, 1, **NEVER, linewidth=0))
        else:
            shown[row, column] = cost
    shades = ax.imshow(shown, cmap=SHADES, norm=norm)
    shades.set_zorder(0.5)
    for row, text in enumerate(scene["rows"]):
        for column, character in enumerate(text):
            if character == "#":
                wall = Rectangle((column - 0.5, row - 0.5), 1, 1, color=_WALL)
                ax.add_patch(wall)
    lines: dict[str, Any] = {"color": _LINE, "linewidth": 0.5, "zorder": 0.6}
    ax.vlines(np.arange(columns - 1) + 0.5, -0.5, rows - 0.5, **lines)
    ax.hlines(np.arange(rows - 1) + 0.5, -0.5, columns - 0.5, **lines)
    ax.plot(*cells[scene["goals"]].T[::-1], **GOAL)

    starts = np.setdiff1d(np.arange(len(cells)), scene["goals"])
    actions = np.array(picture["policy_map"])[starts]
    steps = np.array(scene["directions"])[actions]
    best = scene["optimal_actions"]
    colors = [
        BEST if action in best[state] else OTHER
        for state, action in zip(starts, actions, strict=True)
    ]
    ax.quiver(
        *cells[starts].T[::-1],
        *steps.T[::-1],
        color=colors,
        angles="xy",
        scale_units="xy",
        scale=1.5,
        pivot="mid",
        units="xy",
        width=0.1,
        headwidth=3.6,
        headlength=3.6,
        headaxislength=3.2,
        zorder=3,
    )
    ax.set_xlim(-0.5, columns - 0.5)
    ax.set_ylim(rows - 0.5, -0.5)
    ax.set_xticks([])
    ax.set_yticks([])
    ax.spines[:].set_color("0.4")


def arrow_handle(color: str, label: str) -> Line2D:
    """Of the legend: an arrow."""
    return Line2D(
        [],
        [],
        color=color,
        marker=r"$\rightarrow$",
        markersize=8,
        linestyle="",
        label=label,
    )
