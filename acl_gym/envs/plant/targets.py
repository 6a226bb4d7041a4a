"""The goal and the cost of a plant, as functions or as numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from acl_gym.envs.control.parameters import is_weight
from acl_gym.envs.control.system import SlotError
from acl_gym.envs.plant import kernels
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

_TOLERANCE = 1 / 40  # of the range of a variable, to either side: a decision


class Goal:
    """Where an episode ends in success.

    Args:
        goal: a state, a pair (low, high) of states, a function of x, or None.
        tolerance: half-widths around a state, one for all variables or for each; None
            takes a fortieth of the range of each.
        low: lower ends of the variables.
        high: upper ends.
        period: of each variable, 0 where it is not circular.

    Attributes:
        centre: of the goal, `(state_size,)`; None if it has none.

    Raises:
        ValueError: the goal is none of these, or is empty.
    """

    def __init__(
        self,
        goal: Any,
        tolerance: Any,
        low: FloatArray,
        high: FloatArray,
        period: FloatArray,
    ) -> None:
        size = low.size
        self.period = period
        self.function = (
            _Function("goal(x)", goal, "biu", "booleans") if callable(goal) else None
        )
        self.centre: FloatArray | None = None
        self._half = np.full(size, -1.0)
        if self.function is not None or goal is None:
            if tolerance is not None:
                raise ValueError(
                    "tolerance belongs to a goal that is a state, got tolerance="
                    f"{validation.shown(tolerance)} with goal={validation.shown(goal)}; "
                    "leave it out."
                )
            return
        array = validation.real_array("goal", goal, finite=False)
        array = array.reshape(1) if array.ndim == 0 else array
        if size == 1 and array.shape == (2,):
            array = array[:, None]
        if array.shape == (size,) and np.isfinite(array).all():
            self.centre = array
            self._half = _half_widths(tolerance, (high - low) * _TOLERANCE)
            self._check_reach(goal, low, high)
        elif array.shape == (2, size) and not np.isnan(array).any():
            if tolerance is not None:
                raise ValueError(
                    "tolerance belongs to a goal that is a state, not to a pair of "
                    f"bounds, got tolerance={validation.shown(tolerance)}; widen the bounds."
                )
            self._set_box(np.maximum(array[0], low), np.minimum(array[1], high), goal)
        else:
            raise ValueError(
                f"goal must be a state of {size} variables, a pair of states (low, "
                f"high), a function of x, or None, got {validation.shown(goal)}."
            )

    def _check_reach(self, goal: Any, low: FloatArray, high: FloatArray) -> None:
        bottom, top = self.centre - self._half, self.centre + self._half
        missed = (self.period == 0) & ((bottom > high) | (top < low))
        if missed.any():
            i = int(np.argmax(missed))
            raise ValueError(
                f"goal must lie within low and high, or come within the tolerance of "
                f"them, got {validation.shown(goal)}, where variable {i} lies in "
                f"[{low[i]:g}, {high[i]:g}]; widen the bounds, or move the goal."
            )

    def _set_box(self, bottom: FloatArray, top: FloatArray, goal: Any) -> None:
        # An arc may lead over the end of a circle.
        top = np.where((top < bottom) & (self.period > 0), top + self.period, top)
        if (top < bottom).any():
            raise ValueError(
                f"goal must have low <= high in every variable, within the bounds of "
                f"the plant, got {validation.shown(goal)}."
            )
        self.centre = (bottom + top) / 2
        self._half = np.maximum(top - self.centre, self.centre - bottom)

    @property
    def box(self) -> FloatArray | None:
        """Lower and upper ends, `(2, state_size)`; None for a function or no goal."""
        if self.centre is None:
            return None
        return np.stack([self.centre - self._half, self.centre + self._half])

    def arguments(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Centre, half-widths and periods, for `kernels.judge`."""
        centre = np.zeros(self._half.size) if self.centre is None else self.centre
        return centre, self._half, self.period

    def reached(self, states: FloatArray) -> BoolArray:
        """Whether each of the states `(state_size, n)` lies in the goal, `(n,)`."""
        count = states.shape[1]
        reached = np.empty(count, dtype=np.bool_)
        if self.function is None:
            actions, none = np.zeros(count, dtype=np.int64), np.empty((0, 0))
            rewards = np.empty(count)
            costs = np.zeros(1)
            kernels.judge(
                states, actions, *self.arguments(), none, costs, rewards, reached
            )
        else:
            reached[:] = self.function(states)
        return reached

    def check(self, samples: FloatArray) -> None:
        """Try a function on sample states, `(state_size, n)`.

        Raises:
            ValueError: it fails, or does not give a bool for each state.
        """
        if self.function is not None:
            self.function.check(samples)


