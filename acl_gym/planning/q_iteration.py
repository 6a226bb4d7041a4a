"""Fuzzy Q-iteration: dynamic programming on the agents' own partition.

With a fine partition it gives the optimum to compare the learners with; with their own
partition it shows what that partition allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv

from acl_gym.colony.greedy import ALL, LOOP, best_value
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.lookup import actions_are_replaced
from acl_gym.partitions import Partition, checked_partition, locate_all
from acl_gym.planning.sweeps import checked_settings, sweep_until_converged
from acl_gym.policies import TablePolicy
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray

_SLOTS = 65_536  # states simulated at once


@dataclass(frozen=True)
class QIterationResult:
    """The result of fuzzy Q-iteration.

    Attributes:
        policy: the greedy policy.
        iterations: sweeps made.
        change: the largest change of a value in the last sweep.
    """

    policy: TablePolicy
    iterations: int
    change: float


@dataclass(frozen=True)
class _Model:
    """What each action does in each cell: arrays of shape `(n_cells, n_actions)`."""

    reward: FloatArray
    terminated: BoolArray
    index: CellArray
    degree: FloatArray


def fuzzy_q_iteration(
    env: VectorEnv[Any, Any, Any],
    partition: Partition,
    *,
    discount: float = 1.0,
    tolerance: float = 1e-6,
    max_iterations: int = 1000,
    progress_bar: bool = False,
) -> QIterationResult:
    """Iterate the Bellman optimality equation (3.40) over a partition.

    Q_iu <- r(x_i, u) + gamma max_v sum_j beta_j(f(x_i, u)) Q_jv, in place, cell by
    cell; x_i is the state that represents cell i. On a crisp partition this is value
    iteration, eq. (3.42), on the cells. The environment itself serves as the model:
    `reset(options={"state": ...})` and one step for each cell and action.

    Args:
        env: a deterministic environment of this package.
        partition: the cells.
        discount: gamma_rl, in [0, 1]; 1 means undiscounted.
        tolerance: stop when no value changes by more than this, > 0.
        max_iterations: stop after this many sweeps, >= 1. Not reaching the tolerance
            is reported in the result: without a discount, cells from which the goal
            cannot be reached cost more with each sweep.
        progress_bar: show a progress bar.

    Raises:
        TypeError: `env` is of another package, or random, does not show its state, or has
            a wrapper that replaces actions.
        ValueError: a parameter is out of range.
    """
    base = getattr(env, "unwrapped", env)
    if not isinstance(base, ControlVectorEnv) or base.system.draws_per_step:
        raise TypeError(
            "env must be a deterministic vector environment of acl_gym, which can "
            f"start from any state, got {type(base).__name__}."
        )
    if actions_are_replaced(env):
        raise TypeError(
            "env must carry out the actions that it is given, got a wrapper that replaces "
            f"them, {validation.shown(env)}; iterate on what it wraps."
        )
    if not base.system.fully_observed:
        raise TypeError(
            "env must show its state, but the observations of "
            f"{type(base).__name__} do not tell it; learn with an agent, such as "
            "QLearning."
        )
    checked_partition(partition)
    discount, tolerance, max_iterations = checked_settings(
        discount, tolerance, max_iterations
    )

    model = _try_all(base, partition)
    values = np.zeros(model.reward.shape)
    arrays = (model.reward, model.terminated, model.index, model.degree)
    iterations, change = sweep_until_converged(
        lambda: _sweep(*arrays, discount, values),
        tolerance,
        max_iterations,
        "Q-iteration" if progress_bar else None,
    )
    return QIterationResult(TablePolicy(partition, values), iterations, change)


def _try_all(env: ControlVectorEnv, partition: Partition) -> _Model:
    """Take every action from the state of every cell, many cells at a time."""
    states = partition.cell_states()
    if len(states) != partition.n_cells:
        raise ValueError(
            f"cell_states must give a state for each of the {partition.n_cells} cells, "
            f"got {len(states)}."
        )
    space = env.system.action_space
    if not isinstance(space, spaces.Discrete):
        raise ValueError(
            "env must have Discrete actions, all of which are tried, got "
            f"{validation.shown(space)}; make it with a list of inputs, one an action."
        )
    n_actions = int(space.n)
    shape = (len(states), n_actions)
    k = partition.cells_per_state
    validation.check_memory(
        f"the model of {len(states)} cells",
        len(states) * n_actions * (9 + 12 * k),
        "use fewer cells",
    )
    model = _Model(
        reward=np.empty(shape),
        terminated=np.empty(shape, dtype=np.bool_),
        index=np.empty((*shape, k), dtype=np.int32),
        degree=np.empty((*shape, k)),
    )
    for start in range(0, len(states), _SLOTS):
        some = slice(start, min(start + _SLOTS, len(states)))
        trial = env.with_slots(some.stop - some.start)
        for u in range(n_actions):
            trial.reset(options={"state": states[some]})
            actions = np.full(trial.num_envs, u)
            observation, reward, terminated, _, _ = trial.step(actions)
            model.reward[some, u] = reward
            model.terminated[some, u] = terminated
            model.index[some, u], model.degree[some, u] = locate_all(
                partition, observation, len(states)
            )
    return model


@njit
def _sweep(
    reward: FloatArray,
    terminated: BoolArray,
    index: CellArray,
    degree: FloatArray,
    discount: float,
    values: FloatArray,
) -> float:
    """One pass over all cells and actions, in place; returns the largest change."""
    n_cells, n_actions = reward.shape
    change = 0.0
    for cell in range(n_cells):
        for u in range(n_actions):
            best = 0.0
            if not terminated[cell, u]:
                best = best_value(values, index[cell], degree[cell], u, ALL, LOOP, LOOP)
            new = reward[cell, u] + discount * best
            change = max(change, abs(new - values[cell, u]))
            values[cell, u] = new
    return change
