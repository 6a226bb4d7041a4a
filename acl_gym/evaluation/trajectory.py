"""Single episodes under a policy, and what it does in given states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.evaluation.inputs import walker
from acl_gym.evaluation.predictions import (
    checked_actions,
    checked_inputs,
    require_predictor,
)
from acl_gym.evaluation.slots import control_env, rows_of_states, with_slots_for
from acl_gym.policies import PartitionPolicy
from acl_gym.utils.boxes import input_bounds
from acl_gym.utils.typing import FloatArray, Predictor


@dataclass(frozen=True)
class Trajectory:
    """One episode under a policy.

    Attributes:
        states: x(0) .. x(n), `(n + 1, state_size)`.
        actions: u(0) .. u(n - 1) as indices, `(n,)`, or as real inputs,
            `(n, n_inputs)`.
        costs: stage costs of the steps, `(n,)`.
        success: whether it reached the goal.
    """

    states: FloatArray
    actions: NDArray[Any]
    costs: FloatArray
    success: bool


def record_trajectory(
    model: Predictor,
    env: VectorEnv[Any, Any, Any],
    state: FloatArray,
    *,
    max_steps: int | None = None,
) -> Trajectory:
    """Run the policy of `model` once and record every state, action and cost.

    Args:
        model: see `evaluate_policy_cost`.
        env: an environment of this package with one slot, wrapped or not. One that is
            not wrapped is left alone, a wrapped one is left as after a reset.
        state: the initial state, `(state_size,)`.
        max_steps: T; None takes that of the environment.

    Raises:
        TypeError: `model` has no `predict`, or `env` is of another package.
        ValueError: it has more than one slot.
    """
    require_predictor(model)
    control_env(env)  # refuses others
    if env.num_envs != 1:
        raise ValueError(f"env must have one slot, got {env.num_envs}.")
    states_of_one = np.asarray(state)[None]
    env = with_slots_for(env, states_of_one)
    base = control_env(env)
    rollout, choose, real = walker(
        env, base.system.evaluation_steps if max_steps is None else max_steps
    )
    observation = rollout.start(states=states_of_one)
    states, actions, costs = [base.states[0]], [], []
    memory = None
    while rollout.ants.size:
        action, memory = choose(model, observation, rollout, memory)
        step = rollout.step(action)
        observation = step.observation
        states.append(base.states[0])
        actions.append(int(action[0]) if real is None else real.taken[-1][0])
        costs.append(float(step.cost[0]))
    rollout.release()
    return Trajectory(
        np.array(states),
        np.array(actions),
        np.array(costs),
        bool(rollout.terminated[0]),
    )


def actions_in(
    model: Predictor, env: VectorEnv[Any, Any, Any], states: FloatArray
) -> NDArray[Any]:
    """The action of the policy in each of some states, `(n,)`.

    Where the actions of `env` are a Box, the inputs that it sets, `(n, n_inputs)`.

    Args:
        model: see `evaluate_policy_cost`.
        env: an environment of this package with one slot per state, wrapped or not. One
            that is not wrapped is left alone, a wrapped one is left as after a reset.
        states: `(n, state_size)`.

    Raises:
        TypeError: `model` has no `predict`, or `env` is of another package.
    """
    require_predictor(model)
    control_env(env)
    states = rows_of_states(states)
    env = with_slots_for(env, states)
    observation, _ = env.reset(options={"state": states})
    space: Any = env.single_action_space
    if isinstance(model, PartitionPolicy):
        found = model.predict(observation, None, np.ones(len(observation), np.bool_))
    else:
        found = model.predict(observation, deterministic=True)
    slots = np.arange(env.num_envs)
    if isinstance(space, spaces.Box):
        return checked_inputs(found, slots, *input_bounds("the actions of env", space))
    return checked_actions(found, slots, int(space.start), int(space.n))
