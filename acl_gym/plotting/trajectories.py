"""One episode: states and inputs over time, or a path through a plane of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from matplotlib.axes import Axes

from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.limits import usual_max_steps
from acl_gym.envs.navigation.system import Navigation
from acl_gym.envs.pendulum.system import Pendulum
from acl_gym.evaluation import Trajectory, record_trajectory
from acl_gym.evaluation.predictions import checked_actions
from acl_gym.evaluation.rollout import Rollout
from acl_gym.plotting import cells, navigation, style
from acl_gym.plotting.names import Labels
from acl_gym.plotting.plane import Key, Plane, plane_of
from acl_gym.plotting.subject import Subject, subject_of
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_LINE: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.5}
_START: dict[str, Any] = {
    **{"color": "0.1", "marker": "o", "markerfacecolor": "white", "markersize": 5},
    **{"linestyle": "", "zorder": 4, "clip_on": False},
}
_END: dict[str, Any] = {**_START, "color": style.ORANGE}
_KINDS = ("time", "plane")

_MOST_NAMES = 6
"""Names of actions beside an axis; numbers where there are more."""


def plot_trajectory(
    agent: Any,
    ax: Any = None,
    *,
    kind: str = "time",
    env: Any = None,
    start: Any = None,
    max_steps: int | None = None,
    seed: int | None = None,
    axes: Sequence[Key] | None = None,
    labels: Labels = None,
    actions: Sequence[str] | None = None,
) -> Any:
    """Draw one episode under a policy.

    An environment of this package is copied and starts where `start` says. Any other is
    run itself for one episode: it is reset and stepped, so do not call this in the
    middle of an episode of yours.

    Args:
        agent: an agent, or a policy with `env`; or a `Trajectory` of
            `record_trajectory`, which `env` gives names.
        ax: where to draw; None makes a figure, see `plot_policy`. For `kind="time"`
            either an axes for each state variable and one for the input, or one axes
            for all.
        kind: `"time"`, a panel for each state variable and one for the input or action;
            or `"plane"`, a path through two state variables, or through the cells of
            numbered states.
        env: where to run the policy; None takes the environment of the agent.
        start: the initial state, in environments of this package. None hangs the
            pendulum at rest, puts the vehicle at rest into a corner, and elsewhere
            takes the first of `evaluation_states`.
        max_steps: the longest episode, >= 1. None takes the `evaluation_steps` of an
            environment of this package; elsewhere T of the agent, or the time limit of
            the environment, or 300.
        seed: of the reset; None continues the environment's stream. A copy of an
            environment of this package ignores it.
        axes: the two state variables of `kind="plane"`, by name or number.
        labels: names of the state variables, see `plot_policy`.
        actions: names of the actions.

    Returns:
        The axes; for `kind="time"` without one `ax` for all, an array of them.

    Raises:
        TypeError: `agent`, `env` or `ax` is of the wrong kind.
        ValueError: an argument does not fit the environment, or the policy returns what
            are no actions of it.
    """
    validation.one_of("kind", kind, _KINDS)
    if isinstance(agent, Trajectory):
        if env is None:
            raise ValueError(
                "env must be given with a Trajectory, got None; pass the environment "
                "that it was recorded in, which names its states and actions."
            )
        subject, path = subject_of(_Replay(), env, labels, actions), agent
    else:
        subject = subject_of(agent, env, labels, actions)
        limit = max_steps
        if limit is None and subject.vector_env() is None:
            limit = getattr(agent, "max_steps", None)
        path = run(subject, start, limit, seed)
    if kind == "plane":
        return _plot_path(subject, path, ax, axes)
    if axes is not None:
        raise ValueError(
            f'axes are for kind="plane", got {validation.shown(axes)}; leave them out.'
        )
    return _plot_over_time(subject, path, ax)


class _Replay:
    """Stands for the unknown policy of a recorded trajectory."""

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        """Not needed: a trajectory has its actions."""
        raise NotImplementedError


def run(subject: Subject, start: Any, max_steps: int | None, seed: Any) -> Trajectory:
    """One episode of a policy in its environment."""
    env = subject.env
    if env is None:
        raise ValueError(
            "env must be given where the agent has none, got None; pass the "
            "environment in which the policy is to be run."
        )
    base = subject.vector_env()
    if base is not None:
        begin = (
            start_of(base.system)
            if start is None
            else validation.real_array("start", start)
        )
        return record_trajectory(
            subject.policy,
            base.with_slots(1),
            np.atleast_1d(begin),
            max_steps=max_steps,
        )
    if start is not None:
        raise ValueError(
            "start can only be set in vector environments of acl_gym, got "
            f"{type(env.unwrapped).__name__}; use seed."
        )
    if max_steps is None:
        max_steps = usual_max_steps(env)
    steps = validation.integer("max_steps", max_steps, at_least=1)
    if isinstance(env, VectorEnv):
        return _run_slot(subject, env, steps, seed)
    return _run_single(subject, env, steps, seed)


def _run_slot(subject: Subject, env: Any, steps: int, seed: Any) -> Trajectory:
    """The episode of slot 0."""
    rollout = Rollout(env, steps)
    observation = rollout.start(seed=seed, record=True)
    while rollout.ants.size and rollout.ants[0] == 0:
        allowed = rollout.allowed()
        masks = {} if allowed is None else {"action_masks": allowed}
        chosen = checked_actions(
            subject.policy.predict(observation[rollout.ants], **masks),
            rollout.ants,
            rollout.first_action,
            rollout.n_actions,
        )
        observation = rollout.step(chosen - rollout.first_action).observation
    walk = rollout.episodes()[0]
    states = walk.observations.reshape(len(walk.observations), -1)
    return Trajectory(
        states.astype(np.float64), walk.actions, walk.stage_costs, walk.terminated
    )


def _run_single(
    subject: Subject, env: gym.Env[Any, Any], steps: int, seed: Any
) -> Trajectory:
    observation, info = env.reset(seed=seed)
    states, taken, costs, terminated = [observation], [], [], False
    for _ in range(steps):
        mask = info.get("action_mask")
        masks = {} if mask is None else {"action_masks": mask}
        batch = np.asarray(observation)[None]
        chosen = checked_actions(
            subject.policy.predict(batch, **masks),
            np.zeros(1, np.int64),
            subject.first_action,
            subject.n_actions,
        )
        action = int(chosen[0])
        observation, reward, terminated, truncated, info = env.step(action)
        states.append(observation)
        taken.append(action - subject.first_action)
        costs.append(-float(reward))
        if terminated or truncated:
            break
    flat = np.stack([np.ravel(state).astype(np.float64) for state in states])
    return Trajectory(flat, np.array(taken), np.array(costs), bool(terminated))


def start_of(system: ControlSystem) -> FloatArray:
    """A telling initial state: hanging at rest, or in a corner at rest."""
    if isinstance(system, Pendulum):
        return np.zeros(2)
    if isinstance(system, Navigation):
        return np.array([-system.position_max, 0.0, -system.position_max, 0.0])
    return np.asarray(system.evaluation_states()[0], dtype=np.float64)


def _times(subject: Subject, path: Trajectory) -> tuple[FloatArray, str]:
    """When the states were, and what the axis is called."""
    step = getattr(subject.system, "sampling_time", None)
    count = np.arange(len(path.states), dtype=np.float64)
    return (count, "step") if step is None else (count * step, "time (s)")


def _plot_over_time(subject: Subject, path: Trajectory, ax: Any) -> Any:
    time, name = _times(subject, path)
    signals = _signals(subject, path)
    if isinstance(ax, Axes):
        for label, values, period in signals:
            drawn = values if period is None else np.unwrap(values, period=period)
            ax.plot(time, drawn, label=style.symbol(label))
        ax.set_xlabel(name)
        ax.legend()
        return ax
    count = len(signals) + 1
    if ax is not None:
        panels = [style.checked_axes(each) for each in np.ravel(ax)]
        if len(panels) != count:
            raise ValueError(
                f"ax must be one axes or {count}, one for each state variable and one "
                f"for the input, got {len(panels)}."
            )
        _draw_panels(subject, path, panels, signals)
    else:
        with style.in_style():
            figure = style.new_figure(0.5 + 1.15 * count, 5.4, style.SCREEN_DPI)
            options = {"axes_class": style.ShownAxes}
            panels = list(
                figure.subplots(
                    count, 1, sharex=True, squeeze=False, subplot_kw=options
                ).ravel()
            )
            _draw_panels(subject, path, panels, signals)
            figure.align_ylabels(panels)
            style.keep_style(figure)
    return np.array(panels, dtype=object)


Signal = tuple[str, FloatArray, float | None]
"""The name of a state variable, its values, and its period or None."""


def _signals(subject: Subject, path: Trajectory) -> list[Signal]:
    if not subject.variables:
        return [("state", path.states[:, 0], None)]
    return [
        (variable.name_in_short(), values, variable.period)
        for variable, values in zip(
            subject.variables, subject.values(path.states).T, strict=True
        )
    ]


def _inputs(subject: Subject) -> tuple[list[str], Any, list[FloatArray]]:
    """Names of the panel's lines, ticks of actions, and what each action stands for."""
    if subject.inputs is None:
        return ["action"], subject.actions, [np.arange(float(subject.n_actions))]
    return list(subject.input_names), None, list(subject.inputs.T)


