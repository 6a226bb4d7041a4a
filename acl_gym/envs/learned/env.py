"""Recorded data as a vector environment, in which any agent walks."""

from __future__ import annotations

import warnings
from typing import Any, Self

import numpy as np
from gymnasium.vector import AutoresetMode

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.learned.description import rows_of_inputs
from acl_gym.envs.learned.dynamics import LearnedDynamics
from acl_gym.envs.learned.features import periods_of, variable_ends
from acl_gym.envs.learned.outcomes import LearnedCost, LearnedGoal, can_be_learned
from acl_gym.envs.learned.quality import DataWarning, goal_doubts
from acl_gym.envs.learned.system import LearnedSystem
from acl_gym.envs.learned.transitions import Transitions
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

MOST_INPUTS = 50
"""Different inputs in a recording that may become actions of their own."""

MARGIN = 0.05
"""By how much of its range a variable may leave what was recorded, where no bounds are
known."""


class LearnedVectorEnv(ControlVectorEnv):
    """Recorded transitions of a plant, made into a native vector environment.

    A regression learns what each step changes; ants then walk in it as in any other
    environment, without another touch of the plant (§7.3 of the thesis).

    >>> import gymnasium as gym
    >>> import numpy as np
    >>> from acl_gym import LearnedVectorEnv, ReturningACL, Transitions
    >>> data = Transitions.record(gym.make("acl_gym/Pendulum-v0"), 100, hold=3, seed=0)
    >>> model = LearnedVectorEnv(
    ...     data,
    ...     num_envs=20,
    ...     goal=[np.pi, 0.0],
    ...     tolerance=[0.1, 0.1],
    ...     cost=([1.0, 0.1], 0.05),
    ... )
    >>> colony = ReturningACL(model, seed=0).learn(total_timesteps=20_000)

    Args:
        transitions: what was recorded.
        num_envs: number of slots.
        goal: where an episode ends in success; see `acl_gym.plant`. None learns it from
            recorded terminations, if there are any; otherwise there is no goal.
        tolerance: half-width of a goal that is a state.
        cost: what a step costs; see `acl_gym.plant`: a function of x (the next state)
            and u, (Q, R) or "time". None learns it from recorded rewards.
        inputs: what each action sets, `(n_actions,)` or `(n_actions, n_inputs)`. None
            takes those of the recorded environment, or those that occur in the data.
        low: lower end of each variable, at which it is clipped; None takes that of the
            recording, or the least recorded value less a twentieth of the range.
        high: upper end of each.
        initial: where episodes begin: "data", in recorded states; "starts", where
            recorded runs began; "anywhere", half of them in recorded states and half
            anywhere within the bounds; or see `acl_gym.plant`.
        evaluation_states: rows of states from which policies are evaluated; None draws
            100 initial states once.
        max_episode_steps: T, after which an episode is truncated, >= 1.
        regressor: see `LearnedDynamics`.
        per_action: see there.
        n_draws: see there; only with `uncertain`.
        uncertain: let each slot walk in its own function, drawn anew in each episode
            from all that fit the data, so that a policy is learned that works for all.
        pessimism: how much more a step costs where the model is not sure, for a `spread`
            of 1, >= 0. None takes 0 with one or two state variables, and with more, where
            no model is right everywhere, a tenth of the most that a step costs.
        most_spread: where the `spread` of a step is more than this, > 0, the episode
            ends in failure: it is charged the cost of the most expensive step, for this
            step and for each step that was left. So no policy gains by leaving the data.
            None lets ants go anywhere.
        dynamics: what was learned already from a recording of this plant, in place of
            learning it.
        begin: see `LearnedDynamics`.
        seed: of the draws; None takes another one each time.
        autoreset_mode: see `ControlVectorEnv`.
        render_mode: see there.

    Attributes:
        transitions: what was recorded.
        dynamics: the regression, with its errors in cross-validation.
        learned_cost: the `LearnedCost`; None where `cost` was given.
        learned_goal: the `LearnedGoal`; None where `goal` was given or there is none.

    Raises:
        TypeError: `transitions`, `regressor`, `seed`, `uncertain`, `per_action`,
            `dynamics` or `begin` are of the wrong kind.
        ValueError: there are too few steps, no rewards and no cost, or an argument does
            not fit the data.

    Warns:
        DataWarning: something speaks against learning from this data, see
            `Transitions.doubts`, or the goal is far from what was recorded.
    """

    system_type = LearnedSystem
    painter = "acl_gym.envs.plant.painter:PlantPainter"

    def __init__(
        self,
        transitions: Transitions,
        num_envs: int = 1,
        *,
        goal: Any = None,
        tolerance: Any = None,
        cost: Any = None,
        inputs: Any = None,
        low: Any = None,
        high: Any = None,
        initial: Any = "data",
        evaluation_states: Any = None,
        max_episode_steps: int = 300,
        regressor: Any = "auto",
        per_action: bool = False,
        n_draws: int = 10,
        uncertain: bool = False,
        pessimism: float | None = 0.0,
        most_spread: float | None = None,
        dynamics: LearnedDynamics | None = None,
        begin: LearnedDynamics | None = None,
        seed: int | None = 0,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        if not isinstance(transitions, Transitions):
            raise TypeError(
                "transitions must be acl_gym.Transitions, got "
                f"{validation.shown(transitions)}; Transitions.from_csv and others make "
                "them."
            )
        steps = validation.integer("max_episode_steps", max_episode_steps, at_least=1)
        seed = validation.seed(seed)
        uncertain = validation.boolean("uncertain", uncertain)
        per_action = validation.boolean("per_action", per_action)
        self.transitions = transitions
        known = transitions.description
        actions = _inputs(inputs, transitions)
        if len(actions) < 2:
            raise ValueError(
                "a controller needs two actions or more, got the one input "
                f"{actions[0].tolist()}; record with inputs that change, or give inputs=."
            )
        for doubt in transitions.doubts():
            warnings.warn(DataWarning(doubt), stacklevel=2)
        if dynamics is not None:
            _check_dynamics(dynamics, transitions)
        else:
            dynamics = LearnedDynamics(
                transitions,
                regressor,
                per_action=per_action,
                n_draws=n_draws if uncertain else 0,
                seed=seed,
                begin=begin,
            )
        self.learned_goal, self.learned_cost = None, None
        if goal is None and can_be_learned(transitions):
            goal = self.learned_goal = LearnedGoal(transitions)
        if cost is None:
            cost = self.learned_cost = LearnedCost(transitions, regressor)
        bottom, top = _bounds(low, high, goal, tolerance, transitions)
        super().__init__(
            num_envs,
            max_episode_steps=steps,
            autoreset_mode=autoreset_mode,
            render_mode=render_mode,
            dynamics=dynamics,
            low=bottom,
            high=top,
            circular=tuple(np.flatnonzero(periods_of(known)).tolist()),
            inputs=actions,
            sampling_time=known.sampling_time or 1.0,
            goal=goal,
            tolerance=tolerance,
            cost=cost,
            initial=_initial(initial, transitions, bottom, top),
            evaluation_states=evaluation_states,
            evaluation_steps=steps,
            pessimism=pessimism,
            most_spread=most_spread,
            uncertain=uncertain,
        )

    @property
    def system(self) -> LearnedSystem:
        """The parameters and the learned dynamics."""
        found: Any = self._system
        return found  # type: ignore[no-any-return]

    @property
    def dynamics(self) -> LearnedDynamics:
        """The regression, with its errors in cross-validation."""
        return self.system.dynamics

    def spread(self, states: Any, actions: Any) -> FloatArray:
        """How uncertain a step is, `(n,)`; see `LearnedDynamics.spread`.

        Args:
            states: `(n, n_variables)`, an angle as one variable.
            actions: `(n,)`, or one for all.
        """
        return self.dynamics.spread(*self._pairs(states, actions))

    def distance(self, states: Any, actions: Any) -> FloatArray:
        """How far the nearest recorded step is, `(n,)`; see `LearnedDynamics.distance`.

        Args:
            states: `(n, n_variables)`, an angle as one variable.
            actions: `(n,)`, or one for all.
        """
        return self.dynamics.distance(*self._pairs(states, actions))

    def _charge(self, failed: BoolArray, rewards: FloatArray) -> None:
        """Let slots that leave the data pay for the steps that were left."""
        limit = self._limit or self.system.evaluation_steps
        left = np.maximum(limit - self._steps[failed], 0) + 1  # with the step just made
        rewards[failed] = -self.system.dearest_step * left

    def _pairs(self, states: Any, actions: Any) -> tuple[FloatArray, FloatArray]:
        """States and inputs, variables first."""
        rows = self.system.checked_states(states)[:, : self.system.low.size]
        numbers = validation.as_array(actions)
        if numbers is None or numbers.dtype.kind not in "iu":
            raise TypeError(
                f"actions must be integers, got {validation.shown(actions)}."
            )
        inputs = self.system.inputs
        if numbers.shape not in ((), (len(rows),)):
            raise ValueError(
                f"actions must be one or {len(rows)}, as there are states, got shape "
                f"{numbers.shape}."
            )
        chosen: IntArray = np.broadcast_to(numbers, len(rows)).astype(np.int64)
        if ((chosen < 0) | (chosen >= len(inputs))).any():
            raise ValueError(
                f"actions must be 0 to {len(inputs) - 1}, got "
                f"{validation.shown(actions)}."
            )
        return np.ascontiguousarray(rows.T), np.ascontiguousarray(inputs[chosen].T)

    def _constructed(self, num_envs: int, **arguments: Any) -> Self:
        """Nothing is learned again."""
        made = type(self).__new__(type(self))
        made.transitions = self.transitions
        made.learned_goal, made.learned_cost = self.learned_goal, self.learned_cost
        ControlVectorEnv.__init__(made, num_envs, **arguments)
        return made


def _check_dynamics(dynamics: Any, transitions: Transitions) -> None:
    """Check that `dynamics` was learned, and from a plant with these variables.

    Raises:
        TypeError: it is no `LearnedDynamics`.
        ValueError: its states or inputs have other names.
    """
    if not isinstance(dynamics, LearnedDynamics):
        raise TypeError(
            "dynamics must be a LearnedDynamics or None, got "
            f"{validation.shown(dynamics)}; take that of another LearnedVectorEnv."
        )
    difference = dynamics.description.difference(transitions.description)
    if difference is not None:
        raise ValueError(
            f"dynamics must be learned from the plant of transitions, got {difference}; "
            "leave it out to learn it anew."
        )


def _inputs(inputs: Any, transitions: Transitions) -> Any:
    """The inputs of each action, `(n_actions, n_inputs)`."""
    known = transitions.description
    if inputs is not None:
        return rows_of_inputs(inputs, len(known.input_names))
    if known.values is not None:
        return np.array(known.values)
    found = np.unique(transitions.inputs, axis=0)
    if len(found) > MOST_INPUTS:
        raise ValueError(
            f"inputs must be given where more than {MOST_INPUTS} different ones were "
            f"recorded, got {len(found):,}; give those that actions are to set, such as "
            "inputs=[-1, 0, 1]."
        )
    return found


def _bounds(
    low: Any, high: Any, goal: Any, tolerance: Any, transitions: Transitions
) -> tuple[FloatArray, FloatArray]:
    """Finite ends of the variables, wide enough for the goal."""
    known = transitions.description
    both = np.concatenate([transitions.states, transitions.next_states])
    seen = known.shown_angles.variables(both)
    least, most = seen.min(axis=0), seen.max(axis=0)
    margin = np.maximum(MARGIN * (most - least), 1e-3 * (1.0 + np.abs(most)))
    bottom, top = variable_ends(known)
    bottom = np.where(np.isfinite(bottom), bottom, least - margin)
    top = np.where(np.isfinite(top), top, most + margin)
    circle = periods_of(known) > 0.0
    centre = None if goal is None or callable(goal) else validation.as_array(goal)
    if centre is not None and centre.shape == bottom.shape:
        centre = validation.real_array("goal", goal)
        half = (top - bottom) / 40
        if tolerance is not None:
            half = validation.real_array("tolerance", tolerance, finite=False)
            if half.shape not in ((), (1,), bottom.shape):
                raise ValueError(
                    f"tolerance must be a number or {bottom.size} of them, got "
                    f"{validation.shown(tolerance)}."
                )
        ends = np.stack([centre - half, centre + half])
        columns = np.array(known.shown_angles.columns)[~circle]
        recorded = np.stack([least, most])[:, ~circle]
        names = [known.state_names[column] for column in columns]
        for doubt in goal_doubts(recorded, ends[:, ~circle], names):
            warnings.warn(DataWarning(doubt), stacklevel=3)
        bottom = np.where(circle, bottom, np.minimum(bottom, ends[0]))
        top = np.where(circle, top, np.maximum(top, ends[1]))
    return _given("low", low, bottom), _given("high", high, top)


def _given(name: str, values: Any, otherwise: FloatArray) -> FloatArray:
    """Ends where some are given, and None stands for the others."""
    if values is None:
        return otherwise
    listed = validation.elements(values)
    if listed is None or len(listed) != otherwise.size:
        raise ValueError(
            f"{name} must hold a number or None for each of the {otherwise.size} "
            f"variables, got {validation.shown(values)}."
        )
    filled = [o if g is None else g for g, o in zip(listed, otherwise, strict=True)]
    return validation.real_array(name, filled)


def _initial(
    initial: Any, transitions: Transitions, low: FloatArray, high: FloatArray
) -> Any:
    if not isinstance(initial, str):
        return initial
    validation.one_of("initial", initial, ("data", "starts", "anywhere"))
    rows = transitions.starts if initial == "starts" else transitions.states
    found = transitions.description.shown_angles.variables(rows)
    circle = periods_of(transitions.description) > 0.0
    found = np.where(circle, found, np.clip(found, low, high))
    return _Anywhere(found, low, high) if initial == "anywhere" else found


class _Anywhere:
    """Draws about half of the states from some rows, and the others within bounds."""

    def __init__(self, rows: FloatArray, low: FloatArray, high: FloatArray) -> None:
        self._rows, self._low, self._high = rows, low, high

    def __call__(self, rng: np.random.Generator, count: int) -> FloatArray:
        drawn = rng.uniform(self._low, self._high, (count, self._low.size))
        some = self._rows[rng.integers(len(self._rows), size=count)]
        return np.where((rng.random(count) < 0.5)[:, None], some, drawn)
