"""How an ant chooses its action: the three rules of §3.3.1, and the greedy policy.

All are written over `(index, degree)`: with one cell a state they are the crisp rules.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from acl_gym.colony.pheromone import Pheromone
from acl_gym.partitions.kernels import written_out
from acl_gym.utils import threads
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

RULES = ("boltzmann", "epsilon_greedy", "max_boltzmann")

ALL: BoolArray = np.empty((0, 0), dtype=np.bool_)
"""What kernels are given as `allowed` where every action is."""


def choose_actions(
    rule: str,
    pheromone: Pheromone,
    index: CellArray,
    degree: FloatArray,
    epsilon: float,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
) -> IntArray:
    """Choose an action for each ant; all choose on the same pheromone.

    - `"boltzmann"` (3.4), fuzzy (4.11): in proportion to the degree-weighted mean of
      tau^alpha / sum of tau^alpha. `epsilon` is not used.
    - `"epsilon_greedy"` (3.5): the best action of (4.16), ties broken at random; with
      probability epsilon any action.
    - `"max_boltzmann"` (3.6): Boltzmann; with probability epsilon any action.

    Args:
        rule: one of `RULES`.
        pheromone: the shared table; stale probabilities are repaired in passing.
        index: cells of the ants' states, `(m, k)`.
        degree: their degrees, `(m, k)`.
        epsilon: exploration probability, in [0, 1].
        rng: two uniform numbers an ant are drawn from it: a coin, and a choice.
        allowed: U_q, the actions that each ant may take, `(m, n_actions)`, one or
            more an ant; None: all.

    Returns:
        Indices of actions, `(m,)`.
    """
    if rule == "epsilon_greedy":
        return epsilon_greedy_actions(
            pheromone.levels, index, degree, epsilon, rng, allowed
        )
    draws = rng.random((2, index.shape[0]))
    actions = np.empty(index.shape[0], dtype=np.int64)
    columns, corners = written_out(pheromone.n_actions), written_out(index.shape[1])
    if rule != "max_boltzmann":
        epsilon = 0.0

    if allowed is None:
        pheromone.repair(index)
    draw = _boltzmann
    if threads.worth_it(len(index)):
        draw = _boltzmann_in_parallel
    draw(
        pheromone.levels,
        pheromone.alpha,
        pheromone.probabilities,
        index,
        degree,
        draws,
        epsilon,
        ALL if allowed is None else allowed,
        columns,
        corners,
        actions,
    )
    return actions


def epsilon_greedy_actions(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    epsilon: float,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
) -> IntArray:
    """Rule (3.5) on any table of values; see `choose_actions`."""
    draws = rng.random((2, index.shape[0]))
    actions = np.empty(index.shape[0], dtype=np.int64)
    any_action = ALL if allowed is None else allowed
    _epsilon_greedy(table, index, degree, draws, epsilon, any_action, actions)
    return actions


def greedy_actions(
    table: FloatArray,
    ranks: NDArray[np.int32],
    index: CellArray,
    degree: FloatArray,
    allowed: BoolArray | None = None,
) -> IntArray:
    """The policy (4.16): the action with the largest degree-weighted value.

    Args:
        table: `(n_cells, n_actions)`, pheromone levels or action values.
        ranks: `(n_cells, n_actions)`, an order of the actions for each cell. Tied
            actions go by their rank in the state's foremost cell.
        index: `(n, k)`.
        degree: `(n, k)`.
        allowed: the actions to choose from, `(n, n_actions)`, one or more a state;
            None: all.

    Returns:
        Indices of actions, `(n,)`.
    """
    actions = np.empty(index.shape[0], dtype=np.int64)
    _greedy(table, ranks, index, degree, ALL if allowed is None else allowed, actions)
    return actions


@njit(cache=True, inline="always")
def _value(table: FloatArray, cells: CellArray, degrees: FloatArray, u: int) -> float:
    """The sum over a state's cells of degree times table entry."""
    total = 0.0
    for c in range(cells.size):
        total += degrees[c] * table[cells[c], u]
    return total


@njit(cache=True, inline="always")
def best_value(
    table: FloatArray, index: CellArray, degree: FloatArray, j: int, allowed: BoolArray
) -> float:
    """The largest degree-weighted value that state j offers, over U_q.

    For kernels: the inner part of (3.40), (3.44) and (4.16).

    Args:
        table: `(n_cells, n_actions)`.
        index: `(n, k)`.
        degree: `(n, k)`.
        j: which of the n states.
        allowed: U_q, `(n, n_actions)`; an empty array where every action is.
    """
    best = -np.inf
    for u in range(table.shape[1]):
        if allowed.size > 0 and not allowed[j, u]:
            continue
        value = 0.0
        for c in range(index.shape[1]):
            value += degree[j, c] * table[index[j, c], u]
        best = max(best, value)
    return best


@njit(cache=True)
def mark_greedy(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    allowed: BoolArray,
    greedy: BoolArray,
) -> None:
    """Write to `greedy` `(m,)` whether each action is a best one; tied ones are.

    Exact where `table` is the one that the actions were chosen on: the sums are those
    of the selection.
    """
    for j in range(actions.size):
        value = _value(table, index[j], degree[j], actions[j])
        greedy[j] = value >= best_value(table, index, degree, j, allowed)


