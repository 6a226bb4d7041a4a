"""What a policy chooses in the slots of an environment, checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.evaluation.rollout import Rollout
from acl_gym.policies import InterpolatedPolicy, PartitionPolicy
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray, Predictor


def require_predictor(model: Any) -> None:
    """Check that an object can choose actions.

    Raises:
        TypeError: `model` has no method `predict`.
    """
    if not callable(getattr(model, "predict", None)) or isinstance(model, type):
        raise TypeError(
            "model must be an agent or a policy with "
            f"predict(observation, deterministic=True), got {validation.shown(model)}."
        )


def chosen_actions(
    model: Predictor, observation: Any, rollout: Rollout, memory: Any
) -> tuple[NDArray[np.int64], Any]:
    """Indices of the actions that `model` takes in the active slots, and its state."""
    if isinstance(model, InterpolatedPolicy):
        raise ValueError(
            "an InterpolatedPolicy chooses real inputs, but env has Discrete actions; "
            "evaluate it where actions are a Box, without ActionGrid or "
            'DiscretizeAction, such as gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, '
            "continuous=True), or evaluate the agent itself."
        )
    allowed = rollout.allowed()
    if isinstance(model, PartitionPolicy):
        starts = np.full(rollout.ants.size, rollout.steps == 0)
        found = model.predict(observation, memory, starts, action_masks=allowed)
        memory = found[1]
    else:
        found = model.predict(observation, deterministic=True)
    first, count = rollout.first_action, rollout.n_actions
    return checked_actions(found, rollout.ants, first, count) - first, memory


def checked_actions(
    found: Any, slots: IntArray, first: int, count: int
) -> NDArray[np.int64]:
    """The actions that `predict` returned, if they are one for each slot.

    Args:
        found: what it returned.
        slots: whose observations it was given, `(m,)`.
        first: the first action of the environment.
        count: how many actions the environment has.

    Raises:
        ValueError: they are not integers of the action space, one for each slot.
    """
    array = _first_of_pair(found)
    if array is None or array.dtype.kind not in "iu":
        what = validation.shown(found[0]) if array is None else f"dtype {array.dtype}"
        raise ValueError(
            f"model.predict must return integers as actions, got {what}; round them in "
            "predict and cast with .astype(np.int64)."
        )
    if array.shape == (slots.size, 1) or (array.ndim == 0 and slots.size == 1):
        array = array.reshape(slots.size)
    if array.shape != slots.shape:
        raise ValueError(
            f"model.predict must return one action for each of the {slots.size} "
            f"observations, got shape {array.shape}; check that it handles batches."
        )
    wrong = (array < first) | (array >= first + count)
    if wrong.any():
        j = int(np.argmax(wrong))
        raise ValueError(
            f"model.predict must return actions in {first}..{first + count - 1}, got "
            f"{array[j]} in slot {slots[j]}; check that the model is of this "
            "environment."
        )
    return array.astype(np.int64)


def checked_inputs(
    found: Any, slots: IntArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """The real inputs that `predict` returned, if they are one row for each slot.

    Args:
        found: what it returned.
        slots: whose observations it was given, `(m,)`.
        low: lower bounds of the inputs, `(n_inputs,)`.
        high: upper bounds.

    Returns:
        `(m, n_inputs)`, float64, within the bounds.

    Raises:
        ValueError: they are not finite floats within the bounds, a row for each slot.
    """
    array, shape = _first_of_pair(found), (slots.size, low.size)
    if array is None or array.dtype.kind != "f":
        what = validation.shown(found[0]) if array is None else f"dtype {array.dtype}"
        raise ValueError(
            "model.predict must return floats where actions are a Box, got "
            f"{what}; evaluate agent.interpolated_policy(), or wrap env in "
            "acl_gym.ActionGrid as for learning."
        )
    if array.shape == (slots.size,) and low.size == 1:
        array = array[:, None]
    if array.shape != shape:
        raise ValueError(
            f"model.predict must return inputs of shape {shape}, a row for each "
            f"observation, got {array.shape}; check that it handles batches."
        )
    inputs = array.astype(np.float64)
    # Rounding to a narrower type may lead as far beyond a bound.
    slack = np.finfo(array.dtype).eps * np.maximum(np.abs(low), np.abs(high))
    good = (inputs >= low - slack) & (inputs <= high + slack)
    if not good.all():  # NaN is not good either
        j, i = np.argwhere(~good)[0]
        raise ValueError(
            f"model.predict must return inputs within [{low[i]:g}, {high[i]:g}], got "
            f"{inputs[j, i]:g} as input {i} in slot {slots[j]}; check that the model is "
            "of this environment."
        )
    return np.clip(inputs, low, high)


def _first_of_pair(found: Any) -> NDArray[Any] | None:
    """The actions in what `predict` returned, None where they are no array.

    Raises:
        ValueError: it is not a pair of actions and state.
    """
    if not isinstance(found, tuple) or len(found) != 2:
        raise ValueError(
            "model.predict must return (actions, state), got "
            f"{validation.shown(found)}; return (actions, None) where it has no state."
        )
    return validation.as_array(found[0])
