"""The navigation: forces at rest, and ways to the goal, over the damping."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import MultipleLocator

from acl_gym.experiments import drawing, wording
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.experiments.figures.policies import median_runs, reference_title, run_title

Comparison = dict[str, Any]
Picture = dict[str, Any]

_COLUMNS = 3
_DAMPING = LinearSegmentedColormap.from_list("damping", ["#FFFFFF", "#8A929E"], N=14)
_DARK = "#B9BEC6"  # of the legend
_GOAL = "#009E73"
_FORCE = "#1F2A36"
_REFERENCE = "0.1"


def policy_maps(comparison: Comparison) -> Figure:
    """The force at rest over the plane: the best policy known, and each method's."""
    panels = [
        (reference_title(comparison["reference"]), comparison["reference"]["picture"]),
        *((run_title(run), run["picture"]) for run in median_runs(comparison)),
    ]

    def draw(ax: Axes, number: int) -> None:
        title, picture = panels[number]
        draw_forces(ax, comparison["scene"], picture)
        ax.set_title(title, fontsize=SMALL)

    figure = small_multiples(comparison["scene"], len(panels), draw)
    handles = [
        Line2D(
            *([], []),
            color=_FORCE,
            marker=r"$\rightarrow$",
            markersize=8,
            linestyle="",
            label="force",
        ),
        Line2D(
            *([], []),
            color=_FORCE,
            marker=".",
            markersize=3,
            linestyle="",
            label="none",
        ),
        *shared_handles(),
    ]
    drawing.legend(figure, handles, ncols=4, loc="outside lower center")
    return figure


def trajectories(comparison: Comparison) -> Figure:
    """Ways from corners and edges, at rest: the best policy known, each method's."""
    reference = comparison["reference"]
    panels = [(reference_title(reference).split("\n")[0], reference["picture"], None)]
    panels += [
        (f"{run['label']} (seed {run['seed']})", run["picture"], run["agent"])
        for run in median_runs(comparison)
    ]

    def draw(ax: Axes, number: int) -> None:
        title, picture, agent = panels[number]
        color = _REFERENCE if agent is None else drawing.style(agent).color
        paths = picture["trajectories"]
        for path in paths:
            draw_path(ax, path, color)
        arrived = sum(path["reached"] for path in paths)
        cost = wording.cost(sum(path["cost"] for path in paths) / len(paths))
        ending = f"arrives {arrived} of {len(paths)} times, mean cost {cost}"
        ax.set_title(f"{title}\n{ending}", fontsize=SMALL)

    figure = small_multiples(comparison["scene"], len(panels), draw)
    handles = [
        Line2D([], [], **end("0.2", reached=True), label="arrived at the goal"),
        Line2D([], [], **end("0.2", reached=False), label="time was up"),
        *shared_handles(),
    ]
    drawing.legend(figure, handles, ncols=4, loc="outside lower center")
    return figure


def small_multiples(
    scene: dict[str, Any],
    count: int,
    draw: Callable[[Axes, int], None],
    columns: int = _COLUMNS,
) -> Figure:
    """So many panels of the plane, its damping and its goal; `draw` adds to each."""
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    width = 0.4 + (drawing.WIDTH - 0.4) * columns / _COLUMNS
    figure = drawing.new_figure(0.6 + 2.45 * rows, width)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    largest = scene["position_max"]
    extent = (-largest, largest, -largest, largest)
    for number, ax in enumerate(axes.flat):
        if number >= count:
            ax.remove()
            continue
        shades = ax.imshow(
            scene["damping"],
            origin="lower",
            extent=extent,
            cmap=_DAMPING,
            interpolation="bilinear",
        )
        shades.set_zorder(0.5)
        ax.add_patch(Polygon(scene["goal"], color=_GOAL, linewidth=0, zorder=1.5))
        draw(ax, number)
        margin = 1.04 * largest
        ax.set_xlim(-margin, margin)
        ax.set_ylim(-margin, margin)
        ax.set_aspect("equal")
        ax.tick_params(labelsize=TINY)
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(MultipleLocator(largest / 2))
        if number % columns == 0:
            ax.set_ylabel("$c_2$ (m)", fontsize=SMALL)
        if number >= columns * (rows - 1):
            ax.set_xlabel("$c_1$ (m)", fontsize=SMALL)
    return figure


def draw_forces(ax: Axes, scene: dict[str, Any], picture: Picture) -> None:
    """An arrow for the force at each position, a dot where there is none."""
    positions = np.array(scene["positions"])
    c1, c2 = np.meshgrid(positions, positions)
    forces = np.array(scene["forces"])[np.array(picture["policy_map"])]
    u1, u2 = forces[..., 0], forces[..., 1]
    none = (u1 == 0) & (u2 == 0)
    spacing = positions[1] - positions[0]
    largest = np.hypot(u1, u2).max() or 1.0
    ax.quiver(
        *(c1[~none], c2[~none], u1[~none], u2[~none]),
        color=_FORCE,
        angles="xy",
        scale_units="xy",
        scale=largest / (0.95 * spacing),
        pivot="mid",
        units="xy",
        width=0.16 * spacing,
        headwidth=3.2,
        headlength=3.2,
        headaxislength=2.8,
        zorder=2,
    )
    ax.plot(
        *(c1[none], c2[none]),
        color=_FORCE,
        marker=".",
        markersize=1.5,
        linestyle="",
        zorder=2,
    )


def draw_path(ax: Axes, path: dict[str, Any], color: str) -> None:
    """A way, and whether it ends at the goal."""
    ax.plot(path["c1"], path["c2"], color=color, linewidth=1.1, zorder=2)
    ax.plot(path["c1"][-1], path["c2"][-1], **end(color, reached=path["reached"]))


def end(color: str, *, reached: bool) -> dict[str, Any]:
    """The marker at the end of a way."""
    return {
        "color": color,
        "marker": "o" if reached else "x",
        "markersize": 2.5 if reached else 4,
        "linestyle": "",
        "zorder": 3,
        "clip_on": False,
    }


def shared_handles() -> list[Any]:
    """Of the legend: damping and goal."""
    return [
        Patch(facecolor=_DARK, label="damping, darker is stronger"),
        Patch(facecolor=_GOAL, label="goal"),
    ]
