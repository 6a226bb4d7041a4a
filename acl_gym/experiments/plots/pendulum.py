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

from acl_gym.evaluation import Trajectory, actions_in, record_trajectory
from acl_gym.experiments.plots import parts
from acl_gym.experiments.plots.parts import Shown
from acl_gym.experiments.statistics import digits
from acl_gym.experiments.study import Study

THETA, OMEGA = r"$\theta$ (rad)", r"$\omega$ (rad/s)"

_LATEST = 1.3
"""Times the last arrival at the goal: what follows there is hovering."""

_LONGEST = 15.0
"""Seconds that are drawn where no policy arrives."""

_FINEST = 320
"""Points along an axis of a map at most."""

_GOAL: dict[str, Any] = {
    "color": parts.ORANGE,
    "marker": "o",
    "markersize": 5,
    "markerfacecolor": "#F0E442",
    "linestyle": "",
}


def policies(shown: list[Shown], paths: bool = False) -> Figure:
    """A map of the torque that each policy chooses over the states."""
    columns = min(len(shown), 3)
    width = 3.3 * columns if columns < 3 else parts.WIDTH
    figure, axes = parts.small_multiples(
        *(len(shown), columns, width / columns - 0.2, width), sharex=True, sharey=True
    )
    for ax, each in zip(axes, shown, strict=True):
        draw_policy(ax, each)
        ax.set_title(each.title)
    parts.label_outer(axes, columns, THETA, OMEGA)
    parts.legend(figure, handles(shown[0].study))
    return figure


def draw_policy(ax: Axes, shown: Shown) -> None:
    """White is the largest torque and black the smallest, as in the thesis."""
    study = shown.study
    space: Any = study.task.make_system_env(1).single_observation_space
    n_theta, n_omega = study.cells or (40, 41)
    theta = np.linspace(0.0, 2 * math.pi, min(4 * n_theta, _FINEST) + 1)
    omega = np.linspace(
        space.low[1], space.high[1], min(4 * (n_omega - 1), _FINEST) + 1
    )
    states = np.stack(np.meshgrid(theta % (2 * math.pi), omega), axis=-1)
    flat = states.reshape(-1, 2)
    actions = actions_in(shown.policy, study.task.make_system_env(len(flat)), flat)
    shades = np.argsort(np.argsort(_torques(study)))  # of each action
    count = len(shades)
    ax.pcolormesh(
        *(theta, omega, shades[actions].reshape(states.shape[:2])),
        cmap=ListedColormap([str(grey) for grey in np.linspace(0, 1, count)]),
        norm=BoundaryNorm(np.arange(count + 1) - 0.5, count),
        shading="nearest",
        rasterized=True,
    )
    ax.grid(visible=False)
    ax.plot(math.pi, 0.0, **_GOAL)
    ax.set_xlim(0.0, 2 * math.pi)
    ax.set_ylim(omega[0], omega[-1])
    parts.multiples_of_pi(ax.xaxis)
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=(1, 2, 3, 5, 10)))


def _torques(study: Study) -> Any:
    """The torque of each action, N m."""
    return np.array(study.task.make_system_env(1).system.torques)  # type: ignore[attr-defined]


def handles(study: Study) -> list[Any]:
    """What the greys of a map stand for."""
    torques = np.sort(_torques(study))
    greys = np.linspace(0, 1, len(torques))
    return [
        *(
            Patch(facecolor=str(grey), edgecolor="0.3", label=parts.torque(value))
            for grey, value in zip(greys, torques, strict=True)
        ),
        Line2D([], [], **_GOAL, label="goal"),
    ]


def trajectories(shown: list[Shown]) -> Figure:
    """Angle, velocity, torque and cost from hanging at rest, under each policy."""
    count = len(shown)
    system: Any = shown[0].study.task.make_system_env(1).system
    paths = [
        record_trajectory(each.policy, each.study.task.make_system_env(1), np.zeros(2))
        for each in shown
    ]
    figure = parts.new_figure(4.8 + 0.22 * count, parts.WIDTH if count > 1 else 5.4)
    rows = 0.6 + 0.25 * count
    axes = figure.subplots(4, 1, sharex=True, height_ratios=(1.9, 1.5, rows, 1.5))
    for place, (path, each) in enumerate(zip(paths, shown, strict=True)):
        time = system.sampling_time * np.arange(len(path.states))
        theta = np.unwrap(path.states[:, 0], period=2 * math.pi)
        cost = np.concatenate([[0.0], np.cumsum(path.costs)])
        for ax, y in zip(
            axes[[0, 1, 3]], (theta, path.states[:, 1], cost), strict=True
        ):
            ax.plot(time, y, **each.look.line)
            if path.success:
                dot = {"color": each.look.color, "marker": "o", "clip_on": False}
                ax.plot(time[-1], y[-1], **dot)
        _torque_row(axes[2], place, time, path, each)
    largest = parts.torque(float(np.abs(_torques(shown[0].study)).max()))
    axes[2].set_title(f"torque, in each row up to {largest} either way", pad=2)
    axes[2].set_yticks(range(count), [each.label.split(" (")[0] for each in shown])
    axes[2].set_ylim(count - 0.4, -0.6)
    lengths = system.sampling_time * np.array([len(path.costs) for path in paths])
    arrived = np.array([path.success for path in paths])
    latest = _LATEST * lengths[arrived].max() if arrived.any() else _LONGEST
    axes[3].set_xlim(0.0, min(latest, lengths.max()))
    costs = np.array([path.costs.sum() for path in paths])
    axes[3].set_ylim(0.0, 1.1 * (costs[arrived] if arrived.any() else costs).max())
    for ax, name in zip(axes[[0, 1, 3]], (THETA, OMEGA, "cost so far"), strict=True):
        ax.set_ylabel(name)
    axes[3].set_xlabel("time (s)")
    parts.multiples_of_pi(axes[0].yaxis)
    lowest, highest = axes[0].get_ylim()
    for goal in (-math.pi, math.pi):
        if lowest - 0.3 <= goal <= highest + 0.3:
            axes[0].axhline(goal, **parts.BOUND)
            axes[0].annotate(
                *("goal", (1.01, goal)), xycoords=("axes fraction", "data"), va="center"
            )
    endings = [
        f"{each.label}: {_ending(path, length)}"
        for each, path, length in zip(shown, paths, lengths, strict=True)
    ]
    if count == 1:
        axes[0].set_title(endings[0])
    else:
        lines = [
            Line2D([], [], **each.look.line, label=ending)
            for each, ending in zip(shown, endings, strict=True)
        ]
        parts.legend(figure, lines, ncols=2)
    return figure


def _torque_row(ax: Axes, row: int, time: Any, path: Trajectory, shown: Shown) -> None:
    torques = _torques(shown.study)
    # The last torque holds until the last state.
    torque = torques[np.append(path.actions, path.actions[-1:])]
    height = row - 0.38 * torque / (np.abs(torques).max() or 1.0)
    color = shown.look.color
    ax.fill_between(
        time, row, height, step="post", color=color, alpha=0.35, linewidth=0
    )
    ax.plot(time, height, drawstyle="steps-post", color=color, linewidth=1.0)


def _ending(path: Trajectory, seconds: float) -> str:
    cost = digits(float(path.costs.sum()))
    if path.success:
        return f"goal at {seconds:.1f} s, cost {cost}"
    return f"no goal in {seconds:.0f} s, cost {cost}"
