"""The cost of a policy: the mean over given initial states, eq. (3.47)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.colony.costs import Cost, as_cost, solution_costs
from acl_gym.colony.episodes import Episode
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation.rollout import Rollout, require_vector_env
from acl_gym.policies import PartitionPolicy
from acl_gym.utils.pictures import guarded, table
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray, Predictor


@dataclass(frozen=True)
class PolicyCost:
    """The cost of a policy from each initial state.

    Attributes:
        costs: J of each episode, `(n,)`.
        success: whether each episode ended in a terminal state, `(n,)`.
        lengths: steps of each episode, `(n,)`.
    """

    costs: FloatArray
    success: NDArray[np.bool_]
    lengths: NDArray[np.int64]

    def __repr__(self) -> str:
        """Cost, rate of success, and how many episodes of which lengths."""
        if not self.lengths.size:
            return "PolicyCost(no episodes)"
        facts = ", ".join(f"{name}={value}" for name, value in self._facts())
        return f"PolicyCost({facts}, {self._episodes()})"

    @guarded
    def _repr_html_(self) -> str:
        """What a notebook shows: the measures as a table."""
        rows = [(name.replace("_", " "), value) for name, value in self._facts()]
        costs = [digits(float(q)) for q in np.quantile(self.costs, (0.0, 0.5, 1.0))]
        spread = f"lowest {costs[0]}, median {costs[1]}, highest {costs[2]}"
        return table([*rows, ("costs", spread), ("episodes", self._episodes())])

    def _facts(self) -> list[tuple[str, str]]:
        facts = [("cost", digits(self.cost))]
        if self.success is not None:
            facts.append(("success_rate", f"{self.success_rate:.0%}"))
        return facts

    def _episodes(self) -> str:
        shortest, longest = int(self.lengths.min()), int(self.lengths.max())
        span = f"{shortest}" if shortest == longest else f"{shortest} to {longest}"
        return f"{self.lengths.size} episodes of {span} steps"

    @property
    def cost(self) -> float:
        """Policy cost J^h, the mean over the initial states, eq. (3.47)."""
        return float(self.costs.mean())

    @property
    def success_rate(self) -> float:
        """The fraction of episodes that ended in a terminal state."""
        return float(self.success.mean())


@dataclass(frozen=True)
class Trajectory:
    """One episode under a policy.

    Attributes:
        states: x(0) .. x(n), `(n + 1, state_size)`.
        actions: u(0) .. u(n - 1) as indices, `(n,)`.
        costs: stage costs of the steps, `(n,)`.
        success: whether it ended in a terminal state.
    """

    states: FloatArray
    actions: NDArray[np.int64]
    costs: FloatArray
    success: bool


def evaluate_policy_cost(
    model: Predictor,
    env: VectorEnv[Any, Any, Any],
    states: FloatArray | None = None,
    *,
    max_steps: int | None = None,
    seed: int | None = None,
    cost: Cost | Callable[[Episode], float] | None = None,
) -> PolicyCost:
    """Run the policy of `model` once from each initial state, without exploration.

    Args:
        model: an agent or policy with `predict(observation, deterministic=True)`.
        env: where to run it. An unwrapped environment of this package is copied with
            one slot per state; any other must have that many slots already.
        states: initial states `(n, ...)`. None takes `evaluation_states()` of an
            environment of this package, and random states of any other.
        max_steps: T, >= 1. None takes the environment's `evaluation_steps`, 300 for
            an environment of another package.
        seed: of the environment's random numbers; None continues its stream.
        cost: the cost of an episode, see `acl_gym.colony.costs`; None takes the sum
            of its stage costs.

    Returns:
        Costs, successes and lengths, one per state.

    Raises:
        TypeError: `model` has no `predict`, or `env` is not a vector environment.
        ValueError: `env` is wrapped and has not one slot per state, or is of another
            package and `states` are given.
    """
    require_predictor(model)
    require_vector_env(env)
    base = env.unwrapped
    if isinstance(base, ControlVectorEnv):
        if states is None:
            states = base.system.evaluation_states()
        if max_steps is None:
            max_steps = base.system.evaluation_steps
        env = with_slots_for(env, states)
    elif states is not None:
        raise ValueError(
            "states can only be set in environments of acl_gym, got "
            f"{type(base).__name__}; leave them out to start from random states."
        )
    if states is not None and env.num_envs != len(states):
        raise ValueError(
            f"a wrapped env must have one slot for each of the {len(states)} states, "
            f"got {env.num_envs} slots."
        )
    rollout = Rollout(env, 300 if max_steps is None else max_steps)
    episode_cost = as_cost(cost)
    observation = rollout.start(
        seed=seed, states=states, record=episode_cost is not None
    )
    memory = None
    while rollout.ants.size:
        seen = observation[rollout.ants]
        actions, memory = _chosen(model, seen, rollout, memory)
        observation = rollout.step(actions).observation
    costs = rollout.cost
    if episode_cost is not None:
        costs = solution_costs(episode_cost, rollout.episodes())
    return PolicyCost(costs, rollout.success, rollout.length)


def with_slots_for(
    env: VectorEnv[Any, Any, Any], states: FloatArray | None = None
) -> VectorEnv[Any, Any, Any]:
    """An environment that has one slot per initial state of an evaluation.

    To evaluate often, call this once and pass the result to `evaluate_policy_cost`
    each time.

    Args:
        env: where to evaluate.
        states: initial states; None takes `evaluation_states()` of an environment of
            this package.

    Returns:
        A new environment of the same system; or `env` itself if it has the right
        number of slots already, is wrapped, or is of another package.
    """
    base = env.unwrapped
    if base is not env or not isinstance(base, ControlVectorEnv):
        return env
    if states is None:
        states = base.system.evaluation_states()
    return env if env.num_envs == len(states) else base.with_slots(len(states))


def _chosen(
    model: Predictor, observation: Any, rollout: Rollout, memory: Any
) -> tuple[NDArray[np.int64], Any]:
    """Indices of the actions that `model` takes in the active slots, and its state."""
    allowed = rollout.allowed()
    if isinstance(model, PartitionPolicy):
        starts = np.full(len(observation), rollout.steps == 0)
        actions, memory = model.predict(
            observation, memory, starts, action_masks=allowed
        )
    else:
        actions, _ = model.predict(observation, deterministic=True)
    return np.asarray(actions) - rollout.first_action, memory


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
        env: an environment of this package with one slot, wrapped or not.
        state: the initial state, `(state_size,)`.
        max_steps: T; None takes that of the environment.

    Raises:
        TypeError: `model` has no `predict`, or `env` is of another package.
        ValueError: it has more than one slot.
    """
    require_predictor(model)
    base = control_env(env)
    if env.num_envs != 1:
        raise ValueError(f"env must have one slot, got {env.num_envs}.")
    rollout = Rollout(
        env, base.system.evaluation_steps if max_steps is None else max_steps
    )
    observation = rollout.start(states=np.asarray(state)[None])
    states, actions, costs = [base.states[0]], [], []
    memory = None
    while rollout.ants.size:
        action, memory = _chosen(model, observation, rollout, memory)
        step = rollout.step(action)
        observation = step.observation
        states.append(base.states[0])
        actions.append(int(action[0]))
        costs.append(float(step.cost[0]))
    return Trajectory(
        np.array(states), np.array(actions), np.array(costs), bool(rollout.success[0])
    )


