"""The best action of a table, and epsilon-greedy selection on it.

For tables of any kind: levels of pheromone, action values, costs to go.
"""

from __future__ import annotations

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, RankArray

_CELL, _FLOAT, _BOOL = np.dtype(np.int32), np.dtype(np.float64), np.dtype(np.bool_)

ALL: BoolArray = np.empty((0, 0), dtype=np.bool_)
"""What kernels take as `allowed` where every action is allowed."""

LOOP: tuple[int, ...] = ()
"""What kernels take where loops over cells and actions are not written out."""

NUMBERS_PER_ACTION = 2
"""How many random numbers the choice of an action takes: a coin and a choice."""


def epsilon_greedy_actions(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    epsilon: float,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
    weights: FloatArray | None = None,
) -> IntArray:
    """Epsilon-greedy selection, eq. (3.5), on any table of values times `weights`.

    See `choose_actions`.
    """
    check_choice(index, degree, table, allowed)
    return epsilon_greedy_unchecked(
        table, index, degree, epsilon, rng, allowed, weights
    )


def epsilon_greedy_unchecked(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    epsilon: float | FloatArray,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
    weights: FloatArray | None = None,
) -> IntArray:
    """`epsilon_greedy_actions` for cells that `locate_checked` has found for the table.

    `epsilon` may differ from state to state, `(n,)`.
    """
    draws = drawn_numbers(rng, len(index))
    if isinstance(epsilon, np.ndarray):
        draws[0] = draws[0] >= epsilon  # a coin that has fallen: 0 explores
        epsilon = 0.5
    actions = np.empty(len(index), np.int64)
    any_action = ALL if allowed is None else allowed
    _epsilon_greedy(table, weights, index, degree, draws, epsilon, any_action, actions)
    return actions


def drawn_numbers(rng: np.random.Generator, count: int) -> FloatArray:
    """The random numbers from which `count` actions are chosen, `(2, count)`.

    Args:
        rng: a generator, or an object with the same `random`.
        count: how many actions.

    Raises:
        ValueError: what another object than a generator gives is not uniform in [0, 1).
    """
    shape = NUMBERS_PER_ACTION, count
    draws = rng.random(shape)
    if type(rng) is not np.random.Generator and (
        not isinstance(draws, np.ndarray)
        or draws.shape != shape
        or draws.dtype != _FLOAT
        or not ((draws >= 0.0) & (draws < 1.0)).all()
    ):
        raise ValueError(
            f"rng.random({shape}) must give numbers in [0, 1), got "
            f"{validation.shown(draws)}."
        )
    return draws


def check_choice(
    index: CellArray,
    degree: FloatArray,
    table: FloatArray,
    allowed: BoolArray | None,
    cells: bool = True,
) -> None:
    """Check what kernels choose by: they address the table without further checks.

    Args:
        index: cells of the states, int32 `(n, k)`.
        degree: their degrees, float64 `(n, k)`.
        table: `(n_cells, n_actions)`.
        allowed: bool `(n, n_actions)`, or None.
        cells: look at every cell; False where another kernel does so.

    Raises:
        ValueError: a shape or type is wrong, or a cell is not one of the table.
    """
    if (type(index) is not np.ndarray or type(degree) is not np.ndarray) and not (
        isinstance(index, np.ndarray) and isinstance(degree, np.ndarray)
    ):
        raise TypeError(
            "index and degree must be arrays, got "
            f"{type(index).__name__} and {type(degree).__name__}."
        )
    good = (
        index.ndim == 2
        and index.shape == degree.shape
        and index.dtype == _CELL
        and degree.dtype == _FLOAT
    )
    if not good:
        raise ValueError(
            "index and degree must be int32 and float64 of the same shape (n, k), got "
            f"{index.dtype} {index.shape} and {degree.dtype} {degree.shape}."
        )
    if allowed is not None:
        shape = (len(index), table.shape[1])
        array = isinstance(allowed, np.ndarray)
        if not array or allowed.shape != shape or allowed.dtype != _BOOL:
            raise ValueError(
                f"allowed must be a bool array of shape {shape}, got "
                f"{validation.shown(allowed)}."
            )
    if cells and not _all_below(index, len(table)):
        raise cells_out_of_range(index, len(table))


def cells_out_of_range(index: CellArray, n_cells: int) -> ValueError:
    """The error for cells that are not rows of the table."""
    return ValueError(
        f"index must hold cells in 0..{n_cells - 1}, got {index.min()} to {index.max()}."
    )


@njit
def _all_below(index: CellArray, n_cells: int) -> bool:
    """Whether all cells are in 0..n_cells - 1."""
    good = True
    for j in range(index.shape[0]):
        for c in range(index.shape[1]):
            # Unsigned, so that negative ones become huge.
            good &= bool(np.uint32(index[j, c]) < np.uint32(n_cells))
    return good


def greedy_actions(
    table: FloatArray,
    ranks: RankArray,
    index: CellArray,
    degree: FloatArray,
    allowed: BoolArray | None = None,
) -> IntArray:
    """The policy (4.16): the action with the largest degree-weighted value.

    Args:
        table: `(n_cells, n_actions)`, pheromone levels or action values.
        ranks: `(n_cells, n_actions)`, an order of the actions for each cell. Of
            tied actions the one with the lowest rank in the state's cell of largest
            degree is taken.
        index: `(n, k)`.
        degree: `(n, k)`.
        allowed: the actions to choose from, `(n, n_actions)`, at least one per state;
            None: all.

    Returns:
        Indices of actions, `(n,)`.
    """
    check_choice(index, degree, table, allowed)
    actions = np.empty(index.shape[0], dtype=np.int64)
    _greedy(table, ranks, index, degree, ALL if allowed is None else allowed, actions)
    return actions


