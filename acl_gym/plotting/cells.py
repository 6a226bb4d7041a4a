"""Numbered states as cells: in a row, in the grid of a map, or in a shape given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from acl_gym.envs.grid_search.system import GridSearch
from acl_gym.planning.value_iteration import value_iteration
from acl_gym.plotting import grid_search, palettes, style
from acl_gym.plotting.subject import Subject
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

MOVES = {
    **{"north": (-1, 0), "south": (1, 0), "east": (0, 1), "west": (0, -1)},
    **{"up": (-1, 0), "down": (1, 0), "right": (0, 1), "left": (0, -1)},
}
"""Name of an action -> how many rows and columns it moves by."""

KNOWN = {
    "FrozenLakeEnv": ("left", "down", "right", "up"),
    "CliffWalkingEnv": ("up", "right", "down", "left"),
    "TaxiEnv": ("south", "north", "east", "west", "pick up", "drop off"),
}
"""Class of an environment of Gymnasium -> the names of its actions."""

_ROW, _WRAPPED = 40, 25
"""States in one row at most; in each of several rows."""

_LOOKS: dict[bytes, dict[str, Any]] = {
    b"#": {"facecolor": "0.25"},
    b"H": {"facecolor": "#9CC3DE"},
    b"C": {"facecolor": "0.45"},
    b"G": {"facecolor": "#A6DCC4"},
}
"""Letter of a map -> how its cells look: obstacle, hole, cliff, goal."""

_SPACE = 0.04
_INK = "0.1"


@dataclass(frozen=True)
class Layout:
    """Where numbered states lie.

    Attributes:
        places: the row and column of each state, `(n, 2)`.
        letters: of the map, `(rows, columns)`, bytes; spaces where nothing is known.
        moves: rows and columns by which each action moves; zeros: it does not.
        actions: the names of all actions.
    """

    places: IntArray
    letters: Any
    moves: IntArray
    actions: tuple[str, ...] = field(default=())

    @property
    def known(self) -> bool:
        """Whether arrows can show the policy: all actions move."""
        return bool(self.moves.any(axis=1).all())

    def ends(self) -> BoolArray:
        """Whether an episode ends in each state, where the map says so, `(n,)`."""
        return np.isin(self.letters[tuple(self.places.T)], [b"H", b"G", b"C"])


def refuse_shape(shape: Any) -> None:
    """A shape is for numbered states only.

    Raises:
        ValueError: there is a shape.
    """
    if shape is not None:
        raise ValueError(
            "shape is for states that are one number, got "
            f"{validation.shown(shape)}; leave it out, "
            "and choose what is drawn by axes and slice."
        )


def plot_policy(subject: Subject, ax: Axes | None, shape: Any, colorbar: bool) -> Axes:
    """See `acl_gym.plotting.plot_policy`."""
    env = subject.vector_env()
    if isinstance(subject.system, GridSearch) and env is not None and shape is None:
        return _plot_grid_search(subject, env, ax, colorbar)
    layout = layout_of(subject, shape)
    states = subject.first_state + np.arange(subject.n_states)
    columns = subject.columns(states)
    with style.axes_or_new(ax, *_size(layout)) as ax:
        shown = ~layout.ends()
        if layout.known:
            _draw_map(ax, layout)
            _draw_arrows(ax, layout, columns, shown)
        else:
            colours = palettes.of_names(layout.actions)
            cmap, norm = colours.mapping()
            values = np.where(shown, columns.astype(float), np.nan)
            _draw_cells(ax, layout, values, cmap, norm)
            _draw_map(ax, layout)
            if colorbar:
                palettes.add_bar(ax, colours, below=len(layout.letters) == 1)
        _finish(ax, layout, subject, subject.heading("policy"))
    return ax


def plot_levels(
    subject: Subject,
    ax: Axes | None,
    shape: Any,
    column: int | None,
    name: str,
    limits: tuple[float, float] | None,
    colorbar: bool,
) -> Axes:
    """See `acl_gym.plotting.plot_pheromone`."""
    layout = layout_of(subject, shape)
    states = subject.first_state + np.arange(subject.n_states)
    levels = subject.levels(states)
    values = levels.max(axis=1) if column is None else levels[:, column]
    shown = ~layout.ends()
    norm = palettes.norm_of(values[shown] if shown.any() else values, limits)
    with style.axes_or_new(ax, *_size(layout)) as ax:
        mappable = palettes.levels(norm)
        _draw_cells(ax, layout, np.where(shown, values, np.nan), mappable.cmap, norm)
        _draw_map(ax, layout)
        if colorbar:
            below = len(layout.letters) == 1
            palettes.add_level_bar(ax, mappable, name, below=below)
        _finish(
            ax,
            layout,
            subject,
            f"{name.split(maxsplit=1)[0].capitalize()}, {subject.title}",
        )
    return ax


def plot_path(
    subject: Subject, states: FloatArray, ax: Axes | None, title: str
) -> Axes:
    """A line through the cells of some states, from a circle to a dot."""
    layout = layout_of(subject, None)
    visited = layout.places[states.astype(np.int64) - subject.first_state]
    y, x = visited.T.astype(np.float64)
    with style.axes_or_new(ax, *_size(layout)) as ax:
        _draw_map(ax, layout)
        line: dict[str, Any] = {"color": style.BLUE, "linewidth": 2.0, "zorder": 3}
        ax.plot(x, y, **line)
        ax.plot(x[0], y[0], marker="o", markerfacecolor="white", markersize=7, **line)
        ax.plot(x[-1], y[-1], marker="o", markersize=7, **line)
        _finish(ax, layout, subject, title)
    return ax


def _plot_grid_search(
    subject: Subject, env: Any, ax: Axes | None, colorbar: bool
) -> Axes:
    """The moves over what they cost until the goal, with what is best from the model."""
    system: Any = subject.system
    exact = value_iteration(env.with_slots(1)).action_values
    norm = Normalize(0.0, float(-exact.max(axis=1).min()), clip=True)
    rows, columns = len(system.rows), len(system.rows[0])
    size = (6.4, 1.3) if rows == 1 else (5.4, 4.5 * rows / columns + 0.9)
    own = ax is None
    with style.axes_or_new(ax, *size) as ax:
        grid_search.draw_policy(ax, env, subject.policy, exact, norm)
        if colorbar:
            mappable = ScalarMappable(norm, grid_search.SHADES)
            name = "cost" if rows == 1 else "cost until the goal"
            palettes.add_level_bar(ax, mappable, name)
            figure: Any = ax.figure
            if own:
                style.legend(figure, grid_search.handles(), ncols=2 if rows > 1 else 4)
        ax.set_title(subject.heading("policy"))
    return ax


def layout_of(subject: Subject, shape: Any) -> Layout:
    """Where the states lie: as `shape` says, as their map does, or in rows.

    Raises:
        ValueError: `shape` does not hold the states.
    """
    count, base = subject.n_states, _single(subject.env)
    names = subject.actions
    if names[0].startswith("action ") and type(base).__name__ in KNOWN:
        known = KNOWN[type(base).__name__]
        names = known if len(known) == len(names) else names
    moves = np.array([MOVES.get(name.lower(), (0, 0)) for name in names])
    system = subject.system
    if isinstance(system, GridSearch) and shape is None:
        walls = np.array([list(row) for row in system.rows], dtype="S1")
        return Layout(system.cells, walls, moves, names)
    letters: Any = None
    if shape is None:
        letters = _letters(base, count)
        shape = _rows(count) if letters is None else letters.shape
    rows, columns = _checked_shape(shape, count)
    if letters is None or letters.shape != (rows, columns):
        letters = np.full((rows, columns), b" ", dtype="S1")
        letters.ravel()[count:] = b"x"  # beyond the last state
    places = np.stack(np.divmod(np.arange(count), columns), axis=1)
    return Layout(places, letters, moves, names)


def _single(env: Any) -> Any:
    """The first single environment behind `env`, or None."""
    base = None if env is None else env.unwrapped
    inner = getattr(base, "envs", None)
    return inner[0].unwrapped if inner else base


def _letters(base: Any, count: int) -> Any:
    """The map of an environment of Gymnasium, `(rows, columns)`, or None."""
    desc: Any = getattr(base, "desc", None)
    if type(base).__name__ == "FrozenLakeEnv" and np.size(desc) == count:
        return np.asarray(desc, dtype="S1")
    cliff: Any = getattr(base, "_cliff", None)
    if type(base).__name__ == "CliffWalkingEnv" and np.size(cliff) == count:
        letters = np.where(cliff, b"C", b" ").astype("S1")
        letters[-1, -1] = b"G"
        return letters
    return None


def _rows(count: int) -> tuple[int, int]:
    if count <= _ROW:
        return 1, count
    return math.ceil(count / _WRAPPED), _WRAPPED


def _checked_shape(shape: Any, count: int) -> tuple[int, int]:
    whole = (
        isinstance(shape, Sequence) and len(shape) == 2 and not isinstance(shape, str)
    )
    if whole:
        whole = all(
            isinstance(n, (int, np.integer)) and not isinstance(n, bool) and n >= 1
            for n in shape
        )
    if not whole or shape[0] * shape[1] < count:
        raise ValueError(
            f"shape must be two integers >= 1, rows and columns that hold {count} "
            f"states, got {validation.shown(shape)}."
        )
    return int(shape[0]), int(shape[1])


def _size(layout: Layout) -> tuple[float, float]:
    """Inches of a new figure."""
    rows, columns = layout.letters.shape
    width = min(max(3.4, 0.42 * columns + 1.2), style.WIDTH)
    cell = min((width - 1.2) / columns, 0.7)
    return width, min(max(1.9, cell * rows + 0.7), 8.0)


def _draw_cells(
    ax: Axes, layout: Layout, values: FloatArray, cmap: Any, norm: Normalize
) -> None:
    """A colour in the cell of each state."""
    grid = np.full(layout.letters.shape, np.nan)
    grid[tuple(layout.places.T)] = values
    ax.imshow(grid, cmap=cmap, norm=norm, aspect="equal", interpolation="nearest")


def _draw_map(ax: Axes, layout: Layout) -> None:
    """Obstacles, holes and goals, with lines between the cells."""
    rows, columns = layout.letters.shape
    ax.grid(visible=False)
    for letter, look in _LOOKS.items():
        for row, column in np.argwhere(layout.letters == letter):
            square = Rectangle((column - 0.5, row - 0.5), 1, 1, linewidth=0, **look)
            ax.add_patch(square)
            if letter in (b"H", b"G"):
                word = {b"H": "hole", b"G": "goal"}[letter]
                ax.text(column, row, word, ha="center", va="center", size="small")
    for row in range(rows + 1):
        ax.axhline(row - 0.5, color="0.85", linewidth=0.6, zorder=1.5)
    for column in range(columns + 1):
        ax.axvline(column - 0.5, color="0.85", linewidth=0.6, zorder=1.5)
    ax.set_xlim(-0.5 - _SPACE, columns - 0.5 + _SPACE)
    ax.set_ylim(rows - 0.5 + _SPACE, -0.5 - _SPACE)
    ax.set_aspect("equal")


def _draw_arrows(ax: Axes, layout: Layout, columns: IntArray, shown: BoolArray) -> None:
    """The move of each state."""
    rows, right = layout.moves[columns[shown]].T
    y, x = layout.places[shown].T
    ax.quiver(
        x, y, right, rows, color=_INK, angles="xy", scale_units="xy", scale=1.6,
        pivot="mid", units="xy", width=0.09, headwidth=3.6, headlength=3.6,
        headaxislength=3.2, zorder=3,
    )  # fmt: skip


def _finish(ax: Axes, layout: Layout, subject: Subject, title: str) -> None:
    rows, columns = layout.letters.shape
    last = subject.first_state + subject.n_states - 1
    ax.set_title(title)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0)
    if rows == 1 and columns <= _ROW:
        every = max(1, math.ceil(columns / 12))
        ax.set_xticks(np.arange(0, columns, every))
        ax.set_xticklabels(
            [str(subject.first_state + i) for i in range(0, columns, every)]
        )
        ax.set_yticks([])
        ax.set_xlabel("state")
    elif _plain(layout):
        ax.set_xticks([])
        ax.set_yticks(np.arange(rows))
        ax.set_yticklabels(
            [str(subject.first_state + columns * row) for row in range(rows)]
        )
        ax.set_ylabel(f"first state of each row (to {last})")
    else:
        ax.set_xticks([])
        ax.set_yticks([])


def _plain(layout: Layout) -> bool:
    """Whether the map says nothing about its cells."""
    return bool(np.isin(layout.letters, [b" ", b"x"]).all())