def actions_in(
    model: Predictor, env: VectorEnv[Any, Any, Any], states: FloatArray
) -> NDArray[np.int64]:
    """The action of the policy in each of some states, `(n,)`.

    Args:
        model: see `evaluate_policy_cost`.
        env: an environment of this package with one slot per state, wrapped or not.
        states: `(n, state_size)`.

    Raises:
        TypeError: `model` has no `predict`, or `env` is of another package.
    """
    require_predictor(model)
    control_env(env)
    observation, _ = env.reset(options={"state": states})
    if isinstance(model, PartitionPolicy):
        return model.predict(observation, None, np.ones(len(observation), np.bool_))[0]
    return np.asarray(model.predict(observation, deterministic=True)[0], dtype=np.int64)


def require_predictor(model: Any) -> None:
    """Check that an object can choose actions.

    Raises:
        TypeError: `model` has no method `predict`.
    """
    if not callable(getattr(model, "predict", None)) or isinstance(model, type):
        raise TypeError(
            "model must be an agent or a policy with "
            f"predict(observation, deterministic=True), got {model!r}."
        )


def control_env(env: VectorEnv[Any, Any, Any]) -> ControlVectorEnv:
    """The environment of this package that `env` is or wraps.

    Raises:
        TypeError: it is of another package.
    """
    base = env.unwrapped
    if not isinstance(base, ControlVectorEnv):
        raise TypeError(
            "env must be a vector environment of acl_gym, which can start from any "
            f"state, got {type(base).__name__}."
        )
    return base
