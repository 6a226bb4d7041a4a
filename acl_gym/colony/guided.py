"""Epsilon-greedy choices that are led by a heuristic where levels leave the choice open.

The levels of the ants that return promise returns of any sign, so that a product
tau^alpha eta^beta means nothing there. Prior knowledge leads these ants in another way:
it decides what they try, not what they expect of it.
"""

from __future__ import annotations

import numpy as np

from acl_gym.colony.greedy import ALL, check_choice, drawn_numbers
from acl_gym.colony.heuristic import to_the_power
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


def shares_of(heuristic: FloatArray, beta: float) -> FloatArray:
    """The probability with which each cell proposes each action: eta^beta / its sum.

    Eq. (4.3) with eta in place of tau. An action with eta = 0 is never proposed, also
    with beta = 0.

    Args:
        heuristic: eta, `(n_cells, n_actions)`, >= 0 and positive somewhere in each row.
        beta: its exponent, >= 0.

    Returns:
        `(n_cells, n_actions)`; each row sums to 1.
    """
    powers = to_the_power(heuristic, beta)
    return np.asarray(powers / powers.sum(axis=1, keepdims=True))


def guided_actions(
    shares: FloatArray,
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    epsilon: float | FloatArray,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
) -> IntArray:
    """Choose an action for each state: the one of largest value, or one to explore.

    With probability epsilon any allowed action, else one of those whose degree-weighted
    value is the largest, as in `epsilon_greedy_actions`. Where several actions remain,
    one is drawn in proportion to the degree-weighted mean of their `shares`, as the ants
    of `ACL` draw by eq. (4.11); all are equally likely where no cell proposes any of
    them.

    Args:
        shares: `(n_cells, n_actions)`, see `shares_of`.
        table: `(n_cells, n_actions)`, values of any sign.
        index: cells of the states, `(n, k)`.
        degree: their degrees, `(n, k)`.
        epsilon: probability of exploration, in [0, 1], of all states or of each, `(n,)`.
        rng: two uniform numbers are drawn for each state: a coin and a choice.
        allowed: the actions to choose from, `(n, n_actions)`, at least one for each
            state; None: all.

    Returns:
        Indices of actions, `(n,)`.

    Raises:
        ValueError: a shape or type is wrong, or a cell is not one of the table.
    """
    check_choice(index, degree, table, allowed)
    if shares.shape != table.shape:
        raise ValueError(
            f"shares must have the shape of the table, {table.shape}, got "
            f"{shares.shape}."
        )
    return guided_unchecked(shares, table, index, degree, epsilon, rng, allowed)


def guided_unchecked(
    shares: FloatArray,
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    epsilon: float | FloatArray,
    rng: np.random.Generator,
    allowed: BoolArray | None = None,
) -> IntArray:
    """`guided_actions` for cells that `locate_checked` has found for the table."""
    count = len(index)
    draws = drawn_numbers(rng, count)
    explores = draws[0] < epsilon
    actions = np.empty(count, np.int64)
    any_action = ALL if allowed is None else allowed
    _guided(shares, table, index, degree, explores, draws[1], any_action, actions)
    return actions


@njit
def _guided(
    shares: FloatArray,
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    explores: BoolArray,
    choices: FloatArray,
    allowed: BoolArray,
    actions: IntArray,
) -> None:
    n_actions = table.shape[1]
    values, proposed = np.empty(n_actions), np.empty(n_actions)
    for j in range(actions.size):
        best = -np.inf
        for u in range(n_actions):
            values[u] = -np.inf
            if allowed.size == 0 or allowed[j, u]:
                values[u] = 0.0
                for c in range(index.shape[1]):
                    values[u] += degree[j, c] * table[index[j, c], u]
                best = max(best, values[u])
        total = 0.0
        for u in range(n_actions):
            proposed[u] = -1.0  # not to be chosen
            may = allowed.size == 0 or allowed[j, u]
            if may and (explores[j] or values[u] == best or best == -np.inf):
                proposed[u] = 0.0
                for c in range(index.shape[1]):
                    proposed[u] += degree[j, c] * shares[index[j, c], u]
                total += proposed[u]
        if total == 0.0:  # no cell proposes any of them
            for u in range(n_actions):
                proposed[u] += 1.0
                total += proposed[u]
        left = choices[j] * total
        action = 0
        for u in range(n_actions):
            if proposed[u] > 0.0:
                action = u  # the last one takes what rounding leaves
                left -= proposed[u]
                if left < 0.0:
                    break
        actions[j] = action
