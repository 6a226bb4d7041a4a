"""The cost of a policy: the mean over given initial states, eq. (3.47)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.colony.cost import Cost
from acl_gym.colony.costs import as_cost, solution_costs
from acl_gym.colony.episodes import Episode
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.limits import DEFAULT_MAX_STEPS
from acl_gym.evaluation.inputs import walker
from acl_gym.evaluation.predictions import require_predictor
from acl_gym.evaluation.rows import rows_of
from acl_gym.evaluation.slots import rows_of_states, with_slots_for
from acl_gym.utils.pictures import guarded, table
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray, Predictor, Row
from acl_gym.utils.vector_envs import require_vector_env


@dataclass(frozen=True)
class PolicyCost:
    """The cost of a policy from each initial state.

    Attributes:
        costs: J of each episode, `(n,)`.
        success: whether each episode was a success, `(n,)`: in environments of this
            package whether it reached the goal, in others what `info["is_success"]` said
            at its end. None if nothing says what success is.
        lengths: steps of each episode, `(n,)`.
        returns: the sum of the rewards of each episode, undiscounted, `(n,)`.
    """

    costs: FloatArray
    success: NDArray[np.bool_] | None
    lengths: NDArray[np.int64]
    returns: FloatArray

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
        name, values = ("costs", self.costs)
        if self._are_returns():
            name, values = ("returns", self.returns)
        ends = [digits(float(q)) for q in np.quantile(values, (0.0, 0.5, 1.0))]
        spread = f"lowest {ends[0]}, median {ends[1]}, highest {ends[2]}"
        return table([*rows, (name, spread), ("episodes", self._episodes())])

    def _are_returns(self) -> bool:
        """Whether the costs are returns turned round, of rewards that are no costs."""
        return bool((self.returns > 0).any()) and bool(
            np.array_equal(self.costs, -self.returns)
        )

    def _facts(self) -> list[tuple[str, str]]:
        facts = [("cost", digits(self.cost))]
        if self._are_returns():
            facts = [("mean_return", digits(self.mean_return))]
        if self.success is not None:
            facts.append(("success_rate", f"{self.success_rate:.0%}"))
        return facts

    def _episodes(self) -> str:
        shortest, longest = int(self.lengths.min()), int(self.lengths.max())
        span = f"{shortest}" if shortest == longest else f"{shortest} to {longest}"
        episodes = (
            "1 episode" if self.lengths.size == 1 else f"{self.lengths.size} episodes"
        )
        return f"{episodes} of {span} {'step' if span == '1' else 'steps'}"

    @property
    def cost(self) -> float:
        """Policy cost J^h, the mean over the initial states, eq. (3.47)."""
        return float(self.costs.mean())

    @property
    def success_rate(self) -> float | None:
        """The fraction of episodes that were a success; None if that is not known."""
        return None if self.success is None else float(self.success.mean())

    @property
    def mean_return(self) -> float:
        """The mean return over the initial states; -J^h unless `cost=` was given."""
        return float(self.returns.mean())


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
        model: an agent or policy with `predict(observation, deterministic=True)`; one
            that returns floats, such as `agent.interpolated_policy()`, where the actions
            of `env` are a bounded Box of one axis.
        env: where to run it. An unwrapped environment of this package is left alone: a
            copy with one slot per state is run. Any other must have that many slots
            already; it is run itself, and left as after a reset.
        states: initial states `(n, ...)`. None takes `evaluation_states()` of an
            environment of this package, and random states of any other.
        max_steps: T, >= 1. None takes the environment's `evaluation_steps`, 300 for
            an environment of another package. A limit that `env` was made with holds
            too if it is less, one that was only registered with its id does not.
        seed: of the environment's random numbers, >= 0; None continues its stream (a
            copy of it, where a copy is run).
        cost: the cost of an episode, see `acl_gym.costs`; None takes the sum
            of its stage costs.

    Returns:
        Costs, successes, lengths and returns, one per state.

    Raises:
        TypeError: `model` has no `predict`, `env` is not a vector environment, or `seed`
            is not an integer.
        ValueError: `seed` is negative, `env` is wrapped and has not one slot per state,
            or is of another package and `states` are given.
    """
    require_predictor(model)
    require_vector_env(env)
    base = env.unwrapped
    if states is not None:
        states = rows_of_states(states)
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
    rollout, choose, real = walker(
        env, DEFAULT_MAX_STEPS if max_steps is None else max_steps
    )
    episode_cost = as_cost(cost)
    observation = rollout.start(
        seed=seed, states=states, record=episode_cost is not None
    )
    memory = None
    while rollout.ants.size:
        seen = rows_of(observation, rollout.ants)
        actions, memory = choose(model, seen, rollout, memory)
        observation = rollout.step(actions).observation
    costs = rollout.cost
    if episode_cost is not None:
        episodes = rollout.episodes()
        if real is not None:
            episodes = real.with_inputs(episodes)
        costs = solution_costs(episode_cost, episodes)
    rollout.release()
    return PolicyCost(costs, rollout.success, rollout.length, -rollout.cost)


def reports_returns(
    env: VectorEnv[Any, Any, Any], cost: Cost | Callable[[Episode], float] | None = None
) -> bool:
    """Whether results in an environment are to be reported as returns, not as costs.

    They are costs where rewards are negative stage costs by design, in the environments
    of this package, and where a user has said what an episode costs.

    Args:
        env: any vector environment.
        cost: the cost of an episode, if one was given.
    """
    return cost is None and not _is_own(env)


def policy_measures(result: PolicyCost, env: VectorEnv[Any, Any, Any]) -> Row:
    """The columns of a history that an evaluation adds.

    Args:
        result: of the evaluation.
        env: where it took place.

    Returns:
        `policy_cost`; `policy_return` in environments of other packages, the mean
        undiscounted return; `success_rate` where success is known.
    """
    row: Row = {"policy_cost": result.cost}
    if reports_returns(env):
        row["policy_return"] = result.mean_return
    if result.success_rate is not None:
        row["success_rate"] = result.success_rate
    return row


def _is_own(env: VectorEnv[Any, Any, Any]) -> bool:
    """Whether an environment of this package is at the bottom, in either form."""
    base = env.unwrapped
    singles = getattr(base, "envs", None) or ()
    return isinstance(base, ControlVectorEnv) or any(
        isinstance(each.unwrapped, ControlEnv) for each in singles[:1]
    )
