"""What a policy chooses in the slots of an environment, checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.evaluation.rollout import Rollout
from acl_gym.policies import PartitionPolicy
from acl_gym.utils import validation
from acl_gym.utils.typing import IntArray, Predictor


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
    if not isinstance(found, tuple) or len(found) != 2:
        raise ValueError(
            "model.predict must return (actions, state), got "
            f"{validation.shown(found)}; return (actions, None) where it has no state."
        )
    array = validation.as_array(found[0])
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
