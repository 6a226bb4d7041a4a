"""Value iteration, eq. (3.42), and the exact value of a policy.

Both need the model of a finite Markov decision process; they give the optimum to
compare the learners with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse import csgraph
from scipy.sparse.linalg import spsolve

from acl_gym.partitions import Discrete
from acl_gym.planning.model import TabularModel
from acl_gym.planning.sweeps import (
    checked_discount,
    checked_settings,
    sweep_until_converged,
)
from acl_gym.policies import TablePolicy
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class ValueIterationResult:
    """The result of value iteration.

    Attributes:
        values: V of each state, `(n_states,)`.
        action_values: Q of each action in each state, `(n_states, n_actions)`.
        actions: a best action of each state, `(n_states,)`; see `value_iteration`.
        iterations: sweeps made.
        change: the largest change of a value in the last sweep.
        model: the model that it was computed for.
    """

    values: FloatArray
    action_values: FloatArray
    actions: IntArray
    iterations: int
    change: float
    model: TabularModel

    @property
    def policy(self) -> TablePolicy:
        """The policy that takes `actions`, on observations of a `Discrete` space.

        Its table holds the action values; that of the action taken is raised to the
        highest value in its state, and ties are broken in its favour.
        """
        model, table = self.model, self.action_values.copy()
        states = np.arange(model.n_states)
        table[states, self.actions] = table.max(axis=1)
        ranks = np.tile(np.arange(model.n_actions, dtype=np.int32), (len(table), 1))
        # The action taken swaps ranks with the first one.
        ranks[states, 0] = self.actions
        ranks[states, self.actions] = 0
        space = spaces.Discrete(model.n_states, start=model.first_state)
        partition = Discrete.from_space(space)
        return TablePolicy(partition, table, ranks, model.first_action)


def value_iteration(
    model: TabularModel | gym.Env[Any, Any] | VectorEnv[Any, Any, Any],
    *,
    discount: float = 1.0,
    tolerance: float = 1e-10,
    max_iterations: int = 100_000,
    progress_bar: bool = False,
) -> ValueIterationResult:
    """Iterate the Bellman optimality equation (3.42) until the values converge.

    V(q) <- max_u sum_q' P (R + gamma V(q')), from V = 0, in place: each state uses
    the values that were just computed for the states before it. This needs fewer
    sweeps than (3.42) with two tables and converges to the same values.

    Actions whose values lie within `tolerance` of the best, or within that fraction of
    the best if it exceeds 1, count as tied (our choice). The policy takes the tied
    action from which an episode can end soonest, and the first of several. This matters
    without a discount: if only the goal is rewarded, standing still forever is tied with
    going to the goal. A policy of best actions is optimal if its episodes always end.

    Args:
        model: the model, or an environment for `TabularModel.from_env`.
        discount: gamma_rl, in [0, 1].
        tolerance: stop when no value changes by more than this, > 0.
        max_iterations: stop after this many sweeps, >= 1. Not reaching the tolerance is
            reported in the result: without a discount, states from which no end can be
            reached cost more with each sweep.
        progress_bar: show a progress bar.

    Raises:
        TypeError: the environment does not publish its model.
        ValueError: a parameter is out of range, or the values overflow.
    """
    if not isinstance(model, TabularModel):
        model = TabularModel.from_env(model)
    discount, tolerance, max_iterations = checked_settings(
        discount, tolerance, max_iterations
    )

    arrays = (model.probability, model.next_state, model.reward, model.terminated)
    values = np.zeros(model.n_states)
    iterations, change = sweep_until_converged(
        lambda: _sweep(*arrays, discount, values),
        tolerance,
        max_iterations,
        "Value iteration" if progress_bar else None,
    )
    action_values = _action_values(*arrays, discount, values)
    if not (np.isfinite(values).all() and np.isfinite(action_values).all()):
        raise ValueError(
            f"values must stay finite, but overflowed within {iterations} sweeps; "
            "scale the rewards down, or lower discount or max_iterations."
        )
    best = action_values.max(axis=1, keepdims=True)
    tied = action_values >= best - tolerance * np.maximum(1.0, np.abs(best))
    actions = _nearest_to_an_end(
        model.probability, model.next_state, model.terminated, tied
    )
    return ValueIterationResult(
        values, action_values, actions, iterations, change, model
    )


def policy_value(
    model: TabularModel | gym.Env[Any, Any] | VectorEnv[Any, Any, Any],
    policy_actions: ArrayLike,
    discount: float = 1.0,
) -> FloatArray:
    """The exact value of a policy in each state.

    Solves the Bellman equation of the policy (3.38) as a linear system. Without a
    discount, a policy may reach states from which its episodes never end. Where it
    expects no reward in such a cycle, the value is 0. Where costs accrue, the value is
    -inf, also in every state from which the cycle may be reached; where rewards
    accrue, it is +inf.

    Args:
        model: the model, or an environment for `TabularModel.from_env`.
        policy_actions: the action of each state, counted from 0, `(n_states,)`.
        discount: gamma_rl, in [0, 1].

    Returns:
        V^h, `(n_states,)`.

    Raises:
        TypeError: the environment does not publish its model.
        ValueError: `policy_actions` or `discount` are out of range; or, without a
            discount, a value is not defined because both costs and rewards accrue.
    """
    if not isinstance(model, TabularModel):
        model = TabularModel.from_env(model)
    discount = checked_discount(discount)
    actions = validation.as_array(policy_actions)
    n = model.n_states
    if actions is None or actions.shape != (n,) or actions.dtype.kind not in "iu":
        raise ValueError(
            f"policy_actions must be {n} integers, one per state, got "
            f"{validation.shown(policy_actions)}."
        )
    if actions.min() < 0 or actions.max() >= model.n_actions:
        raise ValueError(
            f"policy_actions must lie in 0..{model.n_actions - 1}, got "
            f"{actions.min()} to {actions.max()}; subtract first_action."
        )
    states = np.arange(n)
    probability = model.probability[states, actions]
    terminated = model.terminated[states, actions]
    reward = (probability * model.reward[states, actions]).sum(axis=1)
    rows = np.repeat(states, probability.shape[1])
    columns = model.next_state[states, actions].ravel()
    goes_on = np.where(terminated, 0.0, probability).ravel()
    chain = sparse.csr_array((goes_on, (rows, columns)), shape=(n, n))
    chain.eliminate_zeros()
    values = np.zeros(n)
    unknown = np.ones(n, dtype=np.bool_)
    if discount == 1:
        ends = (terminated & (probability > 0)).any(axis=1)
        values, unknown = _for_ever(chain, reward, ends)
    some = np.flatnonzero(unknown)
    if some.size:
        system = sparse.eye_array(some.size) - discount * chain[some][:, some]
        values[some] = spsolve(system.tocsc(), reward[some])
    return values


def _for_ever(
    chain: Any, reward: FloatArray, ends: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Values of the states from which an undiscounted policy never ends: 0 or infinite.

    Args:
        chain: sparse `(n, n)`, probabilities of moving from state to state.
        reward: expected reward of a step from each state, `(n,)`.
        ends: whether an episode may end right after a state, `(n,)`.

    Returns:
        Values `(n,)`, and a mask `(n,)` of the states whose value is still unknown.

    Raises:
        ValueError: a value is not defined.
    """
    # The policy never leaves a strong component without outgoing edges.
    _, label = csgraph.connected_components(chain, connection="strong")
    edges = chain.tocoo()
    left = np.zeros(label.max() + 1, dtype=np.bool_)
    left[label[edges.row[label[edges.row] != label[edges.col]]]] = True
    left[label[ends]] = True
    stays = ~left[label]
    costs, gains = (
        stays & np.isin(label, label[stays & (sign * reward > 0)]) for sign in (-1, 1)
    )
    to_costs, to_gains = _leading_to(chain, costs), _leading_to(chain, gains)
    if (to_costs & to_gains).any():
        raise ValueError(
            "without a discount a policy must not lead to both endless costs and "
            f"endless rewards, as from state {int(np.argmax(to_costs & to_gains))}; "
            "use a discount below 1."
        )
    values = np.zeros(reward.size)
    values[to_costs] = -np.inf
    values[to_gains] = np.inf
    return values, ~(to_costs | to_gains | stays)


