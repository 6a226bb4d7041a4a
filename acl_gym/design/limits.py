"""What success owes to the ends of the range, at which the model stops like at a wall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.design.simulation import Responses
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.system import SlotError
from acl_gym.envs.plant import Plant
from acl_gym.utils.text import percent
from acl_gym.utils.typing import BoolArray, FloatArray, Predictor


@dataclass(frozen=True)
class Limits:
    """How often paths touch `low` or `high` of a variable that is not circular.

    A path ends where the goal is reached, or at the time limit. After each step the model
    sets a state beyond a limit back to it.

    Attributes:
        touched_rate: the share of all paths that touch a limit.
        touched_success_rate: the share of the paths to the goal that touch one; 0 where
            no path leads to the goal.
        by_variable: for each variable, the share of the paths to the goal that touch its
            limits; 0 for circular ones.
        success_rate_unlimited: the share of starts from which the goal is reached in a
            model that does not stop at the limits; None where this is not known: the model
            was learned from measurements and says nothing beyond the limits, or its
            functions fail there.
    """

    touched_rate: float
    touched_success_rate: float
    by_variable: dict[str, float]
    success_rate_unlimited: float | None

    @property
    def most(self) -> str:
        """The name of the variable whose limits are touched most often, without its unit."""
        return max(self.by_variable, key=self.by_variable.__getitem__).split(", ")[0]

    def in_words(self) -> str:
        """One or two sentences on all of it."""
        if self.touched_success_rate == 0.0:
            return "No path to the goal touches a limit of the range."
        text = (
            f"{percent(self.touched_success_rate)} of the paths to the goal touch a limit "
            f"of the range, most often that of {self.most}, where the model stops the "
            "state."
        )
        if self.success_rate_unlimited is not None:
            text += (
                " If the model does not stop it, the goal is reached from "
                f"{percent(self.success_rate_unlimited)} of the starts."
            )
        return text


def measure_limits(
    responses: Responses, policy: Predictor, env: ControlVectorEnv
) -> Limits:
    """Count the paths that touch a limit, and follow these again without limits.

    Args:
        responses: of the policy, see `simulate`.
        policy: whose actions are followed.
        env: the plant; it is not stepped itself.
    """
    plant: Any = env.system
    success = responses.success()
    touched = touched_limits(responses, plant)
    any_limit: BoolArray = np.any(touched, axis=1)
    shares = np.zeros(plant.low.size)
    if success.any():
        shares = touched[success].mean(axis=0)
    unlimited: float | None = float(success.mean())
    if any_limit.any():
        again = None
        if not hasattr(env, "transitions"):
            starts = responses.states[0, any_limit]
            again = _reach_unlimited(policy, env, starts, responses.limit)
        unlimited = None
        if again is not None:
            unlimited = float(np.concatenate([success[~any_limit], again]).mean())
    return Limits(
        float(any_limit.mean()),
        float(any_limit[success].mean()) if success.any() else 0.0,
        dict(zip(plant.variable_names, shares.tolist(), strict=False)),
        unlimited,
    )


def touched_limits(responses: Responses, plant: Plant) -> BoolArray:
    """Which limits are touched on the way to the goal, or within the time limit.

    Args:
        responses: see `simulate`.
        plant: the system.

    Returns:
        `(n, variables)`, False for circular variables. The start itself does not count.
    """
    last = np.minimum(responses.steps_to_goal(), responses.limit)
    counted = np.arange(len(responses.actions))[:, None] < last
    after = responses.states[1:]
    at_limit = ((after <= plant.low) | (after >= plant.high)) & plant.clipped
    return np.asarray((at_limit & counted[:, :, None]).any(axis=0))


def _reach_unlimited(
    policy: Predictor, env: ControlVectorEnv, starts: FloatArray, steps: int
) -> BoolArray | None:
    """Whether the goal is reached from each start if nothing stops at the limits, `(n,)`.

    A start whose state or cost becomes infinite does not reach it.

    Returns:
        None where functions of the user's own raise on states beyond the limits.
    """
    bounded: Any = env.system
    space: Any = env.single_action_space
    system = bounded.unlimited()
    found = np.zeros(len(starts), dtype=np.bool_)
    slots = np.arange(len(starts))
    states = np.ascontiguousarray(bounded.checked_states(starts).T)
    try:
        for _ in range(steps):
            chosen, _ = policy.predict(system.observe(states), deterministic=True)
            actions = np.asarray(chosen) - int(space.start)
            kept, states, reached = _advanced(system, states, actions)
            slots = slots[kept]
            found[slots[reached]] = True
            slots, states = slots[~reached], np.ascontiguousarray(states[:, ~reached])
            if not slots.size:
                break
    except Exception:  # whatever the user's code raises where it need not be defined
        return None
    return found


def _advanced(
    system: Plant, states: FloatArray, actions: Any
) -> tuple[Any, FloatArray, BoolArray]:
    """One step of the states whose next ones are finite: which, these, and the goal."""
    kept = np.arange(states.shape[1])
    while True:
        after = np.ascontiguousarray(states[:, kept])
        rewards, reached = np.empty(kept.size), np.empty(kept.size, dtype=np.bool_)
        try:
            with np.errstate(all="ignore"):
                system.advance(after, actions[kept], None, rewards, reached)
        except SlotError as error:
            kept = np.delete(kept, error.slot)
            continue
        return kept, after, reached