def _draw_panels(
    subject: Subject, path: Trajectory, panels: list[Axes], signals: list[Signal]
) -> None:
    """A variable in each panel, and the inputs in the last."""
    time, name = _times(subject, path)
    for panel, (label, values, period) in zip(panels[:-1], signals, strict=True):
        drawn = values if period is None else np.unwrap(values, period=period)
        if subject.variables:
            panel.plot(time, drawn, **_LINE)
        else:
            panel.step(time, drawn, where="post", **_LINE)
        panel.set_ylabel(style.symbol(label))
        if period is not None and label.endswith("(rad)"):
            style.multiples_of_pi(panel.yaxis)
    names, ticks, meanings = _inputs(subject)
    last = panels[-1]
    for column, (label, of_action) in enumerate(zip(names, meanings, strict=True)):
        # The last input holds until the last state.
        held = of_action[np.append(path.actions, path.actions[-1:])]
        color = (style.ORANGE, style.GREEN, style.BLACK)[column % 3]
        last.step(time, held, where="post", color=color, label=style.symbol(label))
    if len(names) == 1:
        last.set_ylabel(style.symbol(names[0]))
    else:
        last.set_ylabel("input")
        last.legend(loc="best")
    if ticks is not None and len(ticks) <= _MOST_NAMES:
        last.set_yticks(range(len(ticks)), labels=ticks)
        last.set_ylim(-0.4, len(ticks) - 0.6)
    last.set_xlabel(name)
    panels[0].set_title(_result(subject, path))


