"""Kernels of the update rules: how pheromone decays, and how it is deposited."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.selection import choose_alone
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import ActionArray, BoolArray, CellArray, FloatArray, IntArray


@njit(inline="always")
def _decayed(level: float, kept: float, tau0: float) -> float:
    """Decay towards tau0, eq. (4.17), where the fraction `kept` of the excess stays.

    Written so that a level at tau0 stays there exactly.
    """
    excess = level - tau0
    return tau0 + kept * excess


@njit(inline="always")
def decay_pair(
    levels: FloatArray,
    cell: int | np.uint64,
    action: int | np.uint64,
    decay: float,
    tau0: float,
    stale: BoolArray,
) -> None:
    """Local update of one pair, eq. (4.12), with `decay` = gamma * degree; for kernels."""
    levels[cell, action] = _decayed(levels[cell, action], 1.0 - decay, tau0)
    stale[cell] = True


@njit
def decay(
    index: CellArray,
    degree: FloatArray,
    corners: tuple[int, ...],
    actions: IntArray,
    local_decay: float,
    tau0: float,
    levels: FloatArray,
    stale: BoolArray,
) -> bool:
    """Local update, eq. (4.12): every ant's pair decays by 1 - gamma * degree.

    Returns False if the arrays do not fit together, or a pair is not one of the table.
    """
    if index.shape[0] != actions.size or degree.shape != index.shape:
        return False
    n_cells, n_actions = np.uint64(levels.shape[0]), np.uint64(levels.shape[1])
    for j in range(actions.size):
        action = np.uint64(actions[j])  # unsigned: negative ones become huge
        for c in range(len(corners) or index.shape[1]):
            if degree[j, c] > 0.0:
                cell = np.uint64(index[j, c])
                if cell >= n_cells or action >= n_actions:
                    return False
                decay_pair(
                    levels, cell, action, local_decay * degree[j, c], tau0, stale
                )
    return True


# Columns of the deposits on a pair, side by side because they are used together.
_LAST, _DUE, _TOTAL, _LARGEST = range(4)


@njit
def sum_deposits(
    index: CellArray,
    degree: FloatArray,
    corners: tuple[int, ...],
    action: ActionArray,
    ends: IntArray,
    first: int,
    deposits: FloatArray,
    summed: FloatArray,
    touched: IntArray,
    n_touched: int,
    n_actions: int,
) -> int:
    """Sum the deposits of some ants on each pair, for the global update, eq. (4.15).

    Within a solution a pair counts with its largest degree, eq. (4.13). So the deposit
    of an ant stays due, and may grow, until another ant visits the pair; then it is
    added to the total. The decay of the pair needs the largest degree over all ants,
    eq. (4.14). That takes one look at each visit and no list of the pairs of one ant.
    Written without a branch, which the processor could not predict.

    Args:
        index: cells, the rows of one ant after those of the one before, `(r, k)`.
        degree: degrees, `(r, k)`.
        corners: k, written out.
        action: actions, `(r,)`.
        ends: where the rows of each ant end, `(b,)`.
        first: the number of the first of these ants.
        deposits: the deposit of each ant, `(b,)`, > 0.
        summed: for each pair the last ant that visited it, what is due from that ant,
            the total of those before it, the largest degree so far. Added to; all
            columns but the first are zero before the first call.
        touched: the pairs visited so far with a degree > 0, and room for one more;
            added to.
        n_touched: their number.
        n_actions: columns of the table.

    Returns:
        The number of `touched` pairs.
    """
    # All indices are unsigned: no check for indices from the end.
    row, count, width = np.uint64(0), np.uint64(n_touched), np.uint64(n_actions)
    for i in range(ends.size):
        ant, deposit, end = float(first + i), deposits[i], np.uint64(ends[i])
        while row < end:
            u = np.uint64(action[row])
            for c in range(len(corners) or index.shape[1]):
                pair = np.uint64(index[row, c]) * width + u
                weight = degree[row, c]
                new = summed[pair, _LAST] != ant
                due, largest = summed[pair, _DUE], summed[pair, _LARGEST]
                summed[pair, _LAST] = ant
                summed[pair, _TOTAL] += due if new else 0.0
                summed[pair, _DUE] = max(0.0 if new else due, deposit * weight)
                summed[pair, _LARGEST] = max(largest, weight)
                touched[count] = pair
                count += np.uint64((largest == 0.0) & (weight > 0.0))
            row += np.uint64(1)
    return int(count)


@njit
def reinforce(
    touched: IntArray,
    summed: FloatArray,
    global_decay: float,
    levels: FloatArray,
    stale: BoolArray,
    evaporated: FloatArray | None = None,
) -> None:
    """Global update, eq. (4.15), of the touched pairs.

    Resets all but the first column of `summed`. Pairs evaporate by `global_decay` times
    their largest degree, or, where they have `evaporated` with some degree already, by
    what is missing; then the new largest degree is noted there.
    """
    n_actions = levels.shape[1]
    for pair in touched:
        cell, u = pair // n_actions, pair % n_actions
        deposit = summed[pair, _TOTAL] + summed[pair, _DUE]
        left = 1.0 - global_decay * summed[pair, _LARGEST]
        if evaporated is not None:
            before = evaporated[pair]
            if before < summed[pair, _LARGEST]:
                left /= 1.0 - global_decay * before
                evaporated[pair] = summed[pair, _LARGEST]
            else:
                left = 1.0
        levels[cell, u] = left * levels[cell, u] + global_decay * deposit
        stale[cell] = True
        summed[pair, 1:] = 0.0


@njit(error_model="numpy")
def choose_and_decay(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    greedy: bool,
    allowed: BoolArray,
    local_decay: float,
    tau0: float,
    stale: BoolArray,
    actions: IntArray,
) -> None:
    """Let ants choose one by one, each followed by its local update, eq. (4.12)."""
    for j in range(actions.size):
        action = choose_alone(
            levels, alpha, weights, index, degree, draws, epsilon, greedy, allowed, j
        )
        actions[j] = action
        for c in range(index.shape[1]):
            decay_pair(
                levels, index[j, c], action, local_decay * degree[j, c], tau0, stale
            )


# Columns of the largest degrees on a pair: of the last ant, and of all ants.
_OF_ANT, _OF_ALL = 1, 2


@njit
def note_visits(
    index: CellArray,
    degree: FloatArray,
    action: ActionArray,
    ends: IntArray,
    first: int,
    local_decay: float,
    visits: FloatArray,
    kept: FloatArray,
    n_actions: int,
) -> None:
    """Gather what decay at the end of a trial needs, over the pairs some ants visited.

    Args:
        index: cells, the rows of one ant after those of the one before, `(r, k)`.
        degree: degrees, `(r, k)`.
        action: actions, `(r,)`.
        ends: where the rows of each ant end, `(b,)`.
        first: the number of the first of these ants.
        local_decay: gamma.
        visits: `(n_pairs, 3)`: for each pair the last ant that visited it (-1 before
            the first), that ant's largest degree, the largest of all ants; updated.
        kept: `(n_pairs,)`, the product of 1 - gamma * (largest degree) over the ants
            before the last one; 1 before the first call, updated.
        n_actions: columns of the table.
    """
    row = 0
    for i in range(ends.size):
        ant = float(first + i)
        while row < ends[i]:
            for c in range(index.shape[1]):
                pair = index[row, c] * n_actions + action[row]
                if visits[pair, _LAST] != ant:
                    kept[pair] *= 1.0 - local_decay * visits[pair, _OF_ANT]
                    visits[pair, _LAST], visits[pair, _OF_ANT] = ant, 0.0
                weight = degree[row, c]
                visits[pair, _OF_ANT] = max(visits[pair, _OF_ANT], weight)
                visits[pair, _OF_ALL] = max(visits[pair, _OF_ALL], weight)
            row += 1


@njit
def decay_late(
    visits: FloatArray,
    kept: FloatArray,
    each_ant: bool,
    local_decay: float,
    tau0: float,
    levels: FloatArray,
) -> None:
    """Decay all pairs after a trial.

    Once for each ant that visited a pair, the total local update, eq. (3.13), or once
    for all ants together.

    Args:
        visits: as `note_visits` left it.
        kept: as `note_visits` left it.
        each_ant: decay once for each ant that visited a pair, else once for all.
        local_decay: gamma.
        tau0: the level towards which pairs decay.
        levels: `(n_cells, n_actions)`, changed in place.
    """
    n_actions = levels.shape[1]
    for pair in range(kept.size):
        if each_ant:
            left = kept[pair] * (1.0 - local_decay * visits[pair, _OF_ANT])
        else:
            left = 1.0 - local_decay * visits[pair, _OF_ALL]
        cell, u = pair // n_actions, pair % n_actions
        levels[cell, u] = _decayed(levels[cell, u], left, tau0)
