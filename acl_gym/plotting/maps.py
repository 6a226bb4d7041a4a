"""Policies and pheromone over the states: what users call to see them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, Normalize

from acl_gym.envs.navigation.system import Navigation
from acl_gym.envs.pendulum.system import Pendulum
from acl_gym.plotting import cells, navigation, palettes, style
from acl_gym.plotting.names import Labels, with_unit
from acl_gym.plotting.plane import Key, Plane, plane_of
from acl_gym.plotting.subject import Subject, subject_of
from acl_gym.policies import InterpolatedPolicy
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_GOAL: dict[str, Any] = {
    **{"color": "0.1", "markerfacecolor": "#F0E442", "markersize": 6},
    **{"marker": "o", "linestyle": "", "zorder": 4, "clip_on": False},
}


def plot_policy(
    agent: Any,
    ax: Axes | None = None,
    *,
    env: Any = None,
    axes: Sequence[Key] | None = None,
    slice: Mapping[Key, float] | None = None,
    labels: Labels = None,
    actions: Sequence[str] | None = None,
    shape: tuple[int, int] | None = None,
    input: Key | None = None,
    colorbar: bool = True,
) -> Axes:
    """Draw which action a policy takes in each state.

    Two state variables span a map whose colours are the actions: physical inputs for
    the systems of this package, names otherwise. One variable gives a curve. Of more
    variables two are shown; the others have the values in `slice`, or are in the middle
    of their range, and the title says where. Numbered states are drawn as cells: the
    grids with their walls, maps that Gymnasium's own environments give, or
    `shape`; with arrows where it is known where the actions lead.

    Of an `InterpolatedPolicy` the colours are the inputs that it sets, from the lowest to
    the highest of its grid, also those between its points.

    New axes belong to a figure that pyplot does not know, so nothing needs to be
    closed: `plot_policy(agent).figure`. A notebook shows the axes
    as a picture. For a window, pass axes of `plt.subplots()`.

    Args:
        agent: an agent or a policy with a partition, or an `InterpolatedPolicy`; or any
            model with `predict`, if `env` is given.
        ax: where to draw; None makes a figure.
        env: gives names and bounds, single or vector; None takes that of the agent.
        axes: one or two state variables, by name or number; None takes two positions in
            metres, or the first two variables that are not in `slice`.
        slice: values of other variables: `{"omega": 0.0, 2: 1.5}`.
        labels: names of all state variables, or a dict from numbers to names, with
            units in brackets at the end: "speed (m/s)". An angle that the agent takes
            from its cosine and sine is one variable, in the place of the cosine.
        actions: names of all actions.
        shape: rows and columns in which numbered states lie, row by row.
        input: which input of an `InterpolatedPolicy`, by name or number; None takes the
            first, and draws those of the navigation as arrows.
        colorbar: whether a bar, or a legend, explains the colours.

    Returns:
        The axes.

    Raises:
        TypeError: `agent` or `ax` is of the wrong kind.
        ValueError: an argument does not fit the states or actions.
    """
    if isinstance(agent, InterpolatedPolicy):
        greedy = subject_of(agent.greedy, env, labels, actions)
        cells.refuse_shape(shape)
        return _plot_inputs(agent, greedy, ax, axes, slice, input, colorbar)
    if input is not None:
        raise ValueError(
            "input is for an InterpolatedPolicy, whose inputs are drawn, got "
            f"{validation.shown(input)} for {type(agent).__name__}; leave it out."
        )
    subject = subject_of(agent, env, labels, actions)
    if not subject.variables:
        return cells.plot_policy(subject, ax, shape, colorbar)
    cells.refuse_shape(shape)
    plane = plane_of(subject, axes, slice)
    if len(plane.shown) == 1:
        return _policy_curve(subject, plane, ax)
    wide = 5.2 if colorbar else 4.0
    with style.axes_or_new(ax, wide, 3.9 if plane.fixed else 3.7) as ax:
        if draws_arrows(subject, plane):
            _draw_forces(ax, subject, plane, _forces_of_actions(subject))
        else:
            colours = palettes.of_inputs(subject)
            draw_actions(ax, subject, plane, colours)
            if colorbar:
                palettes.add_bar(ax, colours)
        draw_goal(ax, subject, plane)
        _set_title(ax, "policy", subject, plane)
    return ax


def plot_pheromone(
    agent: Any,
    ax: Axes | None = None,
    *,
    action: int | str | None = None,
    limits: tuple[float, float] | None = None,
    env: Any = None,
    axes: Sequence[Key] | None = None,
    slice: Mapping[Key, float] | None = None,
    labels: Labels = None,
    actions: Sequence[str] | None = None,
    shape: tuple[int, int] | None = None,
    colorbar: bool = True,
) -> Axes:
    """Draw the pheromone over the states, on a logarithmic scale.

    Where the table has entries that are not positive, such as the action values of
    `QLearning`, the scale is linear.

    Args:
        agent: an agent or a policy with a partition and a table.
        ax: where to draw; None makes a figure, see `plot_policy`.
        action: whose level is drawn, by name or number; None draws that of the best
            action of each state, and over one state variable those of all actions.
        limits: the lowest and the highest level of the scale, to compare pictures;
            None takes those in the picture.
        env: see `plot_policy`.
        axes: see `plot_policy`.
        slice: see `plot_policy`.
        labels: see `plot_policy`.
        actions: see `plot_policy`.
        shape: see `plot_policy`.
        colorbar: whether a bar explains the colours.

    Returns:
        The axes.

    Raises:
        TypeError: `agent` or `ax` is of the wrong kind.
        ValueError: an argument does not fit the states or actions.
    """
    subject = subject_of(agent, env, labels, actions)
    column = None if action is None else _column(subject, action)
    name = level_name(subject, column)
    if not subject.variables:
        return cells.plot_levels(subject, ax, shape, column, name, limits, colorbar)
    cells.refuse_shape(shape)
    plane = plane_of(subject, axes, slice)
    levels = subject.levels(plane.states(subject))
    if len(plane.shown) == 1:
        return _level_curves(subject, plane, levels, column, ax)
    with style.axes_or_new(ax, 5.2 if colorbar else 4.0, 3.7) as ax:
        values = levels.max(axis=1) if column is None else levels[:, column]
        norm = palettes.norm_of(values, limits)
        mesh = draw_map(ax, plane, values, palettes.LEVELS, norm)
        if colorbar:
            palettes.add_level_bar(ax, mesh, name)
        _set_title(ax, _kind(subject), subject, plane)
    return ax


def draws_arrows(subject: Subject, plane: Plane) -> bool:
    """Whether actions are drawn as arrows, which need no bar that explains colours."""
    return isinstance(subject.system, Navigation) and plane.shown == (0, 2)


def draw_actions(
    ax: Axes, subject: Subject, plane: Plane, colours: palettes.Palette
) -> Any:
    """A map of the actions; what it returns is the mesh."""
    columns = subject.columns(plane.states(subject))
    cmap, norm = colours.mapping()
    places = np.asarray(colours.place)[columns]
    return draw_map(ax, plane, places, cmap, norm)


def draw_map(
    ax: Axes, plane: Plane, values: Any, cmap: str | Colormap, norm: Normalize
) -> Any:
    """Colours over the pieces of a plane."""
    mesh = ax.pcolormesh(
        *(axis.edges for axis in plane.axes), values.reshape(plane.shape()), cmap=cmap, norm=norm,
        rasterized=True,
    )  # fmt: skip
    ax.grid(visible=False)
    plane.label(ax)
    return mesh


def draw_goal(ax: Axes, subject: Subject, plane: Plane) -> None:
    """The goal of a system that has one as a point."""
    if isinstance(subject.system, Pendulum) and len(plane.shown) == 2:
        goal = (np.pi, 0.0)
        ax.plot(*(goal[i] for i in plane.shown), **_GOAL, label="goal")


def level_name(subject: Subject, column: int | None) -> str:
    """What a bar of levels is called."""
    whose = "best action" if column is None else subject.actions[column]
    return f"{_kind(subject)} of {'the ' if column is None else ''}{whose}"


def _kind(subject: Subject) -> str:
    positive = subject.table is not None and bool((subject.table > 0.0).all())
    return "pheromone" if positive else "value"


def _column(subject: Subject, action: Any) -> int:
    """The column of an action given by name or number."""
    if isinstance(action, str) and action in subject.actions:
        return subject.actions.index(action)
    whole = isinstance(action, (int, np.integer)) and not isinstance(action, bool)
    if whole and 0 <= action - subject.first_action < subject.n_actions:
        return int(action) - subject.first_action
    last = subject.first_action + subject.n_actions - 1
    raise ValueError(
        f"action must be a number {subject.first_action}..{last} or one of "
        f"{', '.join(map(repr, subject.actions))}, got {validation.shown(action)}."
    )


def _plot_inputs(
    policy: InterpolatedPolicy,
    subject: Subject,
    ax: Axes | None,
    axes: Sequence[Key] | None,
    slice: Mapping[Key, float] | None,
    input: Key | None,
    colorbar: bool,
) -> Axes:
    """The real inputs that a policy sets; see `plot_policy`.

    Args:
        policy: between the actions of a table.
        subject: the policy over this table.
        ax: see there.
        axes: see there.
        slice: see there.
        input: see there.
        colorbar: see there.
    """
    if not subject.variables:
        raise ValueError(
            "states must be numbers on axes to draw inputs over them, got numbered "
            "states; draw policy.greedy, whose actions are shown in their cells."
        )
    names = [with_unit(name) for name in policy.signals.inputs]
    column = 0 if input is None else _input_column(names, input)
    plane = plane_of(subject, axes, slice)
    kind = f"policy between {policy.greedy.n_actions} actions"
    name = style.symbol(names[column])
    low, high = (float(end) for end in policy.grid.axes[column][[0, -1]])
    size = (5.2 if colorbar else 4.0, 3.9 if plane.fixed else 3.7)
    if len(plane.shown) == 1:
        size = (4.6, 2.4)
    with style.axes_or_new(ax, *size) as ax:
        if input is None and draws_arrows(subject, plane):
            _draw_forces(ax, subject, plane, lambda states: policy.predict(states)[0])
        elif len(plane.shown) == 1:
            (points,) = plane.points()
            values = policy.predict(plane.states(subject))[0][:, column]
            ax.plot(points, values, color=style.BLUE, linewidth=1.6)
            margin = 0.05 * ((high - low) or 1.0)
            ax.set_ylim(low - margin, high + margin)
            plane.label(ax)
            ax.set_ylabel(name)
        else:
            values = policy.predict(plane.states(subject))[0][:, column]
            mesh = draw_map(ax, plane, values, *palettes.of_range(low, high))
            if colorbar:
                palettes.add_level_bar(ax, mesh, name)
            draw_goal(ax, subject, plane)
        _set_title(ax, kind, subject, plane)
    return ax


def _input_column(names: Sequence[str], key: Any) -> int:
    """The column of an input given by name, with or without its unit, or number."""
    if isinstance(key, Integral) and not isinstance(key, bool):
        found = [int(key)] if 0 <= int(key) < len(names) else []
    else:
        found = [
            i for i, name in enumerate(names) if key in {name, name.split(" (")[0]}
        ]
    if len(found) != 1:
        raise ValueError(
            f"input must be one of {', '.join(map(repr, names))} or a number "
            f"0..{len(names) - 1}, got {validation.shown(key)}."
        )
    return found[0]


def _policy_curve(subject: Subject, plane: Plane, ax: Axes | None) -> Axes:
    """The action over one state variable."""
    colours = palettes.of_inputs(subject)
    columns = subject.columns(plane.states(subject))
    with style.axes_or_new(ax, 4.6, 2.4) as ax:
        (variable,) = plane.axes
        places = np.asarray(colours.place)[columns]
        ax.stairs(
            places, variable.edges, baseline=None, color=style.BLUE, linewidth=1.6
        )
        ax.set_yticks(range(len(colours.names)), labels=colours.names)
        ax.set_ylim(-0.4, len(colours.names) - 0.6)
        plane.label(ax)
        ax.set_ylabel(colours.title)
        _set_title(ax, "policy", subject, plane)
    return ax


def _level_curves(
    subject: Subject,
    plane: Plane,
    levels: FloatArray,
    column: int | None,
    ax: Axes | None,
) -> Axes:
    """The levels of actions over one state variable."""
    shown = range(subject.n_actions) if column is None else [column]
    colours = palettes.of_inputs(subject)
    with style.axes_or_new(ax, 4.6, 2.6) as ax:
        (points,) = plane.points()
        for u in shown:
            place = int(colours.place[u])
            color = colours.ink(place)
            ax.plot(points, levels[:, u], color=color, label=colours.names[place])
        if levels.min() > 0.0:
            ax.set_yscale("log")
        plane.label(ax)
        ax.set_ylabel(_kind(subject))
        ax.legend(title=colours.title)
        _set_title(ax, _kind(subject), subject, plane)
    return ax


def _forces_of_actions(subject: Subject) -> Callable[[FloatArray], FloatArray]:
    """What gives the forces `(n, 2)` of the policy in some states."""
    system: Any = subject.system
    return lambda states: np.array(system.forces)[subject.columns(states)]


def _draw_forces(
    ax: Axes,
    subject: Subject,
    plane: Plane,
    forces_in: Callable[[FloatArray], FloatArray],
) -> None:
    """Arrows over the damping, at the velocities of the slice."""
    system: Any = subject.system
    navigation.draw_ground(ax, system)
    c1, c2 = navigation.positions(system)
    states = np.empty((c1.size, len(plane.variables)))
    values: dict[int, Any] = {**plane.fixed, plane.shown[0]: c1, plane.shown[1]: c2}
    for i, value in values.items():
        states[:, i] = value
    navigation.draw_forces(ax, system, forces_in(states))
    ax.set_xlabel(style.symbol(plane.axes[0].name))
    ax.set_ylabel(style.symbol(plane.axes[1].name))


def _set_title(ax: Axes, kind: str, subject: Subject, plane: Plane) -> None:
    lines = [subject.heading(kind), plane.words()]
    ax.set_title("\n".join(line for line in lines if line))
