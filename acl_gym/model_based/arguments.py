"""What the arguments of `learn_from_plant` stand for."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.control.lookup import system_of
from acl_gym.envs.learned.description import described_by, rows_of_inputs
from acl_gym.envs.limits import usual_max_steps
from acl_gym.envs.wrappers.action_grid import grid_over
from acl_gym.utils import validation
from acl_gym.utils.boxes import declared_bounds
from acl_gym.utils.typing import FloatArray

FIRST_ROUNDS = (20, 40, 60, 90, 120, 160, 200)
"""Interactions after which the colony learns, if nothing else is said."""

GROWTH = 1.5
"""The factor by which each later round has more of them."""

VALUES = 5
"""Values of each continuous input, if none are given."""


MODEL_STEPS, MOST_MODEL_STEPS = 20_000, 150_000
"""Steps in the model in a round: with two variables, and with many."""


def check_plant(env: Any) -> None:
    """Refuse what is no environment, before anything is asked of it.

    Raises:
        TypeError: it is none.
    """
    if not isinstance(env, gym.Env | VectorEnv):
        raise TypeError(
            "env must be an environment of Gymnasium, single or vector, got "
            f"{validation.shown(env)}; pass gym.make(id), not the id."
        )


def round_ends(rounds: Any, interactions: int) -> list[int]:
    """The numbers of interactions after which the colony learns, the last one being all."""
    if rounds is None:
        ends = list(FIRST_ROUNDS)
        while ends[-1] < interactions:
            ends.append(int(np.ceil(ends[-1] * GROWTH)))
    elif isinstance(rounds, int | np.integer) and not isinstance(rounds, bool):
        most = max(interactions, 1)
        count = validation.integer("rounds", rounds, at_least=1, at_most=most)
        ends = [round(interactions * (i + 1) / count) for i in range(count)]
    else:
        listed = validation.elements(rounds)
        ends = [
            validation.integer("rounds", each, at_least=1) for each in listed or [None]
        ]
    return [*sorted({end for end in ends if end < interactions}), interactions]


def task_of(env: Any, given: dict[str, Any]) -> dict[str, Any]:
    """Goal, tolerance and cost: those given, else what is known of the environment."""
    system = system_of(env)
    known = None if system is None else system.task
    task = {name: value for name, value in given.items() if value is not None}
    if known is None:
        return task
    if "goal" in task:  # a tolerance belongs to its goal
        return {**task, "cost": task.get("cost", known["cost"])}
    return {**known, **task}


def episode_steps(env: Any, given: int | None) -> int:
    """T in the model: what is given, else the limit of the environment, else 300."""
    if given is not None:
        return validation.integer("max_episode_steps", given, at_least=1)
    return usual_max_steps(env)


def usual_model_steps(n_variables: int) -> int:
    """The most steps of all ants in a round, if nothing is said."""
    more: int = 4 ** max(n_variables - 2, 0)
    return min(MODEL_STEPS * more, MOST_MODEL_STEPS)


def action_space_of(env: Any) -> Any:
    """Of one slot."""
    return env.single_action_space if isinstance(env, VectorEnv) else env.action_space


def inputs_of_actions(env: Any, inputs: Any) -> FloatArray | None:
    """What each action of the policy sets, `(n_actions, n_inputs)`.

    Args:
        env: the plant.
        inputs: those given; None takes a grid over continuous actions.

    Returns:
        None where actions are numbered and nobody has said what they set.
    """
    space = action_space_of(env)
    if isinstance(space, spaces.Discrete):
        known = None if inputs is None else described_by(env, inputs)["values"]
        return None if known is None else np.asarray(known)
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise TypeError(
            "a plant needs Discrete actions or a Box of one axis, got "
            f"{validation.shown(space)}."
        )
    if inputs is None:
        low, high = declared_bounds(space)
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            raise ValueError(
                "inputs must be given where the Box of actions has no finite bounds, got "
                f"{validation.shown(space)}."
            )
        _, values = grid_over(space, VALUES)
        return values.astype(np.float64)
    array = rows_of_inputs(inputs, space.shape[0])
    if ((array < space.low) | (array > space.high)).any():
        raise ValueError(
            f"inputs must lie within the actions of the environment, {space}, got "
            f"{validation.shown(inputs)}."
        )
    return array


def check_actions(agent: Any, env: Any, values: FloatArray | None) -> None:
    """Refuse an agent whose table has other actions than the plant, before it moves.

    Args:
        agent: what `learn_from_plant` was given.
        env: the plant.
        values: what each action sets; None where actions are numbered.

    Raises:
        ValueError: it has.
    """
    count = action_space_of(env).n if values is None else len(values)
    if isinstance(agent, TabularAgent) and agent.n_actions != count:
        raise ValueError(
            f"agent must have {count} actions, as the plant has, got {agent.n_actions}; "
            "give inputs= for its actions, or another agent."
        )