@njit(cache=True)
def _any_action(choice: float, j: int, n_actions: int, allowed: BoolArray) -> int:
    """One of the actions that ant j may take, each as likely; choice is in [0, 1)."""
    if allowed.size == 0:
        return int(choice * n_actions)
    count = 0
    for u in range(n_actions):
        count += allowed[j, u]
    skip = int(choice * count)
    for u in range(n_actions):
        if allowed[j, u]:
            if skip == 0:
                return u
            skip -= 1
    return 0


@njit(cache=True, error_model="numpy")
def _boltzmann_allowed(
    levels: FloatArray,
    alpha: float,
    cells: CellArray,
    degrees: FloatArray,
    allowed: BoolArray,
    choice: float,
) -> int:
    """Draw from (4.11), the sums of (4.3) taken over U_q; one ant."""
    n_actions = allowed.size
    weight = np.zeros(n_actions)
    for c in range(cells.size):
        row = levels[cells[c]]
        largest = 0.0
        for u in range(n_actions):
            if allowed[u]:
                largest = max(largest, row[u])
        share = 0.0
        for u in range(n_actions):
            if allowed[u]:
                share += (row[u] / largest) ** alpha
        for u in range(n_actions):
            if allowed[u]:
                weight[u] += degrees[c] * (row[u] / largest) ** alpha / share
    cumulated = 0.0
    action = 0
    for u in range(n_actions):
        if allowed[u]:
            action = u
            cumulated += weight[u]
            if choice < cumulated:
                break
    return action


@njit(cache=True, error_model="numpy", inline="always")
def draw_action(
    levels: FloatArray,
    alpha: float,
    probabilities: FloatArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    j: int,
) -> int:
    """The action of ant j, for kernels; see `_boltzmann`."""
    n_actions = len(columns) or levels.shape[1]
    coin, choice = draws[0, j], draws[1, j]
    if allowed.size > 0:
        if coin < epsilon:
            return _any_action(choice, j, n_actions, allowed)
        return _boltzmann_allowed(
            levels, alpha, index[j], degree[j], allowed[j], choice
        )
    # Invert the distribution (4.11). Rounding may leave its sum below 1, so the last
    # action takes what is left. Counting the sums that are passed needs no branch,
    # where the processor would guess wrong every other time.
    cumulated = 0.0
    action = 0
    for u in range(n_actions - 1):
        value = 0.0
        for c in range(len(corners) or index.shape[1]):
            value += degree[j, c] * probabilities[np.uint64(index[j, c]), u]
        cumulated += value
        action += choice >= cumulated
    explored = int(choice * n_actions)
    return explored if coin < epsilon else action


@njit(cache=True, error_model="numpy")
def _boltzmann(
    levels: FloatArray,
    alpha: float,
    probabilities: FloatArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    actions: IntArray,
) -> None:
    for j in range(actions.size):
        actions[j] = draw_action(
            levels,
            alpha,
            probabilities,
            index,
            degree,
            draws,
            epsilon,
            allowed,
            columns,
            corners,
            j,
        )


@njit(cache=True, parallel=True, error_model="numpy")
def _boltzmann_in_parallel(
    levels: FloatArray,
    alpha: float,
    probabilities: FloatArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    actions: IntArray,
) -> None:
    """Do what `_boltzmann` does, its ants shared among threads."""
    for j in prange(actions.size):
        actions[j] = draw_action(
            levels,
            alpha,
            probabilities,
            index,
            degree,
            draws,
            epsilon,
            allowed,
            columns,
            corners,
            j,
        )


@njit(cache=True)
def _epsilon_greedy(
    levels: FloatArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    actions: IntArray,
) -> None:
    n_actions = levels.shape[1]
    coin, choice = draws[0], draws[1]
    values = np.empty(n_actions)
    for j in range(actions.size):
        # Stands also where no value is a number.
        actions[j] = _any_action(choice[j], j, n_actions, allowed)
        if coin[j] < epsilon:
            continue
        best = -np.inf
        tied = 0
        for u in range(n_actions):
            values[u] = -np.inf
            if allowed.size == 0 or allowed[j, u]:
                values[u] = _value(levels, index[j], degree[j], u)
            if values[u] > best:
                best = values[u]
                tied = 1
            elif values[u] == best:
                tied += 1
        if best == -np.inf:
            continue
        skip = int(choice[j] * tied)
        for u in range(n_actions):
            if values[u] == best:
                if skip == 0:
                    actions[j] = u
                    break
                skip -= 1


@njit(cache=True)
def _greedy(
    table: FloatArray,
    ranks: NDArray[np.int32],
    index: CellArray,
    degree: FloatArray,
    allowed: BoolArray,
    actions: IntArray,
) -> None:
    for j in range(actions.size):
        foremost = 0
        for c in range(1, index.shape[1]):
            if degree[j, c] > degree[j, foremost]:
                foremost = c
        rank = ranks[index[j, foremost]]
        best = -np.inf
        action = -1
        for u in range(table.shape[1]):
            if allowed.size > 0 and not allowed[j, u]:
                continue
            value = _value(table, index[j], degree[j], u)
            tied = value == best and action >= 0 and rank[u] < rank[action]
            if action < 0 or value > best or tied:
                best = value
                action = u
        actions[j] = action
