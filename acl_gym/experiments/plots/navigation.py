"""The navigation: forces at rest, and paths to the goal, over the damping."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import MultipleLocator

from acl_gym.envs.navigation.painter import goal_outline
from acl_gym.evaluation import actions_in, record_trajectory
from acl_gym.experiments.plots import parts
from acl_gym.experiments.plots.parts import Shown
from acl_gym.experiments.statistics import digits

_ARROWS = 25
"""Positions along an axis: three between neighbours of nine centres."""

_SHADES = 81
"""Positions along an axis where the damping is shown."""

_DAMPING = LinearSegmentedColormap.from_list("damping", ["#FFFFFF", "#8A929E"], N=14)
_FORCE = "#1F2A36"


def policies(shown: list[Shown], paths: bool = False) -> Figure:
    """The force at rest over the plane; on request a panel with paths beside it."""
    columns = 2 if paths else min(len(shown), 3)
    figure, axes = _planes(shown, columns, 1 + paths)
    for ax, each in zip(axes[:: 1 + paths], shown, strict=True):
        _draw_forces(ax, each)
        ax.set_title(each.title)
    for ax, each in zip(axes[1::2] if paths else [], shown, strict=paths):
        _draw_paths(ax, each)
        ax.set_title(
            "paths of vehicles that start at rest\n"
            f"{each.success_rate:.0%} of the evaluation arrive"
        )
    marker = {"color": _FORCE, "linestyle": ""}
    arrow = Line2D(
        [], [], marker=r"$\rightarrow$", markersize=8, label="force", **marker
    )
    none = Line2D([], [], marker=".", markersize=3, label="none", **marker)
    parts.legend(figure, [arrow, none, *_handles()])
    return figure


def trajectories(shown: list[Shown]) -> Figure:
    """Paths from corners and edges, at rest, under each policy."""
    figure, axes = _planes(shown, min(len(shown), 3))
    for ax, each in zip(axes, shown, strict=True):
        costs, arrived = _draw_paths(ax, each)
        ax.set_title(
            f"{each.label}\narrives {arrived} of {len(costs)} times, "
            f"mean cost {digits(float(np.mean(costs)))}"
        )
    ends = [
        Line2D([], [], **_end("0.2", success=True), label="arrived at the goal"),
        Line2D([], [], **_end("0.2", success=False), label="time was up"),
    ]
    parts.legend(figure, [*ends, *_handles()])
    return figure


def _planes(
    shown: list[Shown], columns: int, panels: int = 1
) -> tuple[Figure, list[Axes]]:
    """Panels with damping and goal, for each policy one or two."""
    system = _system(shown[0])
    width = min(2.5 * columns + 0.5, parts.WIDTH)
    figure, axes = parts.small_multiples(
        *(panels * len(shown), columns, 2.85, width), sharex=True, sharey=True
    )
    largest = system.position_max
    fine = np.linspace(-largest, largest, _SHADES)
    for ax in axes:
        shades = ax.imshow(
            system.damping(fine[None, :], fine[:, None]),
            origin="lower",
            extent=(-largest, largest, -largest, largest),
            cmap=_DAMPING,
            interpolation="bilinear",
        )
        shades.set_zorder(0.5)
        goal = Polygon(goal_outline(system), color=parts.GREEN, linewidth=0, zorder=1.5)
        ax.add_patch(goal)
        ax.grid(visible=False)
        ax.set_xlim(-1.04 * largest, 1.04 * largest)
        ax.set_ylim(-1.04 * largest, 1.04 * largest)
        ax.set_aspect("equal")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(MultipleLocator(largest / 2))
    parts.label_outer(axes, columns, "$c_1$ (m)", "$c_2$ (m)")
    return figure, axes


def _system(shown: Shown) -> Any:
    return shown.study.task.make_system_env(1).system


def _draw_forces(ax: Axes, shown: Shown) -> None:
    """An arrow for the force at each position, a dot where there is none."""
    system = _system(shown)
    axis = np.linspace(-system.position_max, system.position_max, _ARROWS)
    c1, c2 = (each.ravel() for each in np.meshgrid(axis, axis))
    rest = np.zeros(c1.size)
    states = np.stack([c1, rest, c2, rest], axis=1)
    env = shown.study.task.make_system_env(len(states))
    u1, u2 = np.array(system.forces)[actions_in(shown.policy, env, states)].T
    none, spacing = (u1 == 0) & (u2 == 0), axis[1] - axis[0]
    largest = np.hypot(u1, u2).max() or 1.0
    ax.quiver(
        *(each[~none] for each in (c1, c2, u1, u2)),
        color=_FORCE, angles="xy", scale_units="xy", units="xy", pivot="mid", zorder=2,
        scale=largest / (0.95 * spacing), width=0.16 * spacing,
        headwidth=3.2, headlength=3.2, headaxislength=2.8,
    )  # fmt: skip
    ax.plot(c1[none], c2[none], color=_FORCE, marker=".", markersize=1.5, linestyle="")


def _draw_paths(ax: Axes, shown: Shown) -> tuple[list[float], int]:
    """Paths and whether they end at the goal; what they cost, and how many arrive."""
    largest = _system(shown).position_max
    ends = (-largest, 0.0, largest)
    costs, arrived = [], 0
    for start in ((a, b) for a in ends for b in ends if (a, b) != (0.0, 0.0)):
        state = np.array([start[0], 0.0, start[1], 0.0])
        env = shown.study.task.make_system_env(1)
        path = record_trajectory(shown.policy, env, state)
        c1, c2 = path.states[:, [0, 2]].T
        color = shown.look.color
        ax.plot(c1, c2, color=color, linewidth=1.1, zorder=2)
        ax.plot(c1[-1], c2[-1], **_end(color, success=path.success))
        costs.append(float(path.costs.sum()))
        arrived += path.success
    return costs, arrived


def _end(color: str, *, success: bool) -> dict[str, Any]:
    """The marker at the end of a path."""
    marker, size = ("o", 2.5) if success else ("x", 4)
    options = {"linestyle": "", "zorder": 3, "clip_on": False}
    return {"color": color, "marker": marker, "markersize": size, **options}


def _handles() -> list[Any]:
    return [
        Patch(facecolor="#B9BEC6", label="damping, darker is stronger"),
        Patch(facecolor=parts.GREEN, label="goal"),
    ]
