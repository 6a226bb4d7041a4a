"""The scenes of an animation: an agent after some trials, and what its policy does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Wedge
from matplotlib.ticker import EngFormatter

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.pendulum.system import Pendulum
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.plotting import cells, palettes, style
from acl_gym.plotting.learning import Y_AXES
from acl_gym.plotting.maps import draws_arrows, plot_pheromone, plot_policy
from acl_gym.plotting.plane import Plane, plane_of
from acl_gym.plotting.subject import Subject, subject_of
from acl_gym.plotting.trajectories import run, without_jumps
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray, Row

_BETWEEN = 2
"""Frames from one sample of a continuous system to the next."""

_STEP = 0.1
"""Seconds that a step is shown where it has no duration."""

_HOLD, _LAST_HOLD = 0.4, 1.6
"""Seconds that the end of an episode is shown; that of the last one."""

_NEARLY_ALL = 0.999
"""Of the levels are within the scale; a single peak would take much of its colours."""

_TAIL: dict[str, Any] = {"linewidth": 1.4, "alpha": 0.9, "zorder": 5}
_DOT: dict[str, Any] = {
    **{"marker": "o", "markersize": 7, "color": "black", "markerfacecolor": "white"},
    **{"markeredgewidth": 1.4, "linestyle": "", "zorder": 6},
}


@dataclass(frozen=True)
class Stage:
    """An agent after some trials.

    Attributes:
        subject: its policy as it was then, with what is known of it.
        looks: keyword arguments of `plot_policy` and `plot_pheromone`.
        limits: of the scale of levels, the same in all stages.
        title: in two lines.
        states: where the policy went, for each frame, `(frames, variables)`; of
            numbered states `(frames, 1)`.
        frame_time: seconds of a frame.
        frames: how many there are.
        rows: the history until all stages are over.
        trial: when this was.
    """

    subject: Subject
    looks: dict[str, Any]
    limits: tuple[float, float]
    title: str
    states: FloatArray
    frame_time: float
    frames: int
    rows: list[Row]
    trial: int


def stages_of(
    agent: TabularAgent,
    trials: Sequence[int],
    seconds: float,
    env: Any,
    start: Any,
    looks: dict[str, Any],
) -> list[Stage]:
    """Let the agent learn and keep what is to be shown.

    Args:
        agent: learns up to the last trial.
        trials: after which it is shown, increasing.
        seconds: of an episode at most.
        env: where it is shown; None: its own.
        start: the initial state; None: see `plot_trajectory`.
        looks: keyword arguments of `plot_policy`.
    """
    names = {name: looks[name] for name in ("labels", "actions")}
    kept = []
    for trial in trials:
        if trial > agent.trials:
            agent.learn(trials=trial - agent.trials)
        policy = agent.policy.copy()
        known = subject_of(policy, agent.env if env is None else env, **names)
        step = getattr(known.system, "sampling_time", None)
        most = max(1, round(seconds / (_STEP if step is None else step)))
        path = run(known, start, most, seed=0)
        states = known.values(path.states)
        if step is not None:
            states = _between(states, known)
        kept.append((trial, known, _title(agent.num_timesteps, known), states))
    last = kept[-1][1]
    step = getattr(last.system, "sampling_time", None)
    frame_time = _STEP if step is None else step / _BETWEEN
    tables = [known.table for _, known, _, _ in kept if known.table is not None]
    limits = _limits(tables)
    stages = []
    for trial, known, title, states in kept:
        hold = round((_LAST_HOLD if trial == trials[-1] else _HOLD) / frame_time)
        frames = len(states) + hold
        shown = (title, states, frame_time, frames, agent.history, trial)
        stages.append(Stage(known, looks, limits, *shown))
    return stages


def draw_stage(panels: Sequence[Axes], stage: Stage) -> Callable[[int], list[Any]]:
    """Draw what stands still; return what moves the rest to a frame.

    Args:
        panels: three axes, which are cleared.
        stage: what to draw.
    """
    left, middle, right = panels
    for ax in panels:
        for child in list(ax.child_axes):
            child.remove()
        ax.clear()
    subject, looks = stage.subject, stage.looks
    policy: Any = subject.policy
    plot_policy(policy, left, env=subject.env, colorbar=False, **looks)
    plot_pheromone(
        policy, middle, env=subject.env, limits=stage.limits, colorbar=False, **looks
    )
    words = "" if not subject.variables else _plane(stage).words()
    curves = bool(subject.variables) and len(_plane(stage).shown) == 1
    positive = stage.limits[0] > 0.0
    levels = "strongest pheromone" if positive else "value of the best action"
    if curves:
        levels = "pheromone" if positive else "value"
    left.set_title("\n".join(filter(None, ["policy", words])))
    middle.set_title("\n".join(filter(None, [levels, words])))
    if curves:  # both have names at their lines
        middle.set_ylabel("")
    else:
        _explain(left, middle, stage)
    movers = [_walker(left, stage, "black"), _walker(middle, stage, "white")]
    if isinstance(subject.system, Pendulum):
        movers.append(_pendulum(right, stage))
    else:
        _curve(right, stage)
    right.set_title(stage.title)

    def move(frame: int) -> list[Any]:
        at = min(frame, len(stage.states) - 1)
        return [artist for mover in movers for artist in mover(at)]

    return move


def _explain(left: Axes, middle: Axes, stage: Stage) -> None:
    """The colours of both maps, above and beside them."""
    subject = stage.subject
    if subject.variables:
        middle.set_ylabel("")
        middle.tick_params(labelleft=False)
        if not draws_arrows(subject, _plane(stage)):
            palettes.add_bar(left, palettes.of_inputs(subject), slim=True)
    norm = palettes.norm_of(np.array(stage.limits), stage.limits)
    palettes.add_level_bar(middle, palettes.levels(norm), "", extend="max")


def _plane(stage: Stage) -> Plane:
    return plane_of(stage.subject, stage.looks["axes"], stage.looks["slice"])


def _walker(ax: Axes, stage: Stage, color: str) -> Callable[[int], list[Any]]:
    """The state, with its way until then."""
    subject = stage.subject
    if subject.variables:
        plane = _plane(stage)
        if len(plane.shown) == 1:
            return _line_walker(ax, stage.states[:, plane.shown[0]])
        places = stage.states[:, plane.shown]
        circular: Plane | None = plane
    else:
        layout = cells.layout_of(subject, None)
        numbers = stage.states[:, 0].astype(np.int64) - subject.first_state
        places, circular = layout.places[numbers][:, ::-1].astype(np.float64), None
    (tail,) = ax.plot([], [], color=color, **_TAIL)
    (dot,) = ax.plot([], [], **_DOT)

    def move(at: int) -> list[Any]:
        way = places[: at + 1]
        tail.set_data(*(way if circular is None else without_jumps(way, circular)).T)
        dot.set_data(places[at : at + 1, 0], places[at : at + 1, 1])
        return [tail, dot]

    return move


def _line_walker(ax: Axes, values: FloatArray) -> Callable[[int], list[Any]]:
    """The only state variable that is shown, as a line across the curves."""
    line = ax.axvline(values[0], color="0.2", linewidth=1.2, zorder=5)
    (dot,) = ax.plot([], [], transform=ax.get_xaxis_transform(), **_DOT)
    dot.set_clip_on(False)
    dot.set_in_layout(False)  # an empty line beyond the panel confuses the layout

    def move(at: int) -> list[Any]:
        line.set_xdata([values[at], values[at]])
        dot.set_data([values[at]], [0.0])
        return [line, dot]

    return move


def _pendulum(ax: Axes, stage: Stage) -> Callable[[int], list[Any]]:
    """The pendulum itself, with the goal behind it."""
    system: Any = stage.subject.system
    ax.set_aspect("equal")
    ax.set_xlim(-1.25, 1.25)
    ax.set_ylim(-1.25, 1.45)
    ax.set_axis_off()
    half = math.degrees(system.goal_bounds[0])
    ax.add_patch(Wedge((0, 0), 1.22, 90 - half, 90 + half, color="#A6DCC4", zorder=1))
    ax.text(0, 1.27, "goal", color=style.GREEN, ha="center", size="small")
    rod_look: dict[str, Any] = {
        "color": "0.2",
        "linewidth": 3.5,
        "solid_capstyle": "round",
    }
    (rod,) = ax.plot([], [], zorder=2, **rod_look)
    (bob,) = ax.plot([], [], "o", markersize=15, color=style.ORANGE, zorder=3)
    (pivot,) = ax.plot([0], [0], "o", markersize=6, color="0.45", zorder=4)

    def move(at: int) -> list[Any]:
        angle = stage.states[at, 0]
        x, y = math.sin(angle), -math.cos(angle)
        rod.set_data([0.0, x], [0.0, y])
        bob.set_data([x], [y])
        return [rod, bob, pivot]

    return move


def _curve(ax: Axes, stage: Stage) -> None:
    """How the ants have fared until then."""
    rows = stage.rows
    column = next(
        (name for name in ("ants_return", "ants_cost") if rows and name in rows[0]), ""
    )
    if not column:
        ax.set_axis_off()
        return
    steps = np.array([row["env_steps"] for row in rows])
    values = np.array([row[column] for row in rows])
    done = np.array([row["trial"] for row in rows]) <= stage.trial
    ax.plot(steps[done], values[done], color=style.BLUE)
    if done.any():
        ax.plot(steps[done][-1], values[done][-1], "o", color=style.BLUE)
    if column == "ants_cost" and 0.0 < 8 * values.min() < values.max():
        ax.set_yscale("log")
        style.plain_numbers(ax.yaxis)
    ax.set_xlim(0.0, 1.03 * steps[-1])
    low, high = values.min(), values.max()
    ax.set_ylim(*((low / 1.1, high * 1.1) if low > 0 else (low - 1, high + 1)))
    ax.xaxis.set_major_formatter(EngFormatter(sep=""))
    ax.set_xlabel("interactions")
    ax.set_ylabel(Y_AXES[column])


def _between(states: FloatArray, subject: Subject) -> FloatArray:
    """More states between those of the samples, circular ones the short way round."""
    count = _BETWEEN * (len(states) - 1) + 1
    at, known = np.arange(count) / _BETWEEN, np.arange(len(states))
    columns = []
    for values, variable in zip(states.T, subject.variables, strict=True):
        if variable.period is None:
            columns.append(np.interp(at, known, values))
            continue
        turned = np.unwrap(values, period=variable.period)
        placed = np.interp(at, known, turned) - variable.low
        columns.append(variable.low + placed % variable.period)
    return np.stack(columns, axis=1)


def _limits(tables: Sequence[FloatArray]) -> tuple[float, float]:
    """From the lowest to nearly the highest level of the best actions in all stages."""
    best = np.concatenate([table.max(axis=1) for table in tables])
    low, high = float(best.min()), float(np.quantile(best, _NEARLY_ALL))
    if high <= low:
        high = 10.0 * low if low > 0.0 else low + 1.0
    return low, high


def _title(interactions: int, subject: Subject) -> str:
    name = f"after {interactions:,} interactions" if interactions else "before learning"
    env = subject.vector_env()
    if env is None:
        return name
    cost = evaluate_policy_cost(subject.policy, env).cost
    return f"{name}\npolicy cost {digits(cost)}"
