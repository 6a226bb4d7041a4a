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

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation import actions_in, record_trajectory
from acl_gym.plotting import style
from acl_gym.plotting.shown import Shown
from acl_gym.utils.text import digits
from acl_gym.utils.typing import Predictor

THETA, OMEGA = r"$\theta$ (rad)", r"$\omega$ (rad/s)"

_LATEST = 1.3
"""Times the last arrival at the goal: what follows there is hovering."""

_LONGEST = 15.0
"""Seconds that are drawn where no policy arrives."""

_FINEST = 320
"""Points along an axis of a map at most."""

_GOAL: dict[str, Any] = {
    **{"color": style.ORANGE, "markerfacecolor": "#F0E442"},
    **{"marker": "o", "markersize": 5, "linestyle": ""},
}


def policies(shown: list[Shown], *, paths: bool = False) -> Figure:
    """A map of the torque that each policy chooses over the states."""
    columns = min(len(shown), 3)
    width = 3.3 * columns if columns < 3 else style.WIDTH
    options = {"sharex": True, "sharey": True}
    figure, axes = style.small_multiples(
        len(shown), columns, width / columns - 0.2, width, **options
    )
    for ax, each in zip(axes, shown, strict=True):
        draw_policy(ax, each.env, each.policy)
        ax.set_title(each.title)
    style.label_outer(axes, columns, THETA, OMEGA)
    style.legend(figure, handles(shown[0].env))
    return figure


def draw_policy(ax: Axes, env: ControlVectorEnv, policy: Predictor) -> None:
    """White is the largest torque and black the smallest, as in the thesis."""
    space: Any = env.single_observation_space
    n_theta, n_omega = cells_of(policy)
    theta = np.linspace(0.0, 2 * math.pi, min(4 * n_theta, _FINEST) + 1)
    fine = min(4 * (n_omega - 1), _FINEST) + 1
    omega = np.linspace(space.low[1], space.high[1], fine)
    states = np.stack(np.meshgrid(theta % (2 * math.pi), omega), axis=-1)
    flat = states.reshape(-1, 2)
    actions = actions_in(policy, env.with_slots(len(flat)), flat)
    shades = np.argsort(np.argsort(_torques(env)))  # of each action
    greys = ListedColormap([str(grey) for grey in np.linspace(0, 1, len(shades))])
    ax.pcolormesh(
        *(theta, omega, shades[actions].reshape(states.shape[:2])),
        cmap=greys,
        norm=BoundaryNorm(np.arange(len(shades) + 1) - 0.5, len(shades)),
        shading="nearest",
        rasterized=True,
    )
    ax.grid(visible=False)
    ax.plot(math.pi, 0.0, **_GOAL)
    ax.set_xlim(0.0, 2 * math.pi)
    ax.set_ylim(omega[0], omega[-1])
    style.multiples_of_pi(ax.xaxis)
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=(1, 2, 3, 5, 10)))


def cells_of(policy: Any) -> tuple[int, int]:
    """How many centres both variables have in a policy; those of §5.3 if it has none."""
    partition = getattr(policy, "partition", None)
    if partition is None:
        return 40, 41
    n_theta, n_omega = map(len, partition.centres)
    return n_theta, n_omega


def _torques(env: ControlVectorEnv) -> Any:
    """The torque of each action, N m."""
    system: Any = env.system
    return np.array(system.torques)


def handles(env: ControlVectorEnv) -> list[Any]:
    """What the greys of a map stand for."""
    torques = np.sort(_torques(env))
    greys = zip(np.linspace(0, 1, len(torques)), torques, strict=True)
    return [
        *(
            Patch(facecolor=str(grey), edgecolor="0.3", label=style.signed(torque))
            for grey, torque in greys
        ),
        Line2D([], [], **_GOAL, label="goal"),
    ]


def trajectories(shown: list[Shown]) -> Figure:
    """Angle, velocity, torque and cost from hanging at rest, under each policy."""
    count, torques = len(shown), _torques(shown[0].env)
    system: Any = shown[0].env.system
    step = system.sampling_time
    paths = [
        record_trajectory(each.policy, each.env.with_slots(1), np.zeros(2))
        for each in shown
    ]
    figure = style.new_figure(4.8 + 0.22 * count, style.WIDTH if count > 1 else 5.4)
    rows = 0.6 + 0.25 * count
    axes = figure.subplots(4, 1, sharex=True, height_ratios=(1.9, 1.5, rows, 1.5))
    outer, lines = axes[[0, 1, 3]], []
    for row, (path, each) in enumerate(zip(paths, shown, strict=True)):
        time, color = step * np.arange(len(path.states)), each.line["color"]
        theta = np.unwrap(path.states[:, 0], period=2 * math.pi)
        costs = np.concatenate([[0.0], np.cumsum(path.costs)])
        for ax, y in zip(outer, (theta, path.states[:, 1], costs), strict=True):
            ax.plot(time, y, **each.line)
            if path.success:
                ax.plot(time[-1], y[-1], "o", color=color, clip_on=False)
        # The last torque holds until the last state.
        torque = torques[np.append(path.actions, path.actions[-1:])]
        height = row - 0.38 * torque / np.abs(torques).max()
        area = {"color": color, "alpha": 0.35, "linewidth": 0}
        axes[2].fill_between(time, row, height, step="post", **area)
        axes[2].plot(time, height, color, drawstyle="steps-post", linewidth=1.0)
        ending = f"goal at {time[-1]:.1f} s" if path.success else "no goal"
        label = f"{each.label}: {ending}, cost {digits(costs[-1])}"
        lines.append(Line2D([], [], **each.line, label=label))
    axes[2].set_title(
        f"torque, rows from {style.signed(torques.min())} to "
        f"{style.signed(torques.max())}"
    )
    axes[2].set_yticks(range(count), [each.label.split(" (")[0] for each in shown])
    axes[2].set_ylim(count - 0.4, -0.6)
    # What counts is the time until the last arrival, and what these cost.
    arrived = [path for path in paths if path.success]
    longest = step * max(len(path.costs) for path in paths)
    latest = _LATEST * step * max([len(path.costs) for path in arrived], default=0)
    axes[3].set_xlim(0.0, min(latest or _LONGEST, longest))
    axes[3].set_ylim(0.0, 1.1 * max(path.costs.sum() for path in arrived or paths))
    for ax, name in zip(outer, (THETA, OMEGA, "cost so far"), strict=True):
        ax.set_ylabel(name)
    axes[3].set_xlabel("time (s)")
    style.multiples_of_pi(axes[0].yaxis)
    lowest, highest = axes[0].get_ylim()
    for goal in (-math.pi, math.pi):
        if lowest - 0.3 <= goal <= highest + 0.3:
            axes[0].axhline(goal, **style.BOUND)
            place = axes[0].get_yaxis_transform()
            axes[0].text(1.01, goal, "goal", transform=place, va="center")
    if count == 1:
        axes[0].set_title(lines[0].get_label())
    else:
        style.legend(figure, lines, ncols=2)
    return figure