class Cost:
    """What a step costs.

    Args:
        cost: "time", (Q, R), or a function of x and u.
        goal: from whose centre errors count.
        inputs: of each action, `(n_actions, n_inputs)`.
        sampling_time: s.

    Raises:
        ValueError: the cost is none of these, or the goal has no centre for (Q, R).
    """

    def __init__(
        self, cost: Any, goal: Goal, inputs: FloatArray, sampling_time: float
    ) -> None:
        self._function = (
            _Function("cost(x, u)", cost, "iuf", "finite numbers")
            if callable(cost)
            else None
        )
        self._goal, self._inputs = goal, inputs
        self._weight = np.empty((0, 0))
        self._action_costs = np.zeros(len(inputs))
        self._on_inputs = np.zeros((inputs.shape[1], inputs.shape[1]))
        if self._function is not None:
            return
        if isinstance(cost, str):
            validation.one_of("cost", cost, ("time",))
            self._action_costs[:] = sampling_time
        elif isinstance(cost, Sequence) and len(cost) == 2 and type(cost) is not bytes:
            if goal.centre is None:
                raise ValueError(
                    "cost=(Q, R) weighs the error from the goal, which must be a state "
                    "or a pair of bounds then; give a function cost(x, u) instead."
                )
            self._weight = _matrix("Q", cost[0], goal.centre.size)
            self._on_inputs = _matrix("R", cost[1], inputs.shape[1])
            with np.errstate(over="ignore", invalid="ignore"):
                self._action_costs = self._costs_of(inputs)
            if not np.isfinite(self._action_costs).all():
                raise ValueError(
                    "R of cost=(Q, R) must give each action a finite cost u' R u, got "
                    f"{validation.shown(cost[1])}; give smaller weights."
                )
        else:
            raise ValueError(
                'cost must be "time", a pair (Q, R) of weights on error and input, or a '
                f"function of x and u, got {validation.shown(cost)}."
            )

    def _costs_of(self, inputs: FloatArray) -> FloatArray:
        """u' R u of each row of inputs."""
        return np.asarray(np.einsum("ai,ij,aj->a", inputs, self._on_inputs, inputs))

    def judge(
        self,
        states: FloatArray,
        actions: IntArray,
        goal: Goal,
        rewards: FloatArray,
        reached: BoolArray,
        inputs: FloatArray | None = None,
    ) -> None:
        """Write reward and goal test of the next states.

        Args:
            states: `(state_size, n)`.
            actions: rows of the inputs, `(n,)`.
            goal: where an episode ends.
            rewards: receives -(cost), `(n,)`.
            reached: receives whether each state lies in the goal, `(n,)`.
            inputs: `(n_actions, n_inputs)`; None takes those that it was made with.

        Raises:
            SlotError: a cost is not finite.
            ValueError: a function of goal or cost writes to what it is given, or does
                not give a number for each state.
        """
        action_costs = self._action_costs
        if inputs is None:
            inputs = self._inputs
        elif self._on_inputs.any():
            action_costs = self._costs_of(inputs)
        else:
            action_costs = np.full(len(inputs), action_costs[0])
        kernels.judge(
            states,
            actions,
            *goal.arguments(),
            self._weight,
            action_costs,
            rewards,
            reached,
        )
        if goal.function is not None:
            reached[:] = goal.function(states)
        if self._function is not None:
            # First as floats: unsigned integers have no negatives.
            rewards[:] = self._function(states, inputs.T[:, actions])
            np.negative(rewards, out=rewards)
        finite = np.isfinite(rewards)
        if not finite.all():
            slot = int(np.argmin(finite))
            raise SlotError(
                f"the cost must be finite, got {-rewards[slot]} in slot <slot>, for the "
                f"state {states[:, slot].tolist()} with the input "
                f"{inputs[actions[slot]].tolist()}.",
                slot,
            )

    def check(self, samples: FloatArray) -> None:
        """Try a function on sample states, `(state_size, n)`.

        Raises:
            ValueError: it fails, or does not give a finite number for each state.
        """
        if self._function is not None:
            actions = np.arange(samples.shape[1]) % len(self._inputs)
            u = self._inputs.T[:, actions]
            self._function.check(samples, u)

    def largest(self, states: FloatArray) -> float:
        """The largest cost of any action in these states."""
        largest = 0.0
        rewards = np.empty(states.shape[1])
        reached = np.empty(states.shape[1], dtype=np.bool_)
        for action in range(len(self._inputs)):
            actions = np.full(states.shape[1], action)
            self.judge(states, actions, self._goal, rewards, reached)
            largest = max(largest, float(-rewards.min()))
        return largest


