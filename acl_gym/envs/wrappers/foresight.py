"""What a model says will happen: whether an action, and a baseline after it, stay safe."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.envs import received
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.system import SlotError
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, IntArray


class Model(Protocol):
    """Predicts the steps of some plants, each of which begins in the state of a slot."""

    def begin(self, slots: IntArray, observations: NDArray[Any]) -> None:
        """Stand where these slots stand, `(m,)`, which see the observations `(m, ...)`."""

    def step(self, actions: NDArray[Any]) -> tuple[NDArray[Any], BoolArray]:
        """Observations after a step, and which plants it brings to the end of an episode."""


class OwnModel:
    """The system of an environment of this package, advanced on a copy of the states.

    Args:
        env: the environment.

    Raises:
        ValueError: it is of another package, wrapped or random.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        if not isinstance(env, ControlVectorEnv) or env.system.draws_per_step:
            raise ValueError(
                "predict=True needs a deterministic environment of acl_gym without "
                "wrappers below the shield, whose system is the model, got "
                f"{validation.shown(env)}; give a function of (observations, actions) "
                "that returns the next observations."
            )
        self._env = env

    def begin(self, slots: IntArray, observations: NDArray[Any]) -> None:
        """See `Model.begin`."""
        self._slots = slots
        self._states = np.ascontiguousarray(self._env.states[slots].T)

    def step(self, actions: NDArray[Any]) -> tuple[NDArray[Any], BoolArray]:
        """See `Model.step`."""
        n, system = len(actions), self._env.system
        rewards, reached = np.empty(n), np.empty(n, dtype=np.bool_)
        try:
            system.advance(self._states, actions, None, rewards, reached)
        except SlotError as error:
            raise SlotError(error.message, int(self._slots[error.slot])) from error
        return system.observe(self._states), reached


class FunctionModel:
    """A function of observations and actions that returns the next observations.

    Args:
        function: of `(m, ...)` observations and `(m, ...)` actions.
    """

    def __init__(self, function: Callable[[Any, Any], Any]) -> None:
        self._function = function

    def begin(self, slots: IntArray, observations: NDArray[Any]) -> None:
        """See `Model.begin`."""
        self._seen = observations

    def step(self, actions: NDArray[Any]) -> tuple[NDArray[Any], BoolArray]:
        """See `Model.step`; of an end of an episode such a function says nothing.

        Raises:
            ValueError: it does not return such observations.
        """
        given = self._function(
            validation.read_only(self._seen), validation.read_only(actions)
        )
        array = validation.as_array(given)
        if array is None or array.shape != self._seen.shape:
            raise ValueError(
                f"predict must return the next observations, shape {self._seen.shape}, "
                f"got {validation.shown(given)}."
            )
        array = received.observations(array, len(actions), "what predict returns")
        if not np.isfinite(array).all():
            raise ValueError(
                "predict must return finite observations, got "
                f"{validation.shown(array[~np.isfinite(array)][:1])}."
            )
        self._seen = array
        return self._seen, np.zeros(len(actions), dtype=np.bool_)


def stays_safe(
    model: Model,
    slots: IntArray,
    observations: NDArray[Any],
    actions: NDArray[Any],
    *,
    safe: Callable[[NDArray[Any]], BoolArray],
    baseline: Callable[[NDArray[Any]], NDArray[Any]],
    look_ahead: int,
) -> BoolArray:
    """Whether each plant stays safe if it takes an action and then follows the baseline.

    Args:
        model: predicts.
        slots: in whose states the plants begin, `(m,)`; a slot may occur several times.
        observations: of these slots, `(m, ...)`.
        actions: what is done first, `(m, ...)`.
        safe: which observations are safe.
        baseline: what the baseline does in each.
        look_ahead: how many steps are predicted, >= 1.

    Returns:
        `(m,)`. What would come after the end of an episode does not count.
    """
    model.begin(slots, observations)
    good, over = np.ones(slots.size, np.bool_), np.zeros(slots.size, np.bool_)
    for step in range(look_ahead):
        seen, ended = model.step(actions)
        good &= safe(seen) | over
        over |= ended
        if step + 1 == look_ahead or not (good & ~over).any():
            break
        actions = baseline(seen)
    return good
