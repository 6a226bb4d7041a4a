"""The double bridge of §2.3.2: where its branches lead."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control.families import NumberedSystem
from acl_gym.envs.graph.double_bridge import kernels
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

NEST = 0
"""The state in which every ant starts."""

MOST_STATES = 1_000_000
"""Places on a bridge: an agent keeps levels for each of them."""


class Place(NamedTuple):
    """Where on the bridge a state is.

    Attributes:
        module: which double bridge, counted from the nest.
        branch: 0 or 1, an index of `lengths`; None where ants choose, and at the food.
        share: how much of the branch has been walked, in [0, 1).
    """

    module: int
    branch: int | None
    share: float


@dataclass(frozen=True, kw_only=True)
class DoubleBridge(NumberedSystem):
    """A nest and a food source, joined by a bridge with two branches.

    Attributes:
        lengths: of the two branches in steps, integers >= 1. The default is twice as
            long for the second one, the ratio of Goss et al. (1989).
        modules: how many double bridges lie one behind the other, >= 1. Each is the
            mirror image of the one before: what is left in the first is right in the
            second. Goss et al. had two, so that ants that prefer a side gain nothing.
        closed: the branch that is missing, 0 or 1, in each module; None: both are
            there. A colony that has learned on the long branch alone meets the short
            one late if it then goes on with an environment without `closed`.
    """

    state_hint: ClassVar[str] = "0 is the nest and the last one the food"

    lengths: tuple[int, int] = (5, 10)
    modules: int = 1
    closed: int | None = None

    def __post_init__(self) -> None:
        given = validation.elements(self.lengths)
        if given is None or len(given) != 2:
            raise ValueError(
                "lengths must be two integers, the steps of each branch, got "
                f"{validation.shown(self.lengths)}."
            )
        lengths = tuple(
            validation.integer(f"lengths[{i}]", each, at_least=1)
            for i, each in enumerate(given)
        )
        modules = validation.integer("modules", self.modules, at_least=1)
        n_states = modules * (sum(lengths) - 1) + 1
        if n_states > MOST_STATES:
            raise ValueError(
                f"lengths and modules must make at most {MOST_STATES:,} states, got "
                f"{n_states:,}; make the branches shorter."
            )
        closed = self.closed
        if closed is not None:
            closed = validation.integer("closed", closed, at_least=0, at_most=1)
        object.__setattr__(self, "lengths", lengths)
        object.__setattr__(self, "modules", modules)
        object.__setattr__(self, "closed", closed)

    @property
    def n_states(self) -> int:
        """The number of places, nest and food included."""
        return self.modules * self._places_a_module + 1

    @property
    def food(self) -> int:
        """The state that is the goal, the last one."""
        return self.n_states - 1

    @property
    def evaluation_steps(self) -> int:  # type: ignore[override]
        """T: ten times what an ant needs that takes every longer branch.

        Only ants that try a closed branch need more than a tenth of it.
        """
        return 10 * self.modules * max(self.lengths)

    @property
    def observation_space(self) -> spaces.Discrete:
        """One number for each place."""
        return spaces.Discrete(self.n_states)

    @property
    def action_space(self) -> spaces.Discrete:
        """0 is left, 1 is right."""
        return spaces.Discrete(2)

    @property
    def max_stage_cost(self) -> float:
        """Each step costs 1."""
        return 1.0

    @property
    def _places_a_module(self) -> int:
        """Where ants choose, and the places on both branches."""
        return sum(self.lengths) - 1

    def place(self, state: int) -> Place:
        """Where on the bridge the state is.

        Args:
            state: 0 to `food`.
        """
        module, place = divmod(int(state), self._places_a_module)
        first, second = self.lengths
        if place == 0:
            return Place(module, None, 0.0)
        if place < first:
            return Place(module, 0, place / first)
        return Place(module, 1, (place - first + 1) / second)

    def branch_of(self, module: int, action: int) -> int:
        """Which branch, an index of `lengths`, lies on that side of a module."""
        return (action + module) % 2

    @cached_property
    def _next_state(self) -> IntArray:
        """Where each action leads, `(n_states, 2)`."""
        # On a branch ants go on, whatever the action.
        following = np.repeat(np.arange(1, self.n_states + 1)[:, None], 2, axis=1)
        following[-1] = self.food
        first, _ = self.lengths
        for module in range(self.modules):
            junction = module * self._places_a_module
            end = junction + self._places_a_module
            if first > 1:
                following[junction + first - 1] = end
            for action in range(2):
                branch = self.branch_of(module, action)
                entry = junction + (1 if branch == 0 else first)
                # A branch of one step leads to its end at once.
                following[junction, action] = entry if self.lengths[branch] > 1 else end
                if branch == self.closed:
                    following[junction, action] = junction
        return following

    @cached_property
    def _offered(self) -> BoolArray:
        """Whether each action is available, `(n_states, 2)`."""
        offered = np.zeros((self.n_states, 2), dtype=np.bool_)
        offered[:, 0] = True  # on a branch there is one way
        for module in range(self.modules):
            for action in range(2):
                there = self.branch_of(module, action) != self.closed
                offered[module * self._places_a_module, action] = there
        return offered

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Return the nest for all ants, shape `(1, count)`; nothing is random."""
        return np.full((1, count), float(NEST))

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """One step of each ant; see `ControlSystem.advance`. Ants stay at the food."""
        kernels.advance(states[0], actions, self._next_state, rewards, reached)

    def action_mask(self, states: FloatArray) -> BoolArray:
        """U_q of (3.4), `(n, 2)`: both sides where ants choose, 0 on a branch."""
        return np.asarray(self._offered[states[0].astype(np.int64)])

    def evaluation_states(self) -> FloatArray:
        """The nest, `(1, 1)`."""
        return np.array([[float(NEST)]])