def checked_axes(circular: Iterable[int], size: int) -> tuple[int, ...]:
    """Return numbers of variables, each once, in order.

    Raises:
        ValueError: one is not among 0..size - 1.
    """
    axes = validation.elements(circular)
    if axes is None:
        axes = [None]  # which is refused
    for axis in axes:
        whole = isinstance(axis, Integral) and not isinstance(axis, bool)
        if not whole or not 0 <= axis < size:
            raise ValueError(
                f"circular must hold variables of 0..{size - 1}, got "
                f"{validation.shown(circular)}."
            )
    return tuple(sorted({int(axis) for axis in axes}))


def checked_names(
    name: str, names: Sequence[str] | None, letter: str, size: int
) -> tuple[str, ...]:
    """Return a name for each of `size` signals; None numbers them.

    Raises:
        ValueError: they are not that many strings.
    """
    if names is None:
        return tuple(f"{letter}[{i}]" for i in range(size))
    good = isinstance(names, Sequence) and not isinstance(names, str)
    if not good or len(names) != size or not all(isinstance(n, str) for n in names):
        raise ValueError(
            f"{name} must be {size} strings, got {validation.shown(names)}."
        )
    return tuple(names)


def _half_widths(tolerance: Any, default: FloatArray) -> FloatArray:
    if tolerance is None:
        return default
    array = validation.real_array("tolerance", tolerance, finite=False)
    if array.shape not in ((), (1,), default.shape) or not (array >= 0).all():
        raise ValueError(
            f"tolerance must be a number >= 0 or {default.size} of them, got "
            f"{validation.shown(tolerance)}."
        )
    return np.broadcast_to(array, default.shape).copy()


def _matrix(name: str, values: Any, size: int) -> FloatArray:
    """A symmetric weight from a number, a diagonal or a matrix."""
    array = validation.real_array(name, values)
    if array.ndim == 0 or array.shape == (1,):
        array = np.full(size, array.item())
    if array.shape == (size,):
        array = np.diag(array)
    if not is_weight(array, size):
        raise ValueError(
            f"{name} of cost=(Q, R) must be a number, {size} of them, or a symmetric "
            f"positive semi-definite ({size}, {size}) matrix, got "
            f"{validation.shown(values)}."
        )
    return array


class _Function:
    """A function of the user's, of many states; what it returns is checked.

    Args:
        name: for messages.
        function: takes states `(state_size, n)`, and other arrays; returns `(n,)`.
        kinds: letters of the NumPy types that it may return.
        what: what these are called in messages.
    """

    def __init__(self, name: str, function: Any, kinds: str, what: str) -> None:
        self._name, self._function = name, function
        self._kinds, self._what = kinds, what
        # What was compiled for arrays that can be written to takes no others: copies.
        compiled = isinstance(function, Dispatcher)
        self._handed_out = np.copy if compiled else validation.read_only

    def __call__(self, states: FloatArray, *others: FloatArray) -> NDArray[Any]:
        """Evaluate states, which it cannot write to; it may change `others`.

        Raises:
            ValueError: it fails, writes to the states, or returns something else.
        """
        try:
            array = np.asarray(self._function(self._handed_out(states), *others))
        except Exception as error:  # whatever the user's code raises
            hint = ""
            if "read-only" in str(error):
                hint = "; it must not change the states x: write to a copy, x.copy()"
            raise ValueError(
                f"{self._expects(states)}, but it raised {error!r}{hint}."
            ) from error
        count = states.shape[1]
        if array.shape != (count,) or array.dtype.kind not in self._kinds:
            raise ValueError(
                f"{self._expects(states)}, got {array.dtype} of shape {array.shape} for "
                f"n = {count}; combine conditions with & instead of `and`, sum over axis "
                "0."
            )
        return array

    def check(self, samples: FloatArray, *others: FloatArray) -> None:
        """Try it on samples.

        Raises:
            ValueError: see `__call__`, or a result is not finite.
        """
        with np.errstate(all="ignore"):
            array = self(samples, *others)
        if not np.isfinite(array).all():
            j = int(np.argmin(np.isfinite(array)))
            raise ValueError(
                f"{self._expects(samples)}, got {array[j]} for x = "
                f"{samples[:, j].tolist()}."
            )

    def _expects(self, states: FloatArray) -> str:
        return (
            f"{self._name} must return {self._what} of shape (n,) for states x of shape "
            f"({len(states)}, n)"
        )
