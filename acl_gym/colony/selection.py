"""How an ant chooses its action: the three rules of §3.3.1.

All are written over `(index, degree)`: with one cell per state they are the crisp
rules. Ants weigh tau^alpha eta^beta, where eta is a heuristic; without one, eta = 1.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from acl_gym.colony.greedy import (
    ALL,
    any_action,
    best_action,
    cells_out_of_range,
    check_choice,
    drawn_numbers,
    epsilon_greedy_actions,
)
from acl_gym.colony.pheromone import Pheromone, repair
from acl_gym.partitions.kernels import written_out
from acl_gym.utils import threads, validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

RULES = ("boltzmann", "epsilon_greedy", "max_boltzmann")


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

    - `"boltzmann"`, eq. (3.4), fuzzy (4.11): in proportion to the degree-weighted mean
      of w / (sum of w), where w = tau^alpha eta^beta. `epsilon` is not used.
    - `"epsilon_greedy"`, eq. (3.5): the action with the largest degree-weighted sum of
      tau eta^(beta / alpha), that is of w^(1 / alpha), ties broken at random; with
      probability epsilon any action.
    - `"max_boltzmann"`, eq. (3.6): Boltzmann; with probability epsilon any action.

    An action with eta = 0 is chosen by exploration only, unless the mask leaves no
    other: then that cell goes by the pheromone alone.

    Args:
        rule: one of `RULES`.
        pheromone: the shared table; its stale probabilities are renewed.
        index: cells of the ants' states, `(m, k)`.
        degree: their degrees, `(m, k)`.
        epsilon: exploration probability, in [0, 1].
        rng: two uniform numbers per ant are drawn from it: a coin and a choice.
        allowed: U_q, the actions that each ant may take, `(m, n_actions)`, at least
            one per ant; None: all.

    Returns:
        Indices of actions, `(m,)`.
    """
    if type(rule) is not str or rule not in RULES:
        rule = validation.one_of("rule", rule, RULES)
    if not (isinstance(pheromone, Pheromone) and hasattr(rng, "random")):
        raise TypeError(
            "choose_actions needs a Pheromone and a numpy.random.Generator, got "
            f"{type(pheromone).__name__} and {type(rng).__name__}."
        )
    if type(epsilon) is not float:
        epsilon = validation.number("epsilon", epsilon, at_least=0, at_most=1)
    if rule == "epsilon_greedy":
        return epsilon_greedy_actions(
            pheromone.levels,
            index,
            degree,
            epsilon,
            rng,
            allowed,
            pheromone.greedy_weights,
        )
    levels = pheromone.levels
    # Where every action is allowed, `repair` looks at the cells.
    check_choice(index, degree, levels, allowed, cells=allowed is not None)
    count, k = index.shape
    draws = drawn_numbers(rng, count)
    actions = np.empty(count, np.int64)
    if rule != "max_boltzmann":
        epsilon = 0.0
    draw = _boltzmann
    if threads.worth_it(count):
        draw = _boltzmann_in_parallel
        if allowed is None:
            pheromone.repair(index)
    good = draw(
        levels,
        pheromone.alpha,
        pheromone.weights,
        pheromone.probabilities,
        pheromone.stale,
        index,
        degree,
        draws,
        epsilon,
        ALL if allowed is None else allowed,
        written_out(pheromone.n_actions),
        written_out(k),
        actions,
    )
    if not good:
        raise cells_out_of_range(index, len(levels))
    return actions


@njit(error_model="numpy")
def boltzmann_allowed(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    cells: CellArray,
    degrees: FloatArray,
    allowed: BoolArray,
    choice: float,
) -> int:
    """Draw one ant's action by Boltzmann selection, eq. (4.11), among U_q; for kernels.

    The probabilities, eq. (4.3), are computed anew, with sums over U_q only. Powers are
    not products as in `Pheromone.repair`, because those are rounded differently.
    """
    n_actions = allowed.size
    total, weight = np.zeros(n_actions), np.zeros(n_actions)
    for c in range(cells.size):
        cell = cells[c]
        row = levels[cell]
        counts = allowed
        if weights is not None:
            counts = allowed & (weights[cell] > 0.0)
            if not counts.any():
                counts = allowed
        largest = 0.0
        for u in range(n_actions):
            if counts[u]:
                largest = max(largest, row[u])
        share = 0.0
        for u in range(n_actions):
            if counts[u]:
                weight[u] = (row[u] / largest) ** alpha
                if weights is not None and weights[cell, u] > 0.0:
                    weight[u] *= weights[cell, u]
                share += weight[u]
        for u in range(n_actions):
            if counts[u]:
                total[u] += degrees[c] * weight[u] / share
    cumulated = 0.0
    action = 0
    for u in range(n_actions):
        if allowed[u]:
            action = u
            cumulated += total[u]
            if choice < cumulated:
                break
    return action


@njit(error_model="numpy", inline="always")
def _draw_action(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
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
    """The action of ant j by Boltzmann selection, from probabilities that are valid."""
    n_actions = len(columns) or levels.shape[1]
    coin, choice = draws[0, j], draws[1, j]
    if allowed.size > 0:
        if coin < epsilon:
            return any_action(choice, j, n_actions, allowed)
        return boltzmann_allowed(
            levels, alpha, weights, index[j], degree[j], allowed[j], choice
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


@njit(error_model="numpy")
def _boltzmann(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    probabilities: FloatArray,
    stale: BoolArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    actions: IntArray,
) -> bool:
    """Renew the probabilities that are stale, if needed, and draw all actions.

    Returns False where a cell is not one of the table.
    """
    if allowed.size == 0 and not repair(
        levels, alpha, weights, index, columns, corners, probabilities, stale
    ):
        return False
    for j in range(actions.size):
        actions[j] = _draw_action(
            levels,
            alpha,
            weights,
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
    return True


@threads.shared_among_threads
@njit(parallel=True, error_model="numpy")
def _boltzmann_in_parallel(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    probabilities: FloatArray,
    stale: BoolArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    actions: IntArray,
) -> bool:
    """Do what `_boltzmann` does, its ants shared among threads; renew nothing."""
    for j in prange(actions.size):
        actions[j] = _draw_action(
            levels,
            alpha,
            weights,
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
    return True


@njit
def choose_alone(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    greedy: bool,
    allowed: BoolArray,
    j: int,
) -> int:
    """The action of ant j on the levels as they are now, for kernels.

    Unlike `choose_actions` it relies on no remembered probabilities, which suits
    levels that change from ant to ant.

    Args:
        levels: `(n_cells, n_actions)`.
        alpha: exponent of the levels.
        weights: `Pheromone.weights`, or `Pheromone.greedy_weights` if `greedy`; None:
            1 everywhere.
        index: `(m, k)`.
        degree: `(m, k)`.
        draws: the ants' coins and choices, `(2, m)`.
        epsilon: exploration probability.
        greedy: epsilon-greedy selection, eq. (3.5); else Boltzmann selection with
            exploration, eq. (3.6).
        allowed: U_q, `(m, n_actions)`; an empty array where every action is allowed.
        j: which of the m ants.
    """
    n_actions = levels.shape[1]
    coin, choice = draws[0, j], draws[1, j]
    if coin < epsilon:
        return any_action(choice, j, n_actions, allowed)
    if greedy:
        return best_action(levels, weights, index, degree, choice, allowed, j)
    own = allowed[j] if allowed.size > 0 else np.ones(n_actions, dtype=np.bool_)
    return boltzmann_allowed(levels, alpha, weights, index[j], degree[j], own, choice)