@njit(inline="always")
def best_value(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    j: int,
    allowed: BoolArray,
    corners: tuple[int, ...],
    choices: tuple[int, ...],
) -> float:
    """The largest degree-weighted value that state j offers, over U_q.

    For kernels: the maximum in the Bellman equation (3.40), in Q-learning, eq. (3.44),
    what a returning ant expects, and the policy, eq. (4.16).

    Args:
        table: `(n_cells, n_actions)`.
        index: `(n, k)`.
        degree: `(n, k)`.
        j: which of the n states.
        allowed: U_q, `(n, n_actions)`; an empty array if every action is allowed.
        corners: a tuple as long as k, for which the loop is written out (see
            `written_out`), or `LOOP`.
        choices: a tuple as long as n_actions, or `LOOP`.
    """
    best = -np.inf
    state = np.uint64(j)  # unsigned: no check for indices from the end
    for u in range(len(choices) or table.shape[1]):
        if allowed.size > 0 and not allowed[state, np.uint64(u)]:
            continue
        value = 0.0
        for c in range(len(corners) or index.shape[1]):
            cell = np.uint64(index[state, np.uint64(c)])
            value += degree[state, np.uint64(c)] * table[cell, np.uint64(u)]
        best = max(best, value)
    return best


@njit
def mark_greedy(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    allowed: BoolArray,
    greedy: BoolArray,
) -> None:
    """Write to `greedy`, `(m,)`, whether each action is a best one, ties included.

    Exact if the actions were chosen on this `table`: the sums are those of selection.
    """
    for j in range(actions.size):
        value = weighted_value(table, index[j], degree[j], actions[j])
        greedy[j] = value >= best_value(table, index, degree, j, allowed, LOOP, LOOP)


@njit(inline="always")
def weighted_value(
    table: FloatArray, cells: CellArray, degrees: FloatArray, u: int
) -> float:
    """The sum over a state's cells of degree times table entry."""
    total = 0.0
    for c in range(cells.size):
        total += degrees[c] * table[cells[c], u]
    return total


@njit
def _values(
    table: FloatArray,
    weights: FloatArray | None,
    cells: CellArray,
    degrees: FloatArray,
    allowed: BoolArray,
    j: int,
    values: FloatArray,
) -> None:
    """Write the value of each action of ant j, -inf where it is not allowed."""
    for u in range(values.size):
        values[u] = 0.0 if allowed.size == 0 or allowed[j, u] else -np.inf
    if weights is None:
        for u in range(values.size):
            values[u] += weighted_value(table, cells, degrees, u)
    else:
        for c in range(cells.size):
            cell, counts = cells[c], False
            for u in range(values.size):
                counts |= values[u] > -np.inf and weights[cell, u] > 0.0
            for u in range(values.size):
                weight = weights[cell, u] if counts else 1.0
                values[u] += degrees[c] * table[cell, u] * weight


@njit
def best_action(
    table: FloatArray,
    weights: FloatArray | None,
    index: CellArray,
    degree: FloatArray,
    choice: float,
    allowed: BoolArray,
    j: int,
) -> int:
    """The action of ant j with the largest value, for kernels.

    Args:
        table: `(n_cells, n_actions)`.
        weights: what the table is multiplied by, `(n_cells, n_actions)`; None: 1.
            Left out in a cell where it is 0 for all that is allowed.
        index: `(m, k)`.
        degree: `(m, k)`.
        choice: in [0, 1), draws one of the actions that tie.
        allowed: U_q, `(m, n_actions)`; an empty array where every action is allowed.
        j: which of the m ants.
    """
    values = np.empty(table.shape[1])
    cells, degrees = index[j], degree[j]
    _values(table, weights, cells, degrees, allowed, j, values)
    best = -np.inf
    for u in range(values.size):
        if values[u] > best:
            best = values[u]
    if best == -np.inf:  # no value is a number
        return any_action(choice, j, values.size, allowed)
    tied = 0
    for u in range(values.size):
        tied += values[u] == best
    skip = int(choice * tied)
    for u in range(values.size):
        if values[u] == best:
            if skip == 0:
                return u
            skip -= 1
    return 0


@njit
def any_action(choice: float, j: int, n_actions: int, allowed: BoolArray) -> int:
    """One of the actions that ant j may take, all equally likely; choice in [0, 1)."""
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


@njit
def _epsilon_greedy(
    levels: FloatArray,
    weights: FloatArray | None,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    actions: IntArray,
) -> None:
    for j in range(actions.size):
        if draws[0, j] < epsilon:
            actions[j] = any_action(draws[1, j], j, levels.shape[1], allowed)
        else:
            actions[j] = best_action(
                levels, weights, index, degree, draws[1, j], allowed, j
            )


@njit
def _greedy(
    table: FloatArray,
    ranks: RankArray,
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
            value = weighted_value(table, index[j], degree[j], u)
            tied = value == best and action >= 0 and rank[u] < rank[action]
            if action < 0 or value > best or tied:
                best = value
                action = u
        actions[j] = action
