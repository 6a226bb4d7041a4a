"""The two-state system of Figure 3.2, on which §3.4 studies convergence."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

FIRST, SECOND, AT_GOAL = 0, 1, 2


@dataclass(frozen=True, kw_only=True)
class TwoState(ControlSystem):
    """From q one action leads to q', from there N actions to the goal.

    Attributes:
        costs: of the N actions in q', two or more, > 0 and rising, so that action 0 is
            u* and action 1 the second-best. A decision: the text ranks the costs and
            names none.
    """

    evaluation_steps: ClassVar[int] = 2

    costs: tuple[float, ...] = (1.0, 2.0, 4.0)

    def __post_init__(self) -> None:
        costs = validation.real_array("costs", self.costs, ndim=1)
        if costs.size < 2 or not (costs > 0).all() or not (np.diff(costs) > 0).all():
            raise ValueError(
                "costs must be two or more, positive and rising from the best action "
                f"to the worst, got {self.costs!r}."
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
        """All ants begin in q, shape `(1, count)`; nothing is drawn."""
        return np.full((1, count), float(FIRST))

    def checked_states(self, states: Any) -> FloatArray:
        """Return states given as `(n,)` or `(n, 1)` in the shape `(n, 1)`.

        Raises:
            ValueError: wrong shape, or a state is none of 0, 1, 2.
        """
        array = validation.real_array("states", states, finite=False)
        if array.shape not in ((array.size,), (array.size, 1)):
            raise ValueError(
                "states must be one integer each, shape (n,) or (n, 1), got "
                f"{array.shape}."
            )
        array = array.reshape(-1, 1)
        known = np.isin(array[:, 0], (FIRST, SECOND, AT_GOAL))
        if not known.all():
            row = int(np.argmin(known))
            raise ValueError(
                f"states must be 0, 1 or 2 (the goal), got {array[row, 0]:g} in row "
                f"{row}."
            )
        return array + 0.0  # no -0

    def observe(self, states: FloatArray) -> IntArray:
        """Return the states `(1, n)` as int64 `(n,)`."""
        return np.asarray(states[0].astype(np.int64))

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """One action of each ant; see `ControlSystem.advance`. The goal is not left."""
        rewards[:] = np.where(states[0] == SECOND, -self._costs[actions], 0.0)
        states[0] = np.minimum(states[0] + 1.0, AT_GOAL)
        reached[:] = states[0] == AT_GOAL

    def action_mask(self, states: FloatArray) -> BoolArray:
        """U_q of (3.4), `(n, n_actions)`: in q there is one action, number 0."""
        mask = np.ones((states.shape[1], len(self.costs)), dtype=np.bool_)
        mask[states[0] == FIRST, 1:] = False
        return mask

    def evaluation_states(self) -> FloatArray:
        """The state q, `(1, 1)`."""
        return np.array([[float(FIRST)]])

    def draw(
        self, pygame: Any, canvas: Any, state: FloatArray, action: int | None
    ) -> None:
        """The states as circles, the ways as lines; filled is where the ant is."""
        size = canvas.get_width()
        black, ant, way = (0, 0, 0), (213, 94, 0), (150, 150, 150)
        places = [(int(x * size), size // 2) for x in (0.15, 0.5, 0.85)]
        thin, thick = max(1, size // 240), max(3, size // 80)
        canvas.fill((255, 255, 255))
        taken = action is not None and int(state[0]) == AT_GOAL
        pygame.draw.line(canvas, way, places[0], places[1], thin)
        for u in range(len(self.costs)):
            # Arcs between q' and the goal, side by side, the best way uppermost.
            lift = (u - (len(self.costs) - 1) / 2) * 0.6 * size / len(self.costs)
            points = [
                (
                    places[1][0] + share * (places[2][0] - places[1][0]),
                    places[1][1] + lift * math.sin(math.pi * share),
                )
                for share in np.linspace(0, 1, 25)
            ]
            here = taken and u == action
            pygame.draw.lines(
                canvas, ant if here else way, False, points, thick if here else thin
            )
        for number, place in enumerate(places):
            there = number == int(state[0])
            pygame.draw.circle(canvas, (255, 255, 255), place, size // 16)
            pygame.draw.circle(
                canvas, ant if there else black, place, size // 16, 0 if there else thin
            )
