"""Kernels of the update rules of chapter 2: how ants choose, evaporate and deposit."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.selection import choose_alone
from acl_gym.colony.update_kernels import decay_pair
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import ActionArray, BoolArray, CellArray, FloatArray, IntArray

LEAST_LEVEL = 1e-200
"""Below this no level evaporates: after a thousand trials (2.3) would come to 0, with
which nothing can be calculated any more."""


@njit(error_model="numpy")
def choose_in_turn(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    greedy_weights: FloatArray | None,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    q0: float,
    allowed: BoolArray,
    candidates: CellArray,
    local_decay: float,
    tau0: float,
    symmetric: bool,
    stale: BoolArray,
    actions: IntArray,
) -> None:
    """Let ants choose one by one, each followed by its local update (2.6).

    By the pseudo-random-proportional rule: the best action with probability q0, else
    one drawn by (2.2). Where there are candidates, among those that are allowed and
    whose heuristic variable is positive; if there are none, the best of all allowed.

    Args:
        levels: `(n_cells, n_actions)`, changed in place.
        alpha: exponent of the levels.
        weights: `Pheromone.weights`; None: 1 everywhere.
        greedy_weights: `Pheromone.greedy_weights`; None: 1 everywhere.
        index: `(m, k)`.
        degree: `(m, k)`.
        draws: the ants' coins and choices, `(2, m)`.
        q0: in [0, 1].
        allowed: U_q, `(m, n_actions)`; an empty array where every action is allowed.
        candidates: of each cell, `(n_cells, c)`, for one cell per state; an empty array
            where every action is one.
        local_decay: gamma of (2.6); 0 for none.
        tau0: the level towards which pairs decay.
        symmetric: a pair and its reverse have the same level.
        stale: `Pheromone.stale`, set where levels change.
        actions: receives the choices, `(m,)`.
    """
    near = np.zeros((index.shape[0], levels.shape[1]), np.bool_)
    for j in range(actions.size):
        greedy, own = draws[0, j] < q0, allowed
        if candidates.size > 0:
            cell, some = index[j, 0], False
            for c in range(candidates.shape[1]):
                u = candidates[cell, c]
                if allowed.size > 0 and not allowed[j, u]:
                    continue
                if weights is None or weights[cell, u] > 0.0:
                    near[j, u] = some = True
            if some:
                own = near
            else:
                greedy = True
        action = choose_alone(
            levels,
            alpha,
            greedy_weights if greedy else weights,
            index,
            degree,
            draws,
            0.0,
            greedy,
            own,
            j,
        )
        actions[j] = action
        if local_decay == 0.0:
            continue
        for c in range(index.shape[1]):
            cell = index[j, c]
            decay_pair(levels, cell, action, local_decay * degree[j, c], tau0, stale)
            if symmetric:
                levels[action, cell] = levels[cell, action]
                stale[action] = True


@njit
def evaporate(levels: FloatArray, rho: float, least: float) -> None:
    """Evaporation on all pairs, the first term of (2.3), but not below `least`."""
    kept, flat = 1.0 - rho, levels.ravel()
    for i in range(flat.size):
        flat[i] = max(kept * flat[i], least)


@njit
def add_deposits(
    index: CellArray,
    degree: FloatArray,
    action: ActionArray,
    ends: IntArray,
    first: int,
    amounts: FloatArray,
    symmetric: bool,
    noted: FloatArray,
    levels: FloatArray,
) -> None:
    """Add what ants deposit along their solutions, the second term of (2.3).

    Args:
        index: cells, the rows of one ant after those of the one before, `(r, k)`.
        degree: degrees, `(r, k)`; a pair gets its largest within a solution.
        action: actions, `(r,)`.
        ends: where the rows of each ant end, `(b,)`.
        first: the number of the first of these ants.
        amounts: what each ant deposits on a pair, `(b,)`; ants with 0 are passed over.
        symmetric: deposit on the reverse of each pair too.
        noted: `(n_pairs, 2)`, for each pair the last ant that visited it, -1 before the
            first, and its degree; empty where no solution has a pair twice.
        levels: changed in place.
    """
    n_actions = levels.shape[1]
    row = 0
    for i in range(ends.size):
        if amounts[i] == 0.0:
            row = ends[i]
        ant = float(first + i)
        for r in range(row, ends[i]):
            u = np.uint64(action[r])
            for c in range(index.shape[1]):
                cell, share = np.uint64(index[r, c]), degree[r, c]
                if noted.size > 0:
                    pair = cell * np.uint64(n_actions) + u
                    before = noted[pair, 1] if noted[pair, 0] == ant else 0.0
                    share = max(0.0, share - before)
                    noted[pair, 0], noted[pair, 1] = ant, before + share
                levels[cell, u] += share * amounts[i]
                if symmetric:
                    levels[u, cell] += share * amounts[i]
        row = ends[i]


@njit
def mix_in(
    cells: CellArray,
    degree: FloatArray,
    actions: IntArray,
    rho: float,
    deposit: float,
    symmetric: bool,
    levels: FloatArray,
    stale: BoolArray,
) -> None:
    """The global update of the Ant Colony System (2.5), on the pairs of one solution.

    Args:
        cells: of different pairs, `(r,)`.
        degree: of each, `(r,)`.
        actions: of each, `(r,)`.
        rho: in [0, 1].
        deposit: F(s), > 0.
        symmetric: do the same to the reverse of each pair.
        levels: changed in place.
        stale: `Pheromone.stale`, set where levels change.
    """
    for r in range(cells.size):
        i, u, share = cells[r], actions[r], rho * degree[r]
        levels[i, u] = (1.0 - share) * levels[i, u] + share * deposit
        stale[i] = True
        if symmetric:
            levels[u, i] = levels[i, u]
            stale[u] = True


@njit
def limit(levels: FloatArray, least: float, most: float) -> None:
    """Bring all levels into [least, most]."""
    flat = levels.ravel()
    for i in range(flat.size):
        flat[i] = min(max(flat[i], least), most)


@njit
def branching_factor(
    levels: FloatArray, candidates: CellArray, cells: CellArray, share: float = 0.05
) -> float:
    """The lambda-branching factor (Gambardella and Dorigo, 1995), mean over cells.

    How many actions of a cell have a level of at least the smallest plus `share` of the
    way to the largest. It approaches 1, or 2 in a symmetric problem, where the ants
    follow one solution.

    Args:
        levels: `(n_cells, n_actions)`.
        candidates: the actions that count in each cell, `(n_cells, k)`; an empty array
            where all do.
        cells: those that count, `(n,)`, such as the ones of the best solution; in others
            nothing may ever have been deposited.
        share: lambda, in [0, 1].
    """
    k = candidates.shape[1] if candidates.size > 0 else levels.shape[1]
    count = 0
    for i in cells:
        low, high = np.inf, 0.0
        for c in range(k):
            level = levels[i, candidates[i, c] if candidates.size > 0 else c]
            low, high = min(low, level), max(high, level)
        cutoff = low + share * (high - low)
        for c in range(k):
            level = levels[i, candidates[i, c] if candidates.size > 0 else c]
            count += level >= cutoff
    return float(count / cells.size)
