"""What a control system is: parameters and dynamics, with no bookkeeping."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.control.signals import Signals
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray

BLOCK = 512
"""Slots that a kernel advances at a time, so that their data stays in the nearest cache."""


class SlotError(ValueError):
    """A step failed in one slot.

    Args:
        message: in which `<slot>` stands for the number of the slot.
        slot: its number, counted among the states that were advanced.
    """

    def __init__(self, message: str, slot: int) -> None:
        super().__init__(message, slot)  # both, so that it can be pickled
        self.message, self.slot = message, slot

    def __str__(self) -> str:
        return self.message.replace("<slot>", str(self.slot))


class ControlSystem(ABC):
    """A discrete-time system x(t+1) = f(x(t), u(t)), eq. (4.1), with goal and cost.

    A system is an immutable set of parameters and pure functions of arrays. It owns
    no state and no random numbers: `ControlEnv` and `ControlVectorEnv` hold those and
    call the same functions, so that one environment and a thousand slots share one
    model of the dynamics.

    Inside, states are stored with the variables first, shape `(state_size, n)`, so
    that each variable is one contiguous vector for the kernels.
    """

    # Where the next four depend on the parameters, a system makes them properties.
    draws_per_step: ClassVar[int] = 0
    """How many uniform random numbers `advance` takes for each slot and step."""

    circular: ClassVar[tuple[int, ...]] = ()
    """The state variables that wrap around, such as angles: both ends are one value."""

    fully_observed: ClassVar[bool] = True
    """Whether an observation tells the state, so that a table over observations can be a
    model of the system."""

    may_fail: ClassVar[bool] = False
    """Whether an episode may end in failure too; see what `advance` returns."""

    evaluation_steps: ClassVar[int] = 300
    """T, the longest episode when a policy is evaluated from `evaluation_states`."""

    @property
    @abstractmethod
    def observation_space(self) -> spaces.Space[Any]:
        """The space of one observation."""

    @property
    @abstractmethod
    def action_space(self) -> spaces.Discrete | spaces.Box:
        """The space of one action: numbered actions, or real inputs within bounds.

        A Box has one axis, an entry for each input.
        """

    @property
    def signals(self) -> Signals | None:
        """Names of observations and inputs, and the inputs of each action, if known."""
        return None

    def parameter(self, name: str) -> float:
        """The value of a parameter that is a real number.

        Args:
            name: of the parameter.

        Raises:
            TypeError: there is no parameter of that name, or it is not a real number.
        """
        known: tuple[Any, ...] = fields(self) if is_dataclass(self) else ()
        numbers = [f.name for f in known if type(getattr(self, f.name)) is float]
        if name not in numbers:
            raise TypeError(
                f"the parameters of {type(self).__name__} that are real numbers are "
                f"{', '.join(numbers) or 'none'}, got {validation.shown(name)}."
                f"{validation.did_you_mean(name, numbers)}"
            )
        return float(getattr(self, name))

    @property
    def task(self) -> dict[str, Any] | None:
        """What is to be done: `goal`, `tolerance` and `cost` as `acl_gym.plant` takes them.

        A plant that was learned from recordings is given them; None if they cannot be
        said so.
        """
        return None

    @property
    @abstractmethod
    def max_stage_cost(self) -> float:
        """An upper bound on the cost of one step; T times it bounds J_max."""

    @abstractmethod
    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw `count` initial states, uniform over X without the goal.

        Returns:
            Array of shape `(state_size, count)`.
        """

    @abstractmethod
    def checked_states(self, states: Any) -> FloatArray:
        """Return `states`, shape `(n, state_size)`, validated and in canonical form.

        States of one variable may also have the shape `(n,)`. Goal states are allowed:
        the first step is taken from them as from any other state.

        Returns:
            Array of shape `(n, state_size)`.

        Raises:
            ValueError: a state has the wrong shape, is not finite or is outside X.
        """

    @abstractmethod
    def advance(
        self,
        states: FloatArray,
        actions: Any,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> BoolArray | None:
        """Apply one action to each state.

        Args:
            states: shape `(state_size, n)`, replaced by the next states in place.
            actions: shape `(n,)`, valid indices of actions; where `action_space` is a
                Box, the inputs, float64 `(n, n_inputs)` within its bounds.
            uniforms: shape `(draws_per_step, n)` from [0, 1), None if there are none.
            rewards: shape `(n,)`, receives -(stage cost).
            reached: shape `(n,)`, receives whether the next state is the goal.

        Returns:
            Which episodes end in failure, `(n,)`, none of them at the goal; None if none
            does.
        """

    @abstractmethod
    def evaluation_states(self) -> FloatArray:
        """Return the fixed initial states of the policy cost (3.47), `(n, state_size)`."""

    def thesis_centres(self, cells: Any = None) -> tuple[FloatArray, ...] | None:
        """The centres that the thesis gives each state variable, for a partition.

        Args:
            cells: which centres, if the thesis has several sets or a formula; see the
                system. None takes its default.

        Returns:
            For each variable its centres, increasing, in the unit of the variable;
            None if the thesis has none, for instance because each state is a cell.

        Raises:
            ValueError: there are no such centres.
            TypeError: `cells` is of another type than the system takes.
        """
        if cells is not None:
            raise ValueError(
                f"cells must be None for {type(self).__name__}, for which the thesis "
                f"has no centres, got {validation.shown(cells)}."
            )
        return None

    def observe(self, states: FloatArray) -> NDArray[Any]:
        """Return the observations of `states` `(state_size, n)`: a new array `(n, ...)`."""
        observations = np.empty(states.shape[::-1])
        _transpose(states, observations)
        return observations

    def action_mask(self, states: FloatArray) -> BoolArray | None:
        """Return which actions are available in each state, U_q of (3.4).

        Args:
            states: `(state_size, n)`.

        Returns:
            A new bool array `(n, n_actions)`; None if all are always available.
        """
        return None


@njit
def _transpose(states: FloatArray, observations: FloatArray) -> None:
    """Copy the transpose, several times as fast as NumPy if it has few columns."""
    for row in range(states.shape[0]):
        for slot in range(states.shape[1]):
            observations[slot, row] = states[row, slot]
