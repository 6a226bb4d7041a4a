"""A plant whose dynamics was learned from recorded transitions."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control.signals import Signals
from acl_gym.envs.learned.dynamics import LearnedDynamics
from acl_gym.envs.learned.outcomes import LearnedCost
from acl_gym.envs.plant.system import Plant
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

MEMBER = "member"
"""The name of the uncertain parameter that says which function a slot walks in."""

CAUTION = 0.1
"""By how much a step of which the model knows nothing costs more by default, as a share of
the most that a step costs; only with more than two variables."""


class LearnedSystem(Plant):
    """A plant in discrete time that was learned from data; see `LearnedVectorEnv`.

    Its state holds an angle as one variable, also where observations show its cosine and
    sine. With `uncertain`, the number of the function that a slot walks in is one more
    variable, which stays as it was drawn.

    Args:
        dynamics: what was learned.
        low: lower ends of the variables, `(n_variables,)`.
        high: upper ends.
        circular: which variables wrap around.
        inputs: of each action, `(n_actions, n_inputs)`.
        sampling_time: s.
        goal: see `acl_gym.plant`.
        tolerance: see there.
        cost: see there, or a `LearnedCost`.
        initial: see there.
        evaluation_states: see there.
        evaluation_steps: see there.
        pessimism: see `LearnedVectorEnv`.
        most_spread: see there.
        uncertain: see there.
    """

    def __init__(
        self,
        *,
        dynamics: LearnedDynamics,
        low: Any,
        high: Any,
        circular: tuple[int, ...],
        inputs: Any,
        sampling_time: float,
        goal: Any,
        tolerance: Any = None,
        cost: Any = "time",
        initial: Any = None,
        evaluation_states: Any = None,
        evaluation_steps: int = 300,
        pessimism: float | None = 0.0,
        most_spread: float | None = None,
        uncertain: bool = False,
    ) -> None:
        self.dynamics = dynamics
        if pessimism is not None:
            pessimism = validation.number("pessimism", pessimism, at_least=0)
        if most_spread is not None:
            most_spread = validation.number("most_spread", most_spread, above=0)
        self.most_spread = most_spread
        self._learned_cost = cost if isinstance(cost, LearnedCost) else None
        known = dynamics.description
        self._angles = known.shown_angles
        columns = self._angles.columns
        ranges: dict[str, Any] = {}
        if uncertain:
            ranges = {
                "parameters": {MEMBER: 0.0},
                "uncertain": {MEMBER: (0.0, float(dynamics.n_members))},
            }
        super().__init__(
            dynamics=Predicted(dynamics),
            low=low,
            high=high,
            circular=circular,
            inputs=inputs,
            sampling_time=sampling_time,
            goal=goal,
            tolerance=tolerance,
            cost="time" if self._learned_cost is not None else cost,
            initial=initial,
            evaluation_states=evaluation_states,
            evaluation_steps=evaluation_steps,
            discrete_time=True,
            state_names=[known.state_names[column] for column in columns],
            input_names=known.input_names,
            **ranges,
        )
        if pessimism is None:
            many = self.low.size > 2
            pessimism = CAUTION * max(self.max_stage_cost, 0.0) if many else 0.0
        self.pessimism = pessimism
        # As observed, which is what agents and pictures ask for: of an angle that is
        # shown as cosine and sine, neither wraps around.
        self.circular = known.circular

    @property
    def observation_space(self) -> spaces.Box:
        """What is recorded of a state: its variables, an angle as it was shown."""
        if not self._angles.pairs:
            return super().observation_space
        low, high = self._angles.observations(np.stack([self.low, self.high]))
        for pair in self._angles.pairs:
            for column in pair:
                low[column], high[column] = -1.0, 1.0
        return spaces.Box(low, high, dtype=np.float64)

    @property
    def signals(self) -> Signals:
        """Names of observations and inputs, and the inputs of each action.

        Inputs that only number actions say so by their names.
        """
        return Signals(
            self.dynamics.description.state_names,
            self.dynamics.description.input_names,
            tuple(map(tuple, self.inputs.tolist())),
        )

    @property
    def max_stage_cost(self) -> float:
        """The largest recorded cost of a step, or that of the known cost; an estimate."""
        if self._learned_cost is not None:
            return max(self._learned_cost.largest, 0.0)
        return super().max_stage_cost

    @property
    def may_fail(self) -> bool:  # type: ignore[override]
        """Whether episodes end where the model is not sure enough."""
        return self.most_spread is not None

    @cached_property
    def dearest_step(self) -> float:
        """The most that a step costs from which an episode goes on; >= 0.

        An estimate where the cost is a function of a user's own.
        """
        spread = 0.0 if self.most_spread is None else self.most_spread
        return max(self.max_stage_cost, 0.0) + self.pessimism * spread

    def observe(self, states: FloatArray) -> FloatArray:
        """Return observations, a new array `(n, n_observed)`."""
        return self._angles.observations(super().observe(states))

    def variables(self, observations: Any) -> FloatArray:
        """Return the states that belong to observations, `(n, n_variables)`."""
        return np.asarray(self._angles.variables(np.asarray(observations)))

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> BoolArray | None:
        """One sampling time; see `ControlSystem.advance`."""
        asks = self.pessimism > 0.0 or self.most_spread is not None
        if self._learned_cost is None and not asks:
            super().advance(states, actions, uniforms, rewards, reached)
            return None
        before = states[: self.low.size].copy()
        super().advance(states, actions, uniforms, rewards, reached)
        inputs = self.inputs.T[:, actions]
        if self._learned_cost is not None:
            after = states[: self.low.size]
            costs = self._learned_cost(before, after, inputs)
            if self.most_spread is not None:
                # Nothing that was learned may cost more than to leave the data.
                costs = np.minimum(costs, self.max_stage_cost)
            rewards[:] = -costs
        if not asks:
            return None
        spread = self.dynamics.spread(before, inputs)
        if self.pessimism > 0.0:
            rewards -= self.pessimism * spread
        if self.most_spread is None:
            return None
        failed = spread > self.most_spread
        reached &= ~failed
        return failed


class Predicted:
    """x(t+1) = f(x, u) for `Plant`, or f(x, u, p) where slots have functions of their own.

    Args:
        dynamics: what was learned.
    """

    def __init__(self, dynamics: LearnedDynamics) -> None:
        self._dynamics = dynamics

    def __call__(self, x: FloatArray, u: FloatArray, p: Any = None) -> FloatArray:
        """Predict the next states, `(n_variables, n)`."""
        if p is None:
            return self._dynamics.next_variables(x, u)
        last = self._dynamics.n_members - 1
        number = np.broadcast_to(p.member, x.shape[1:]).astype(np.int64)
        return self._dynamics.next_variables(x, u, np.minimum(number, last))
