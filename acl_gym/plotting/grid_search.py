"""Grids: the move of a policy in each cell, over what it costs until the goal."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation import actions_in
from acl_gym.planning.value_iteration import policy_value, value_iteration
from acl_gym.plotting import style
from acl_gym.plotting.shown import Shown
from acl_gym.utils.typing import FloatArray, Predictor

_BEST, _OTHER = "0.1", style.ORANGE
SHADES = LinearSegmentedColormap.from_list("cost", ["#FFFFFF", "#9CC3DE"])
_WALL: dict[str, Any] = {"color": "0.25"}
_NEVER: dict[str, Any] = {
    **{"facecolor": "#F6D8C6", "edgecolor": "#DDA98B"},
    **{"hatch": "////", "linewidth": 0},
}
_GOAL: dict[str, Any] = {
    **{"color": style.GREEN, "linestyle": ""},
    **{"marker": "o", "markersize": 5},
}


def policies(shown: list[Shown], *, paths: bool = False) -> Figure:
    """An arrow for the move in each cell, a panel for each policy."""
    system: Any = shown[0].env.system
    exact = [value_iteration(each.env.with_slots(1)).action_values for each in shown]
    highest = max(-values.max(axis=1).min() for values in exact)
    norm = Normalize(0.0, highest, clip=True)
    rows, width = len(system.rows), len(system.rows[0])
    strip, count = rows == 1, len(shown)  # strips lie below each other
    columns = 1 if strip else 2 if count == 4 else min(count, 3)
    total = style.WIDTH if columns in (1, 3) else 2.4 * columns + 0.8
    height = 0.5 if strip else 2.2 * rows / width + 0.5
    figure, axes = style.small_multiples(count, columns, height, total)
    for ax, each, values in zip(axes, shown, exact, strict=True):
        draw_policy(ax, each.env, each.policy, values, norm)
        if strip:
            ax.set_ylabel(each.title, rotation=0, ha="right", va="center")
        else:
            ax.set_title(each.title)
    mappable = ScalarMappable(norm, SHADES)
    place: Any = {"shrink": 0.8, "pad": 0.01}
    bar = figure.colorbar(mappable, ax=axes, label="cost until the goal", **place)
    bar.ax.spines[:].set_visible(False)
    style.legend(figure, handles())
    return figure


def handles() -> list[Any]:
    """What arrows, hatches and the marker stand for."""
    return [
        *(
            Line2D([], [], color=color, marker=r"$\rightarrow$", markersize=8,
                   linestyle="", label=label)
            for color, label in ((_BEST, "a best move"), (_OTHER, "another move"))
        ),
        Patch(**_NEVER, label="from here never to the goal"),
        Line2D([], [], **_GOAL, label="goal"),
    ]  # fmt: skip


def draw_policy(
    ax: Axes,
    env: ControlVectorEnv,
    policy: Predictor,
    exact: FloatArray,
    norm: Normalize,
) -> None:
    """An arrow for each move, over the cost from each cell to the goal.

    Args:
        ax: where.
        env: with any number of slots.
        policy: chooses the moves.
        exact: action values of an optimal policy, `(n_states, n_actions)`.
        norm: of the shades of costs.
    """
    system: Any = env.system
    states = np.arange(len(exact))
    slots = env.with_slots(len(states))
    actions = actions_in(policy, slots, states[:, None].astype(np.float64))
    best = exact[states, actions] >= exact.max(axis=1) - 1e-6
    letters = np.array([list(row) for row in system.rows])
    cells, costs = np.array(system.cells), np.full(letters.shape, np.nan)
    costs[tuple(cells.T)] = -policy_value(env.with_slots(1), actions)
    never = np.isinf(costs)
    ax.imshow(np.where(never, np.nan, costs), cmap=SHADES, norm=norm, aspect="equal")
    for places, look in ((never, _NEVER), (letters == "#", _WALL)):
        for row, column in np.argwhere(places):
            ax.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, **look))
    ax.set_xticks(np.arange(letters.shape[1] - 1) + 0.5, labels=[])
    ax.set_yticks(np.arange(letters.shape[0] - 1) + 0.5, labels=[])
    ax.tick_params(length=0)
    ax.plot(*cells[system.goal_states].T[::-1], **_GOAL)
    starts = np.setdiff1d(states, system.goal_states)
    steps = np.array(system.directions)[actions[starts]]
    ax.quiver(
        *cells[starts].T[::-1],
        *steps.T[::-1],
        color=np.where(best[starts], _BEST, _OTHER),
        angles="xy", scale_units="xy", scale=1.5, pivot="mid", units="xy", width=0.1,
        headwidth=3.6, headlength=3.6, headaxislength=3.2, zorder=3,
    )  # fmt: skip
    ax.spines[:].set(visible=True, color="0.4")
