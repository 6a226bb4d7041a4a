"""Grids: the move of a policy in each cell, over what it costs until the goal."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from acl_gym.evaluation import actions_in
from acl_gym.experiments.plots import parts
from acl_gym.experiments.plots.parts import Shown
from acl_gym.planning.value_iteration import policy_value, value_iteration
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

_BEST, _OTHER = "0.1", parts.ORANGE
_SHADES = LinearSegmentedColormap.from_list("cost", ["#FFFFFF", "#9CC3DE"])
_NEVER = {"facecolor": "#F6D8C6", "hatch": "////", "edgecolor": "#DDA98B"}
_GOAL: dict[str, Any] = {
    "color": parts.GREEN,
    "marker": "o",
    "markersize": 5,
    "linestyle": "",
}


class _Moves(NamedTuple):
    """A policy in each state.

    Attributes:
        actions: its move.
        optimal: whether that is one of an optimal policy.
        cost: until the goal; infinite if it never gets there.
        highest: the highest cost of an optimal policy.
    """

    actions: IntArray
    optimal: BoolArray
    cost: FloatArray
    highest: float


def _moves(shown: Shown) -> _Moves:
    env = shown.study.task.make_system_env(1)
    system: Any = env.system
    states = np.arange(system.n_states, dtype=np.float64)[:, None]
    slots = shown.study.task.make_system_env(len(states))
    actions = actions_in(shown.policy, slots, states)
    exact = value_iteration(env).action_values
    chosen = exact[np.arange(len(actions)), actions]
    optimal = chosen >= exact.max(axis=1) - 1e-6
    highest = float(-exact.max(axis=1).min()) or 1.0
    return _Moves(actions, optimal, -policy_value(env, actions), highest)


def policies(shown: list[Shown], paths: bool = False) -> Figure:
    """An arrow for the move in each cell; rows that are one cell high lie below each
    other.
    """
    found = [_moves(each) for each in shown]
    norm = Normalize(0.0, max(each.highest for each in found), clip=True)
    system: Any = shown[0].study.task.make_system_env(1).system
    rows, width = len(system.rows), len(system.rows[0])
    columns = 1 if rows == 1 else min(len(shown), 3)
    height = 0.5 if rows == 1 else 6.5 / 3 * rows / width + 0.6
    total = parts.WIDTH if columns in (1, 3) else 2.4 * columns + 0.8
    figure, axes = parts.small_multiples(len(shown), columns, height, total)
    for ax, each, moves in zip(axes, shown, found, strict=True):
        _draw(ax, each, moves, norm)
        if rows == 1:
            ax.set_ylabel(each.title, rotation=0, ha="right", va="center")
        else:
            ax.set_title(each.title)
    shades = figure.colorbar(
        *(ScalarMappable(norm, _SHADES),), ax=axes, shrink=0.8, pad=0.01, aspect=25
    )
    shades.set_label("cost until the goal")
    shades.outline.set_visible(False)  # type: ignore[operator]
    handles = [
        _arrow(_BEST, "a best move"),
        _arrow(_OTHER, "another move"),
        Patch(**_NEVER, label="from here never to the goal"),  # type: ignore[arg-type]
        Line2D([], [], **_GOAL, label="goal"),
    ]
    parts.legend(figure, handles)
    return figure


def _draw(ax: Axes, shown: Shown, moves: _Moves, norm: Normalize) -> None:
    system: Any = shown.study.task.make_system_env(1).system
    rows, columns = len(system.rows), len(system.rows[0])
    cells = np.array(system.cells)
    costs = np.full((rows, columns), np.nan)
    costs[tuple(cells.T)] = moves.cost
    never = np.isinf(costs)
    ax.imshow(np.where(never, np.nan, costs), cmap=_SHADES, norm=norm, aspect="equal")
    walls = np.array([[character == "#" for character in row] for row in system.rows])
    for places, style in (
        (never, {**_NEVER, "linewidth": 0}),
        (walls, {"color": "0.25"}),
    ):
        for row, column in np.argwhere(places):
            corner = (column - 0.5, row - 0.5)
            ax.add_patch(Rectangle(corner, 1, 1, **style))  # type: ignore[arg-type]
    ax.set_xticks(np.arange(columns - 1) + 0.5, labels=[])
    ax.set_yticks(np.arange(rows - 1) + 0.5, labels=[])
    ax.tick_params(length=0)
    ax.plot(*cells[system.goal_states].T[::-1], **_GOAL)
    starts = np.setdiff1d(np.arange(len(cells)), system.goal_states)
    ax.quiver(
        *cells[starts].T[::-1],
        *np.array(system.directions)[moves.actions[starts]].T[::-1],
        color=np.where(moves.optimal[starts], _BEST, _OTHER),
        angles="xy", scale_units="xy", scale=1.5, pivot="mid", units="xy", width=0.1,
        headwidth=3.6, headlength=3.6, headaxislength=3.2, zorder=3,
    )  # fmt: skip
    ax.spines[:].set(visible=True, color="0.4")


def _arrow(color: str, label: str) -> Line2D:
    """Of the legend."""
    marker = {"marker": r"$\rightarrow$", "markersize": 8, "linestyle": ""}
    return Line2D([], [], color=color, label=label, **marker)  # type: ignore[arg-type]
