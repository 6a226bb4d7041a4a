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

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.navigation.painter import goal_outline
from acl_gym.envs.navigation.system import Navigation
from acl_gym.evaluation import actions_in, record_trajectory
from acl_gym.plotting import style
from acl_gym.plotting.shown import Shown
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray, Predictor

_ARROWS = 25
"""Positions along an axis: three between neighbours of nine centres."""

_SHADES = 81
"""Positions along an axis where the damping is shown."""

_DAMPING = LinearSegmentedColormap.from_list("damping", ["#FFFFFF", "#8A929E"], N=14)
_FORCE: dict[str, Any] = {"color": "#1F2A36", "linestyle": ""}


def policies(shown: list[Shown], *, paths: bool = False) -> Figure:
    """The force at rest over the plane; with `paths`, a panel for these beside it."""
    figure, axes = _planes(shown, 1 + paths)
    for place, each in enumerate(shown):
        ax = axes[place * (1 + paths)]
        draw_policy(ax, each.env, each.policy)
        ax.set_title(each.title)
        if paths:
            _draw_paths(axes[2 * place + 1], each)
            axes[2 * place + 1].set_title(
                "paths of vehicles that start at rest\n"
                f"{each.success_rate:.0%} of the evaluation arrive"
            )
    arrow = Line2D(
        [], [], marker=r"$\rightarrow$", markersize=8, label="force", **_FORCE
    )
    none = Line2D([], [], marker=".", markersize=3, label="none", **_FORCE)
    style.legend(figure, [arrow, none, *_handles()])
    return figure


def trajectories(shown: list[Shown]) -> Figure:
    """Paths from corners and edges, at rest, under each policy."""
    figure, axes = _planes(shown)
    for ax, each in zip(axes, shown, strict=True):
        _draw_paths(ax, each)
    ends = [
        Line2D([], [], **_end("0.2", success=True), label="arrived at the goal"),
        Line2D([], [], **_end("0.2", success=False), label="time was up"),
    ]
    style.legend(figure, [*ends, *_handles()])
    return figure


def _planes(shown: list[Shown], panels: int = 1) -> tuple[Figure, list[Axes]]:
    """Panels with damping and goal, for each policy one or two."""
    system: Any = shown[0].env.system
    count = panels * len(shown)
    columns = 2 if panels == 2 or count == 4 else min(count, 3)
    width = min(2.5 * columns + 0.5, style.WIDTH)
    options = {"sharex": True, "sharey": True}
    figure, axes = style.small_multiples(count, columns, 2.85, width, **options)
    for ax in axes:
        draw_ground(ax, system)
    style.label_outer(axes, columns, "$c_1$ (m)", "$c_2$ (m)")
    return figure, axes


def draw_ground(ax: Axes, system: Navigation) -> None:
    """Damping and goal over the plane of positions."""
    largest = system.position_max
    fine, extent = np.linspace(-largest, largest, _SHADES), 2 * (-largest, largest)
    damping = system.damping(fine[None, :], fine[:, None])
    shading: Any = {"interpolation": "bilinear", "zorder": 0.5}
    ax.imshow(damping, _DAMPING, origin="lower", extent=extent, **shading)
    goal = Polygon(goal_outline(system), color=style.GREEN, linewidth=0, zorder=1.5)
    ax.add_patch(goal)
    ax.grid(visible=False)
    limits = (-1.04 * largest, 1.04 * largest)
    ax.set(xlim=limits, ylim=limits, aspect="equal")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(largest / 2))


def positions(system: Navigation) -> tuple[FloatArray, FloatArray]:
    """Where arrows are drawn: c1 and c2, each `(n,)`."""
    axis = np.linspace(-system.position_max, system.position_max, _ARROWS)
    c1, c2 = np.meshgrid(axis, axis)
    return c1.ravel(), c2.ravel()


def draw_policy(ax: Axes, env: ControlVectorEnv, policy: Predictor) -> None:
    """An arrow for the force at each position at rest, a dot where there is none."""
    system: Any = env.system
    c1, c2 = positions(system)
    states = np.stack([c1, 0 * c1, c2, 0 * c2], axis=1)
    actions = actions_in(policy, env.with_slots(len(states)), states)
    draw_forces(ax, system, np.array(system.forces)[actions])


def draw_forces(ax: Axes, system: Navigation, forces: FloatArray) -> None:
    """Arrows for the forces `(n, 2)` at `positions`, a dot where there is none."""
    c1, c2 = positions(system)
    u1, u2 = forces.T
    none, spacing = (u1 == 0) & (u2 == 0), 2 * system.position_max / (_ARROWS - 1)
    ax.quiver(
        *(each[~none] for each in (c1, c2, u1, u2)),
        color=_FORCE["color"], angles="xy", scale_units="xy", units="xy", pivot="mid",
        scale=(np.hypot(u1, u2).max() or 1.0) / (0.95 * spacing), width=0.16 * spacing,
        headwidth=3.2, headlength=3.2, headaxislength=2.8, zorder=2,
    )  # fmt: skip
    ax.plot(c1[none], c2[none], marker=".", markersize=1.5, **_FORCE)


def _draw_paths(ax: Axes, shown: Shown) -> None:
    """Paths from corners and edges, and whether they end at the goal."""
    system: Any = shown.env.system
    largest, color = system.position_max, shown.line["color"]
    starts = [
        (i * largest, j * largest) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j
    ]
    paths = []
    for c1, c2 in starts:
        start, env = np.array([c1, 0.0, c2, 0.0]), shown.env.with_slots(1)
        path = record_trajectory(shown.policy, env, start)
        x, y = path.states[:, [0, 2]].T
        ax.plot(x, y, color=color, linewidth=1.1, zorder=2)
        ax.plot(x[-1], y[-1], **_end(color, success=path.success))
        paths.append(path)
    arrived = sum(path.success for path in paths)
    cost = digits(float(np.mean([path.costs.sum() for path in paths])))
    title = f"{shown.label}\narrives {arrived} of {len(paths)} times, mean cost {cost}"
    ax.set_title(title)


def _end(color: str, *, success: bool) -> dict[str, Any]:
    """The marker at the end of a path."""
    marker, size = ("o", 2.5) if success else ("x", 4)
    options = {"linestyle": "", "zorder": 3, "clip_on": False}
    return {"color": color, "marker": marker, "markersize": size, **options}


def _handles() -> list[Any]:
    return [
        Patch(facecolor="#B9BEC6", label="damping, darker is stronger"),
        Patch(facecolor=style.GREEN, label="goal"),
    ]