def _leading_to(chain: Any, target: BoolArray) -> BoolArray:
    """A mask of the states from which `target` may be reached, including itself."""
    found, count = target.copy(), -1
    while found.sum() > count:
        count = int(found.sum())
        found |= chain @ found.astype(np.float64) > 0
    return found


@njit
def _action_value(
    probability: FloatArray,
    next_state: IntArray,
    reward: FloatArray,
    terminated: BoolArray,
    discount: float,
    values: FloatArray,
    state: int,
    action: int,
) -> float:
    """The expected reward plus the discounted value that follows, the sum in (3.42)."""
    total = 0.0
    for i in range(probability.shape[2]):
        worth = reward[state, action, i]
        if not terminated[state, action, i]:
            worth += discount * values[next_state[state, action, i]]
        total += probability[state, action, i] * worth
    return total


@njit
def _sweep(
    probability: FloatArray,
    next_state: IntArray,
    reward: FloatArray,
    terminated: BoolArray,
    discount: float,
    values: FloatArray,
) -> float:
    """One pass over all states, in place; returns the largest change."""
    change = 0.0
    for state in range(values.size):
        best = -np.inf
        for u in range(probability.shape[1]):
            value = _action_value(
                probability, next_state, reward, terminated, discount, values, state, u
            )
            best = max(best, value)
        change = max(change, abs(best - values[state]))
        values[state] = best
    return change


@njit
def _action_values(
    probability: FloatArray,
    next_state: IntArray,
    reward: FloatArray,
    terminated: BoolArray,
    discount: float,
    values: FloatArray,
) -> FloatArray:
    """Q of every state and action from V of the states."""
    n_states, n_actions, _ = probability.shape
    table = np.empty((n_states, n_actions))
    for state in range(n_states):
        for u in range(n_actions):
            table[state, u] = _action_value(
                probability, next_state, reward, terminated, discount, values, state, u
            )
    return table


@njit
def _nearest_to_an_end(
    probability: FloatArray,
    next_state: IntArray,
    terminated: BoolArray,
    tied: BoolArray,
) -> IntArray:
    """Of the tied actions of each state, the first from which an end is nearest."""
    n_states, n_actions, k = probability.shape
    never = n_states + 1
    steps = np.full(n_states, never)
    actions = np.zeros(n_states, dtype=np.int64)
    changed = True
    while changed:
        changed = False
        for state in range(n_states):
            nearest = never + 1
            for u in range(n_actions):
                if not tied[state, u]:
                    continue
                away = never
                for i in range(k):
                    if probability[state, u, i] > 0.0:
                        if terminated[state, u, i]:
                            away = 1
                        else:
                            away = min(away, steps[next_state[state, u, i]] + 1)
                if away < nearest:
                    nearest = away
                    actions[state] = u
            if nearest < steps[state]:
                steps[state] = nearest
                changed = True
    return actions
