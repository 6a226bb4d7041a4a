"""The two-state system of Figure 3.2, on which §3.4 studies convergence."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control.families import NumberedSystem
from acl_gym.envs.two_state import kernels
from acl_gym.envs.two_state.kernels import FIRST
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class TwoState(NumberedSystem):
    """From q one action leads to q', from there N actions to the goal.

    Attributes:
        costs: of the N actions in q', two or more, > 0 and increasing, so that action 0
            is u* and action 1 the second-best. A decision: the thesis ranks the costs
            without giving values.
    """

    evaluation_steps: ClassVar[int] = 2
    state_hint: ClassVar[str] = "0 is q, 1 is q', 2 is the goal"

    costs: tuple[float, ...] = (1.0, 2.0, 4.0)

    def __post_init__(self) -> None:
        costs = validation.real_array("costs", self.costs, ndim=1)
        if costs.size < 2 or not (costs > 0).all() or not (np.diff(costs) > 0).all():
            raise ValueError(
                "costs must be two or more, positive and increasing from the best action "
                f"to the worst, got {validation.shown(self.costs)}."
            )
        object.__setattr__(self, "costs", tuple(costs.tolist()))

    @cached_property
    def _costs(self) -> FloatArray:
        return np.array(self.costs)

    @property
    def observation_space(self) -> spaces.Discrete:
        """0 is q, 1 is q', 2 the goal."""
        return spaces.Discrete(3)

    @property
    def action_space(self) -> spaces.Discrete:
        """One action for each cost."""
        return spaces.Discrete(len(self.costs))

    @property
    def max_stage_cost(self) -> float:
        """The cost of the worst action in q'."""
        return self.costs[-1]

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Return q for all ants, shape `(1, count)`; nothing is drawn at random."""
        return np.full((1, count), float(FIRST))

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """One action of each ant; see `ControlSystem.advance`. Ants stay at the goal."""
        kernels.advance(states[0], actions, self._costs, rewards, reached)

    def action_mask(self, states: FloatArray) -> BoolArray:
        """U_q of (3.4), `(n, n_actions)`: in q there is one action, number 0."""
        mask = np.ones((states.shape[1], len(self.costs)), dtype=np.bool_)
        mask[states[0] == FIRST, 1:] = False
        return mask

    def evaluation_states(self) -> FloatArray:
        """The state q, `(1, 1)`."""
        return np.array([[float(FIRST)]])
