"""The pictures of a design: policy, trajectories, starts, learning."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acl_gym.design.learning import GOOD, Learned
from acl_gym.design.measures import periods
from acl_gym.design.simulation import Responses
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.plant import Plant
from acl_gym.partitions import Grid
from acl_gym.plotting import palettes, plot_policy, style
from acl_gym.plotting.names import with_unit
from acl_gym.plotting.subject import Subject, subject_of
from acl_gym.policies import TablePolicy
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray

DPI = 110

_GOAL: dict[str, Any] = {"color": style.GREEN, "alpha": 0.18, "linewidth": 0}
_AFTER = 0.35  # opacity of what comes after the goal
_COLOURS = (style.BLUE, style.ORANGE, style.GREEN, style.BLACK)


def draw_policy(policy: TablePolicy, env: ControlVectorEnv, plant: Plant) -> Figure:
    """The action in each state; of more than two variables, in several slices.

    The two variables with the most cells span the maps. Of the others, up to two take a
    low, the middle and a high value; any more are at the goal, or in the middle.
    """
    size = plant.low.size
    if size <= 2:
        ax: Any = plot_policy(policy, env=env)
        mark_goal(ax, plant, tuple(range(size)))
        whole: Figure = ax.figure
        return whole
    shown = most_divided(policy)
    others = [axis for axis in range(size) if axis not in shown]
    values = [levels_shown(plant, axis, few=i < 2) for i, axis in enumerate(others)]
    slices = list(itertools.product(*values))
    columns = 3
    subject = subject_of(policy, env)
    rows = -(-len(slices) // columns)
    with style.in_style():
        figure, panels = style.small_multiples(
            len(slices), columns, 2.1 if rows > 1 else 2.4, sharex=True, sharey=True
        )
        for ax, at in zip(panels, slices, strict=True):
            where: dict[str | int, float] = dict(zip(others, at, strict=True))
            plot_policy(policy, ax, env=env, axes=shown, slice=where, colorbar=False)
            ax.set_title(_at(subject, where), fontsize="small")
            ax.set_xlabel("")
            ax.set_ylabel("")
            mark_goal(ax, plant, shown)
        x, y = (style.symbol(subject.variables[axis].name) for axis in shown)
        style.label_outer(panels, columns, x, y)
        palettes.add_bar(panels[0], palettes.of_inputs(subject), below=True)
    return figure


def draw_responses(
    responses: Sequence[Responses], labels: Sequence[str], env: ControlVectorEnv
) -> Figure:
    """Each variable and input over time, until the goal and, pale, after it.

    Args:
        responses: of one start each, with the same number of steps.
        labels: what each is called.
        env: the plant.
    """
    plant: Any = env.system
    names = [style.symbol(with_unit(name)) for name in plant.variable_names]
    inputs = [style.symbol(with_unit(name)) for name in plant.signals.inputs]
    count = len(names) + len(inputs)
    shown = _steps_shown(responses)
    time = plant.sampling_time * np.arange(shown + 1)
    with style.in_style():
        figure = style.new_figure(0.9 + 1.25 * count)
        panels = figure.subplots(count, 1, sharex=True, squeeze=False).ravel()
        for response, label, colour in zip(
            responses, labels, itertools.cycle(_COLOURS), strict=False
        ):
            until = min(int(response.steps_to_goal()[0]), shown)
            for axis, period in enumerate(periods(plant)):
                values = response.states[: shown + 1, 0, axis]
                if period is not None:
                    values = _around_goal(values, period, plant, axis)
                ax = panels[axis]
                ax.plot(time[until:], values[until:], color=colour, alpha=_AFTER)
                ax.plot(
                    time[: until + 1], values[: until + 1], color=colour, label=label
                )
            applied = plant.inputs[response.actions[:shown, 0]]
            for j in range(len(inputs)):
                held = np.append(applied[:, j], applied[-1, j])
                ax = panels[len(names) + j]
                pale = {"color": colour, "where": "post"}
                ax.step(time[until:], held[until:], alpha=_AFTER, **pale)
                ax.step(time[: until + 1], held[: until + 1], **pale)
        for axis, ax in enumerate(panels[: len(names)]):
            _band(ax, plant, axis)
        if any(not response.success()[0] for response in responses):
            for ax in panels:
                limit = plant.sampling_time * responses[0].limit
                ax.axvline(limit, color="0.4", linewidth=0.8, linestyle=":")
        for ax, name in zip(panels, [*names, *inputs], strict=True):
            ax.set_ylabel(name)
        panels[-1].set_xlabel("time (s)")
        panels[0].legend(loc="best", fontsize="small")
        figure.align_ylabels(panels)
    return figure


def draw_starts(
    responses: Responses, policy: TablePolicy, env: ControlVectorEnv
) -> Figure:
    """What each start costs, over two variables, and which do not reach the goal."""
    plant: Any = env.system
    names = [style.symbol(with_unit(name)) for name in plant.variable_names]
    states, success = responses.states[0], responses.success()
    costs = responses.episode_costs()
    axes = most_divided(policy) if len(names) > 1 else (0,)
    with style.in_style():
        figure = style.new_figure(3.6, 5.6)
        ax = figure.subplots()
        if len(axes) == 1:
            x, y = states[:, axes[0]], costs
            ax.scatter(x[success], y[success], s=10, color=style.BLUE)
            ax.set_ylabel("cost")
        else:
            x, y = states[:, axes[0]], states[:, axes[1]]
            top = float(np.quantile(costs, 0.99))
            dots = ax.scatter(
                *(x[success], y[success]), s=12, c=costs[success],
                cmap=palettes.LEVELS, vmax=max(top, float(costs.min()) + 1e-12),
            )  # fmt: skip
            palettes.add_level_bar(ax, dots, "cost", extend="max")
            ax.set_ylabel(names[axes[1]])
            ax.set_ylim(plant.low[axes[1]], plant.high[axes[1]])
            mark_goal(ax, plant, axes)
        ax.set_xlim(plant.low[axes[0]], plant.high[axes[0]])
        ax.scatter(
            *(x[~success], y[~success]), s=30, marker="x", color=style.ORANGE, zorder=3,
            label="goal not reached",
        )  # fmt: skip
        ax.set_xlabel(names[axes[0]])
        if not success.all():
            ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize="small")
        for axis, of in zip(axes, (ax.xaxis, ax.yaxis), strict=False):
            span = plant.high[axis] - plant.low[axis]
            if names[axis].endswith("(rad)") and np.isclose(span, 2.0 * np.pi):
                style.multiples_of_pi(of)
    return figure


def draw_learning(learned: Learned) -> Figure:
    """Cost and success rate over the interactions, and which policy was kept."""
    rows = learned.rows
    steps = [row.interactions for row in rows]
    with style.in_style():
        figure = style.new_figure(3.4)
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.plot(steps, [row.now.cost for row in rows], color=style.BLUE)
        upper.set_yscale("log")
        upper.set_ylabel("cost")
        rates = [100.0 * row.now.success_rate for row in rows]
        lower.plot(steps, rates, color=style.BLUE)
        lower.axhline(100.0 * GOOD, **style.BOUND)
        lower.set_ylim(-3, 103)
        lower.set_ylabel("success (%)")
        lower.set_xlabel("interactions with the model")
        for ax in (upper, lower):
            ax.axvline(learned.interactions_of_best, color=style.ORANGE, linewidth=1.0)
        upper.annotate(
            "kept", (learned.interactions_of_best, 1.0), xytext=(-4, -4),
            xycoords=("data", "axes fraction"), textcoords="offset points",
            color=style.ORANGE, fontsize="small", ha="right", va="top",
        )  # fmt: skip
        style.plain_log(upper.yaxis)
    return figure


def most_divided(policy: TablePolicy) -> tuple[int, int]:
    """The two variables with the most cells, in their order."""
    partition = policy.partition
    if not isinstance(partition, Grid):
        return 0, 1
    sizes = np.array([line.size for line in partition.centres])
    first, second = sorted(np.argsort(-sizes, kind="stable")[:2].tolist())
    return first, second


def levels_shown(plant: Plant, axis: int, few: bool) -> list[float]:
    """Values at which a variable is held: low, at the goal, high; or at the goal."""
    low, high = float(plant.low[axis]), float(plant.high[axis])
    middle, box = 0.5 * (low + high), plant.goal_box
    if box is not None and np.isfinite(box[:, axis]).all():
        middle = float(np.clip(box[:, axis].mean(), low, high))
    return [0.5 * (low + middle), middle, 0.5 * (middle + high)] if few else [middle]


def _at(subject: Subject, where: dict[str | int, float]) -> str:
    parts = []
    for axis, value in where.items():
        variable = subject.variables[int(axis)]
        unit = f" {variable.unit}" if variable.unit else ""
        number = digits(value).replace("-", "\N{MINUS SIGN}")
        parts.append(f"{style.symbol(variable.symbol)} {number}{unit}")
    return ", ".join(parts)


def mark_goal(ax: Axes, plant: Plant, shown: tuple[int, ...]) -> None:
    """A frame around the goal in a plane of two variables."""
    box = plant.goal_box
    if box is None or len(shown) != 2 or not np.isfinite(box).all():
        return
    (left, right), (bottom, top) = (box[:, axis] for axis in shown)
    for shift in _shifts(plant, shown[0]):
        ax.plot(
            np.array([left, right, right, left, left]) + shift,
            [bottom, bottom, top, top, bottom],
            color="0.1", linewidth=1.0, scalex=False, scaley=False,
        )  # fmt: skip


def _shifts(plant: Plant, axis: int) -> tuple[float, ...]:
    """A goal at the end of a circle is seen at both ends."""
    period = periods(plant)[axis]
    return (0.0,) if period is None else (-period, 0.0, period)


def _band(ax: Axes, plant: Plant, axis: int) -> None:
    box = plant.goal_box
    if box is not None and np.isfinite(box[:, axis]).all():
        ax.axhspan(float(box[0, axis]), float(box[1, axis]), **_GOAL)


def _around_goal(
    values: FloatArray, period: float, plant: Plant, axis: int
) -> FloatArray:
    """A circular variable without jumps, shifted so that it ends at the goal."""
    drawn = np.unwrap(values, period=period)
    box = plant.goal_box
    if box is not None and np.isfinite(box[:, axis]).all():
        centre = box[:, axis].mean()
        drawn = drawn - period * np.round((drawn[-1] - centre) / period)
    return np.asarray(drawn)


def _steps_shown(responses: Sequence[Responses]) -> int:
    """A while beyond the last goal, within twice the time limit."""
    last = max(int(response.steps_to_goal()[0]) for response in responses)
    whole = len(responses[0].actions)
    return max(2, min(whole, int(1.3 * last) + 5))