def _result(subject: Subject, path: Trajectory) -> str:
    time, name = _times(subject, path)
    end = f"{time[-1]:.3g} s" if name == "time (s)" else f"{len(path.costs)} steps"
    if subject.system is None:
        return f"{end}, return {0.0 - path.costs.sum():.4g}"
    how = "at the goal after" if path.success else "not at the goal in"
    return f"{how} {end}, cost {path.costs.sum():.3g}"


def _plot_path(subject: Subject, path: Trajectory, ax: Axes | None, axes: Any) -> Axes:
    if not subject.variables:
        return cells.plot_path(subject, path.states[:, 0], ax, _result(subject, path))
    plane = plane_of(subject, axes)
    if len(plane.shown) != 2:
        raise ValueError(
            'kind="plane" needs two state variables, got '
            f'{len(subject.variables)}; use kind="time".'
        )
    ground = isinstance(subject.system, Navigation) and plane.shown == (0, 2)
    with style.axes_or_new(ax, 4.2, 3.8) as ax:
        if ground:
            system: Any = subject.system
            navigation.draw_ground(ax, system)
        shown = subject.values(path.states)[:, plane.shown]
        (x, y), *_, last = shown
        ax.plot(*without_jumps(shown, plane).T, marker=".", markersize=3, **_LINE)
        ax.plot(x, y, **_START, label="start")
        ax.plot(*last, **_END, label="end")
        if not ground:
            plane.label(ax)
        ax.set_xlabel(style.symbol(plane.axes[0].name))
        ax.set_ylabel(style.symbol(plane.axes[1].name))
        ax.legend(loc="best")
        ax.set_title(_result(subject, path))
    return ax


def without_jumps(states: FloatArray, plane: Plane) -> FloatArray:
    """States `(n, 2)` with a gap wherever a circular variable jumps to its other end."""
    jumps = np.zeros(len(states) - 1, dtype=np.bool_)
    for column, variable in enumerate(plane.axes):
        if variable.period is not None:
            jumps |= np.abs(np.diff(states[:, column])) > 0.5 * variable.period
    return np.insert(states, np.flatnonzero(jumps) + 1, np.nan, axis=0)
