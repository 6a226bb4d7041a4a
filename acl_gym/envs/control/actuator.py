"""What a controller returns, as actions of the environment that it drives."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.envs.control.bookkeeping import checked_actions
from acl_gym.envs.control.lookup import signals_of
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray


def nearest_actions(wanted: FloatArray, available: FloatArray) -> IntArray:
    """The actions whose inputs are nearest to those wanted, by Euclidean distance.

    Args:
        wanted: inputs, `(n, n_inputs)`, finite.
        available: the inputs of each action, `(n_actions, n_inputs)`, such as
            `Signals.values`.

    Returns:
        Numbers of actions from 0, `(n,)`; of two that are equally near, the first.
    """
    distance = np.square(wanted[:, None, :] - available).sum(axis=2)
    return np.asarray(distance.argmin(axis=1))


class Actuator:
    """Turns what controllers return into actions of a vector environment, checked.

    Where actions are `Discrete`, a controller may return their numbers, integers
    `(num_envs,)`, or physical inputs, floats `(num_envs,)` or `(num_envs, n_inputs)`.
    These stand for the action whose inputs are nearest, if the environment says what the
    inputs of its actions are, as those of this package do. Where actions are a `Box`, it
    returns the inputs themselves, which must lie within the bounds of the box.

    Args:
        env: a vector environment with `Discrete` or `Box` actions.

    Raises:
        ValueError: its actions are of another kind.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        space = env.single_action_space
        if not isinstance(space, (spaces.Discrete, spaces.Box)):
            raise ValueError(
                "env must have Discrete or Box actions, which a controller can set, got "
                f"{validation.shown(space)}."
            )
        self._space, self._count = space, int(env.num_envs)
        signals = signals_of(env)
        self._inputs = None if signals is None else np.array(signals.values)

    @property
    def n_actions(self) -> int | None:
        """How many actions there are; None where they are real numbers."""
        return int(self._space.n) if isinstance(self._space, spaces.Discrete) else None

    @property
    def first_action(self) -> int:
        """The number of the first action; 0 where they are real numbers."""
        return int(self._space.start) if isinstance(self._space, spaces.Discrete) else 0

    def of_learner(self, actions: Any) -> NDArray[Any]:
        """Return the actions of a learner, one for each slot, as a new array.

        Raises:
            TypeError: numbers of actions are not integers.
            ValueError: they have the wrong shape, are out of range or not finite.
        """
        if isinstance(self._space, spaces.Discrete):
            return self._numbers("actions", actions)
        return self._real("actions", actions, self._count)

    def of_controller(
        self, name: str, given: Any, count: int | None = None
    ) -> NDArray[Any]:
        """Return what a controller wants as actions, one for each slot, a new array.

        Args:
            name: what the controller is called in messages.
            given: what it returned.
            count: for how many slots; None: for all.

        Raises:
            TypeError: numbers of actions are not integers.
            ValueError: it has the wrong shape, is out of range or not finite; or physical
                inputs are given, and those of the actions are not known.
        """
        count = self._count if count is None else count
        what = f"what {name} returns"
        if not isinstance(self._space, spaces.Discrete):
            return self._real(what, given, count)
        array = validation.as_array(given)
        if array is None or array.dtype.kind != "f":
            hint = "; physical inputs are to be floats"
            return self._numbers(what, given, count, hint)
        if self._inputs is None:
            raise ValueError(
                f"{what} must be the numbers of actions, integers, because the inputs of "
                "the actions are not known, got floats; use an environment of acl_gym, "
                "or one with Box actions."
            )
        n_inputs = self._inputs.shape[1]
        wanted = _rows(what, array, count, (n_inputs,))
        return nearest_actions(wanted, self._inputs) + self.first_action

    def _numbers(
        self, name: str, given: Any, count: int | None = None, hint: str = ""
    ) -> IntArray:
        """Numbers of actions, as they are counted outside."""
        count, first = self._count if count is None else count, self.first_action
        array = validation.as_array(given)
        if array is not None and first and array.dtype.kind in "iu":
            array = array.astype(np.int64) - first
        try:
            numbers = given if array is None else array
            return checked_actions(numbers, count, self.n_actions or 0) + first
        except (TypeError, ValueError) as error:
            last = first + (self.n_actions or 0) - 1
            raise type(error)(
                f"{name} must be {count} integers in {first}..{last}, the numbers of "
                f"actions, one a slot, got {validation.shown(given)}{hint}."
            ) from None

    def _real(self, name: str, given: Any, count: int) -> NDArray[Any]:
        """Rows of a Box, within its bounds."""
        space: Any = self._space
        array = validation.as_array(given)
        rows = _rows(name, array if array is not None else given, count, space.shape)
        rows = rows.astype(space.dtype)
        inside = (rows >= space.low) & (rows <= space.high)
        if not inside.all():
            at = tuple(np.argwhere(~inside)[0])
            raise ValueError(
                f"{name} must lie within the bounds of the actions, "
                f"[{space.low[at[1:]]:g}, {space.high[at[1:]]:g}], got {rows[at]:g} in "
                f"slot {at[0]}; saturate it, as StateFeedback(low=, high=) does."
            )
        return rows


def _rows(name: str, given: Any, count: int, shape: tuple[int, ...]) -> FloatArray:
    """Finite real numbers `(count, *shape)`; a single number a row may lack its axis."""
    array = validation.as_array(given)
    if array is None or array.dtype.kind not in "iuf":
        raise ValueError(
            f"{name} must be real numbers, {count} rows of shape {shape}, got "
            f"{validation.shown(given)}."
        )
    if shape == (1,) and array.shape == (count,):
        array = array[:, None]
    if array.shape != (count, *shape):
        raise ValueError(
            f"{name} must have shape {(count, *shape)}, a row for each slot, got "
            f"{array.shape}."
        )
    finite = np.isfinite(array)
    if not finite.all():
        at = tuple(np.argwhere(~finite)[0])
        raise ValueError(
            f"{name} must be finite, got {array[at]} in slot {at[0]}; check it and the "
            "observations."
        )
    return array.astype(np.float64)
