"""A system from the user's own equations: parameters, bounds, goal and cost."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.control.parameters import MOST_SUBSTEPS
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.control.system import ControlSystem, SlotError
from acl_gym.envs.plant import kernels, targets
from acl_gym.envs.plant.dynamics import Equations, sample_count
from acl_gym.envs.plant.initial import InitialStates
from acl_gym.envs.plant.models import Model, is_model
from acl_gym.envs.plant.uncertain import PlantParameters
from acl_gym.utils import validation
from acl_gym.utils.boxes import input_bounds
from acl_gym.utils.typing import BoolArray, FloatArray

_NOTHING = np.empty((0, 0))
_EVALUATED = 100  # states, as many as the pendulum has

_MOST_CORNERS = 8
"""Real inputs of whose range all corners are tried; of more the two ends."""


class Plant(ControlSystem):
    """A system of the user's own; the arguments are those of `acl_gym.plant`.

    Uncertain parameters are further variables of the state, which stay as they were drawn
    and are not observed. So a state that is set, remembered or sent to another process
    takes its parameters with it.

    Args:
        evaluation_steps: T of an evaluation, `max_episode_steps` of `plant`.

    Attributes:
        low: lower ends of the variables, `(state_size,)`.
        high: upper ends.
        inputs: of each action, `(n_actions, n_inputs)`; where they are real, some from
            their range, the ends among them.
        real_inputs: their range, where they are real; None where actions are numbered.
        parameters: what the dynamics is given by name, and what is uncertain of it.
    """

    circular: tuple[int, ...]  # type: ignore[misc]
    evaluation_steps: int  # type: ignore[misc]
    fully_observed: bool  # type: ignore[misc]

    def __init__(
        self,
        *,
        dynamics: Any,
        low: Any,
        high: Any,
        inputs: Any,
        sampling_time: float,
        goal: Any,
        cost: Any,
        tolerance: Any = None,
        circular: Iterable[int] = (),
        substeps: int = 1,
        discrete_time: bool = False,
        initial: Any = None,
        evaluation_states: Any = None,
        evaluation_steps: int = 300,
        state_names: Sequence[str] | None = None,
        input_names: Sequence[str] | None = None,
        parameters: Mapping[str, float] | None = None,
        uncertain: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.low, self.high = _bounds(low, high)
        self.parameters = PlantParameters(parameters, uncertain)
        self.fully_observed = self.parameters.count == 0
        self.real_inputs = inputs if isinstance(inputs, spaces.Box) else None
        self.inputs = _inputs(inputs)
        self.sampling_time = validation.number("sampling_time", sampling_time, above=0)
        self.substeps = validation.integer(
            "substeps", substeps, at_least=1, at_most=MOST_SUBSTEPS
        )
        self.evaluation_steps = validation.integer(
            "evaluation_steps", evaluation_steps, at_least=1
        )
        size = self.low.size
        self.circular = targets.checked_axes(circular, size)
        self._period = np.zeros(size)
        rounds = list(self.circular)
        self._period[rounds] = (self.high - self.low)[rounds]
        if is_model(dynamics):
            model = Model(dynamics)
            self._check_time_of(model)
            discrete_time = model.discrete_time
            state_names = state_names or model.state_names
            input_names = input_names or model.input_names
        self.discrete_time = validation.boolean("discrete_time", discrete_time)
        samples = self._draw(np.random.default_rng(0), sample_count())
        self._equations = Equations(
            dynamics, samples, self.inputs, self.discrete_time, self.parameters
        )
        self._goal = targets.Goal(goal, tolerance, self.low, self.high, self._period)
        self._cost = targets.Cost(cost, self._goal, self.inputs, self.sampling_time)
        self._task = {"goal": goal, "tolerance": tolerance, "cost": cost}
        self._goal.check(samples)
        self._cost.check(samples)
        self._signals = Signals(
            targets.checked_names("state_names", state_names, "x", size),
            targets.checked_names(
                "input_names", input_names, "u", self.inputs.shape[1]
            ),
            tuple(map(tuple, self.inputs.tolist())),
        )
        self._initial = InitialStates(
            initial,
            (size, size + self.parameters.count) if size > 1 else (size,),
            self._checked_rows,
            self._draw,
            self._goal.reached,
        )
        self._evaluation_states = (
            self._default_evaluation_states()
            if evaluation_states is None
            else self._with_nominal(
                self._checked_rows(evaluation_states, "evaluation_states")
            )
        )

    @property
    def observation_space(self) -> spaces.Box:
        """The state without its parameters, within `low` and `high`, float64."""
        return spaces.Box(self.low, self.high, dtype=np.float64)

    @property
    def action_space(self) -> spaces.Discrete | spaces.Box:
        """One action for each row of `inputs`, or the range of real inputs."""
        if self.real_inputs is not None:
            return self.real_inputs
        return spaces.Discrete(len(self.inputs))

    @property
    def signals(self) -> Signals:
        """The names of states and inputs, and the inputs of each action."""
        return self._signals

    @property
    def task(self) -> dict[str, Any]:
        """Goal, tolerance and cost as they were given."""
        return dict(self._task)

    @property
    def variable_names(self) -> tuple[str, ...]:
        """The names of the state variables, without those of parameters."""
        return self._signals.observations

    @property
    def goal_box(self) -> FloatArray | None:
        """The lower and upper ends of the goal, `(2, state_size)`; None if it has none."""
        return self._goal.box

    def parameter(self, name: str) -> float:
        """The nominal value of a parameter of the dynamics.

        Raises:
            TypeError: the dynamics has no parameter of that name.
        """
        return self.parameters.value_of(name)

    @property
    def has_goal(self) -> bool:
        """Whether an episode may end in success."""
        return self._goal.centre is not None or self._goal.function is not None

    @property
    def clipped(self) -> BoolArray:
        """Which variables stop at `low` and `high`: those not circular, `(state_size,)`."""
        return np.asarray(self._period == 0)

    def unlimited(self) -> Self:
        """The same plant, whose variables go on beyond `low` and `high`.

        Initial states, goal and cost are as before; circular variables wrap as before.
        """
        made = copy.copy(self)
        made.low = np.where(self.clipped, -np.inf, self.low)
        made.high = np.where(self.clipped, np.inf, self.high)
        return made

    @property
    def max_stage_cost(self) -> float:
        """A bound on the cost of one step; for a cost of your own, an estimate.

        The estimate is the largest cost over the corners of X and 1,000 random states.
        """
        rng = np.random.default_rng(0)
        states = self._draw(rng, 1000)
        if self.low.size <= 10:
            ends = np.stack([self.low, self.high])
            corners = np.array(list(itertools.product(*ends.T))).T
            states = np.concatenate([states, corners], axis=1)
        return self._cost.largest(states)

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw initial states; those drawn from a box lie outside the goal.

        Uncertain parameters are drawn with them, unless `initial` holds these too.
        """
        states = self._drawn(rng, count)
        if len(states) > self.low.size or not self.parameters.count:
            return states
        return np.concatenate([states, self.parameters.draw(rng, count)])

    def checked_states(self, states: Any) -> FloatArray:
        """Return states `(n, state_size)`, circular variables brought into X.

        Rows may leave the uncertain parameters out; these then have their nominal values.

        Raises:
            ValueError: wrong shape, not finite, or beyond `low` and `high`, or a
                parameter is beyond its range.
        """
        return self._with_nominal(self._checked_rows(states))

    def _with_nominal(self, rows: FloatArray) -> FloatArray:
        """States whose parameters have nominal values where there are none."""
        if rows.shape[1] > self.low.size or not self.parameters.count:
            return rows
        own = np.tile(self.parameters.nominal_drawn, (len(rows), 1))
        return np.concatenate([rows, own], axis=1)

    def _checked_rows(self, states: Any, name: str = "states") -> FloatArray:
        """The states, checked, with parameters only where these are given.

        Args:
            states: `(n, ...)`.
            name: what messages call them.
        """
        size, more = self.low.size, self.parameters.count
        array = validation.real_array(name, states, finite=False)
        if array.ndim == 1 and size == 1:
            array = array[:, None]
        if array.ndim != 2 or array.shape[1] not in (size, size + more):
            wider = ""
            if more:
                names = ", ".join(self.parameters.uncertain)
                wider = f", or {size + more} with the uncertain parameters {names}"
            raise ValueError(
                f"{name} must be rows of {size} variables, shape (n, {size}){wider}, got "
                f"{array.shape}."
            )
        if not np.isfinite(array).all():
            row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
            raise ValueError(
                f"{name} must be finite, got {array[row].tolist()} in row {row}."
            )
        array, own = array[:, :size], array[:, size:]
        if own.size:
            self.parameters.check_rows(own)
        outside = ((array < self.low) | (array > self.high)) & (self._period == 0)
        if outside.any():
            row, axis = np.argwhere(outside)[0]
            raise ValueError(
                f"{name} must lie within low and high, variable {axis} in "
                f"[{self.low[axis]:g}, {self.high[axis]:g}], got {array[row, axis]:g} in "
                f"row {row}."
            )
        columns = np.ascontiguousarray(array.T)
        kernels.settle(columns, self.low, self.high, self._period)
        return np.concatenate([columns.T, own], axis=1)

    def observe(self, states: FloatArray) -> FloatArray:
        """Return the variables without the parameters, a new array `(n, variables)`."""
        return super().observe(
            states if self.fully_observed else states[: self.low.size]
        )

    def advance(
        self,
        states: FloatArray,
        actions: NDArray[Any],
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> BoolArray | None:
        """One sampling time; see `ControlSystem.advance`.

        Raises:
            SlotError: a next state or a cost is not finite.
        """
        step = self.sampling_time / self.substeps
        inputs: FloatArray = self.inputs
        given: FloatArray | None = None
        if self.real_inputs is not None:
            # Kernels look up what each action does: here each slot has one of its own.
            inputs = given = actions
            actions = np.arange(len(inputs))
        drawn = _NOTHING
        if not self.fully_observed:
            size = self.low.size
            states, drawn = states[:size], states[size:]
        bad = self._equations.advance(
            states, actions, inputs, step, self.substeps, drawn
        )
        if bad >= 0:
            raise SlotError(
                "the dynamics gave no finite next state in slot <slot>, from the state "
                f"{states[:, bad].tolist()} with the input "
                f"{inputs[actions[bad]].tolist()}{self._shown_parameters(drawn, bad)}"
                "; use more substeps or a shorter "
                "sampling_time, or narrow low and high.",
                bad,
            )
        kernels.settle(states, self.low, self.high, self._period)
        self._cost.judge(states, actions, self._goal, rewards, reached, given)
        return None

    def evaluation_states(self) -> FloatArray:
        """The states given, or 100 initial ones drawn once, `(n, state_size)`."""
        return self._evaluation_states.copy()

    def _shown_parameters(self, own: FloatArray, slot: int) -> str:
        if not self.parameters.names:
            return ""
        return f" and {self.parameters.of(own[:, slot])}"

    def _check_time_of(self, model: Model) -> None:
        own = model.sampling_time
        if own is not None and own != self.sampling_time:
            raise ValueError(
                f"sampling_time must be that of the discrete-time system, {own:g} s, got "
                f"{self.sampling_time:g} s."
            )

    def _draw(self, rng: np.random.Generator, count: int) -> FloatArray:
        """States anywhere in X, uniform, `(state_size, count)`."""
        span = (self.high - self.low)[:, None]
        return self.low[:, None] + span * rng.random((self.low.size, count))

    def _drawn(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Initial states; a box of them may lead over the end of a circle."""
        states = self._initial.draw(rng, count)
        own = states[: self.low.size]
        kernels.settle(own, self.low, self.high, self._period)
        return states

    def _default_evaluation_states(self) -> FloatArray:
        few = self._initial.rows
        if few is not None and len(few) <= _EVALUATED:
            return self._with_nominal(few)
        drawn = self._drawn(np.random.default_rng(0), _EVALUATED)
        return self._with_nominal(np.ascontiguousarray(drawn.T))


def _bounds(low: Any, high: Any) -> tuple[FloatArray, FloatArray]:
    ends = []
    for name, values in (("low", low), ("high", high)):
        array = validation.real_array(name, values)
        ends.append(array.reshape(-1) if array.ndim == 0 else array)
    bottom, top = ends
    if bottom.ndim != 1 or bottom.shape != top.shape or not (bottom < top).all():
        raise ValueError(
            "low and high must hold the ends of each state variable, low < high, got "
            f"low={validation.shown(low)} and high={validation.shown(high)}."
        )
    with np.errstate(over="ignore"):
        span = top - bottom
    if not np.isfinite(span).all():
        raise ValueError(
            "high - low must be a finite number for each state variable, got "
            f"low={validation.shown(low)} and high={validation.shown(high)}; narrow the "
            "bounds to where the plant is used."
        )
    return bottom, top


def _inputs(values: Any) -> FloatArray:
    """The inputs of each action; of real ones their middle and the corners."""
    if isinstance(values, spaces.Box):
        ends = np.stack(input_bounds("inputs", values))
        few = ends.shape[1] <= _MOST_CORNERS
        corners = np.array(list(itertools.product(*ends.T))) if few else ends
        return np.concatenate([ends.mean(axis=0)[None], corners])
    array = validation.real_array("inputs", values)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2:
        raise ValueError(
            "inputs must hold the input of each action, shape (n_actions,), or "
            f"(n_actions, n_inputs) for several inputs, got shape {array.shape}."
        )
    return np.ascontiguousarray(array)
