"""Two kinds of control systems: with numbered states, and advanced block by block."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control import parameters
from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils import threads
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class NumberedSystem(ControlSystem):
    """A system whose states are the numbers 0, 1, ... and are observed as they are."""

    state_hint: ClassVar[str]
    """What an error message says about the meaning of the numbers."""

    @property
    @abstractmethod
    def observation_space(self) -> spaces.Discrete:
        """One number for each state."""

    def checked_states(self, states: Any) -> FloatArray:
        """Return states given as `(n,)` or `(n, 1)` in the shape `(n, 1)`.

        Raises:
            ValueError: wrong shape, or a state is not the number of a state.
        """
        n_states = int(self.observation_space.n)
        return parameters.numbered_states(states, n_states, self.state_hint)

    def observe(self, states: FloatArray) -> IntArray:
        """Return the states `(1, n)` as int64 `(n,)`."""
        return np.asarray(states[0].astype(np.int64))


class BlockSystem(ControlSystem):
    """A system whose kernels advance blocks of slots, which threads can share."""

    block_kernels: ClassVar[tuple[Callable[..., None], Callable[..., None]]]
    """The kernels `advance` and `advance_in_parallel`, which give the same results."""

    @property
    @abstractmethod
    def _dynamics(self) -> tuple[Any, ...]:
        """The arguments of the kernel that integrates the dynamics."""

    @property
    @abstractmethod
    def _goal_and_cost(self) -> tuple[Any, ...]:
        """The arguments of the kernel for limits, stage cost and goal test."""

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """One sampling time; see `ControlSystem.advance`."""
        move = self.block_kernels[threads.worth_it(actions.size)]
        move(states, actions, self._dynamics, self._goal_and_cost, rewards, reached)
