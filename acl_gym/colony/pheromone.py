"""The pheromone that the ants share: its levels, and the two ways they change."""

from __future__ import annotations

import numpy as np
from numba import njit

from acl_gym.colony.solutions import Solutions
from acl_gym.partitions.kernels import written_out
from acl_gym.utils.typing import ActionArray, BoolArray, CellArray, FloatArray, IntArray


class Pheromone:
    """A level tau for each (cell, action), and the probabilities that follow from it.

    Args:
        n_cells: rows of the table.
        n_actions: columns of the table.
        tau0: initial level, > 0.
        alpha: exponent of the selection rule, > 0.

    Attributes:
        levels: tau, `(n_cells, n_actions)`. Change it through `set_levels`.
        probabilities: tau^alpha / sum of tau^alpha over the actions (4.3), row by
            row; valid where `stale` is False. `repair` renews the rows that are
            needed, so that a cell is computed once a step, however many ants are there.
        stale: whether a cell's levels have changed since, `(n_cells,)`.
    """

    def __init__(self, n_cells: int, n_actions: int, tau0: float, alpha: float) -> None:
        self.tau0 = tau0
        self.n_actions = n_actions
        self._alpha = alpha
        self.levels: FloatArray = np.full((n_cells, n_actions), tau0)
        self.probabilities: FloatArray = np.empty_like(self.levels)
        self.stale: BoolArray = np.ones(n_cells, dtype=np.bool_)
        # Scratch of the global update: by pair what `_lay` adds up.
        self._laid: FloatArray = np.zeros((self.levels.size, 4))
        self._touched: IntArray = np.empty(self.levels.size + 1, dtype=np.int64)
        self._interrupted = False  # an update that did not end left the scratch dirty

    @property
    def alpha(self) -> float:
        """The exponent of the selection rule; setting it renews all probabilities."""
        return self._alpha

    @alpha.setter
    def alpha(self, value: float) -> None:
        if value != self._alpha:
            self._alpha = value
            self.stale[:] = True

    def set_levels(self, levels: FloatArray) -> None:
        """Replace all levels."""
        self.levels[:] = levels
        self.stale[:] = True

    def repair(self, index: CellArray) -> None:
        """Renew the probabilities of those of the cells `index` that are stale."""
        _repair(
            self.levels,
            self._alpha,
            index,
            written_out(self.n_actions),
            written_out(index.shape[1]),
            self.probabilities,
            self.stale,
        )

    def local_update(
        self,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Decay the visited pairs towards tau0, (4.12): (1 - gamma beta) each visit.

        Several ants on one pair multiply their factors (4.18), in any order.

        Args:
            index: cells of the ants' states, `(m, k)`.
            degree: their degrees beta, `(m, k)`.
            actions: the actions chosen, `(m,)`.
            local_decay: gamma, in [0, 1).
        """
        if local_decay > 0.0:
            _decay(
                index,
                degree,
                written_out(index.shape[1]),
                actions,
                local_decay,
                self.tau0,
                self.levels,
                self.stale,
            )

    def global_update(
        self, solutions: Solutions, deposits: FloatArray, global_decay: float
    ) -> None:
        """Reinforce along every solution, (4.15).

        Within a solution a pair counts once, with its largest degree (4.13); the
        deposit is summed over ants, the decay weighs with the largest degree over
        all ants (4.14). Cells that no ant visited are not touched.

        Args:
            solutions: S_trial.
            deposits: what each ant lays along its solution, `(n_ants,)`, > 0: in the
                thesis 1 / J.
            global_decay: rho, in [0, 1].

        Raises:
            ValueError: a deposit is not positive and finite.
        """
        with np.errstate(over="ignore"):
            total = deposits.sum()
        valid = np.isfinite(deposits) & (deposits > 0.0)
        if not (valid.all() and np.isfinite(total)):
            ant = int(np.argmin(valid)) if not valid.all() else int(np.argmax(deposits))
            raise ValueError(
                "deposits must be > 0 and their sum finite, got "
                f"{deposits[ant]} for ant {ant}; scale the cost, or check the deposit."
            )
        if self._interrupted:
            self._laid[:] = 0.0
        self._interrupted = True
        n_touched = 0
        for block in solutions.blocks():
            n_touched = _lay(
                block.index,
                block.degree,
                written_out(block.index.shape[1]),
                block.action,
                block.ends,
                block.ants.start,
                deposits[block.ants],
                self._laid,
                self._touched,
                n_touched,
                self.n_actions,
            )
        touched = self._touched[:n_touched]
        _reinforce(touched, self._laid, global_decay, self.levels, self.stale)
        self._interrupted = False


@njit(cache=True, error_model="numpy")
def _repair(
    levels: FloatArray,
    alpha: float,
    index: CellArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    probabilities: FloatArray,
    stale: BoolArray,
) -> None:
    """Compute rows of (4.3). Levels are scaled by the largest: no underflow."""
    n_actions = len(columns) or levels.shape[1]
    whole = int(alpha)
    multiply = whole == alpha and whole <= 8  # cheaper than pow
    for j in range(index.shape[0]):
        for c in range(len(corners) or index.shape[1]):
            cell = np.uint64(index[j, c])  # unsigned: no check for negative indices
            if not stale[cell]:
                continue
            stale[cell] = False
            largest = levels[cell, 0]
            for u in range(1, n_actions):
                largest = max(largest, levels[cell, u])
            total = 0.0
            for u in range(n_actions):
                ratio = levels[cell, u] / largest
                if multiply:
                    weight = ratio
                    for _ in range(1, whole):
                        weight *= ratio
                else:
                    weight = ratio**alpha
                probabilities[cell, u] = weight
                total += weight
            for u in range(n_actions):
                probabilities[cell, u] /= total


@njit(cache=True)
def _decay(
    index: CellArray,
    degree: FloatArray,
    corners: tuple[int, ...],
    actions: IntArray,
    local_decay: float,
    tau0: float,
    levels: FloatArray,
    stale: BoolArray,
) -> None:
    for j in range(actions.size):
        action = np.uint64(actions[j])
        for c in range(len(corners) or index.shape[1]):
            if degree[j, c] > 0.0:
                cell = np.uint64(index[j, c])
                # (4.17): written around tau0, a level at tau0 stays there exactly.
                excess = levels[cell, action] - tau0
                levels[cell, action] = (
                    tau0 + (1.0 - local_decay * degree[j, c]) * excess
                )
                stale[cell] = True


# Columns of what ants have laid on a pair, side by side as they are used together.
_LAST, _DUE, _TOTAL, _LARGEST = range(4)


@njit(cache=True)
def _lay(
    index: CellArray,
    degree: FloatArray,
    corners: tuple[int, ...],
    action: ActionArray,
    ends: IntArray,
    first: int,
    deposits: FloatArray,
    laid: FloatArray,
    touched: IntArray,
    n_touched: int,
    n_actions: int,
) -> int:
    """The sums of (4.14) and (4.15) over some ants and the pairs that they visited.

    Within a solution a pair counts with its largest degree (4.13). So what an ant lays
    on it stays due, and may grow, until another ant comes by; then it is added to the
    total. That takes one look at each visit and no list of the pairs of one ant. Written
    without a branch, which the processor could not guess.

    Args:
        index: cells, the rows of one ant after those of the other, `(r, k)`.
        degree: degrees, `(r, k)`.
        corners: k, written out.
        action: actions, `(r,)`.
        ends: where the rows of each ant end, `(b,)`.
        first: the number of the first of these ants.
        deposits: what each ant lays, `(b,)`, > 0.
        laid: by pair, the last ant that was there, what is due from it, the total of
            those before it, the largest degree so far; added to, and but for the ant
            zero at first.
        touched: the pairs visited so far with a degree > 0, and room for one; added to.
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
                new = laid[pair, _LAST] != ant
                due, largest = laid[pair, _DUE], laid[pair, _LARGEST]
                laid[pair, _LAST] = ant
                laid[pair, _TOTAL] += due if new else 0.0
                laid[pair, _DUE] = max(0.0 if new else due, deposit * weight)
                laid[pair, _LARGEST] = max(largest, weight)
                touched[count] = pair
                count += np.uint64((largest == 0.0) & (weight > 0.0))
            row += np.uint64(1)
    return int(count)


@njit(cache=True)
def _reinforce(
    touched: IntArray,
    laid: FloatArray,
    global_decay: float,
    levels: FloatArray,
    stale: BoolArray,
) -> None:
    """(4.15) on the touched pairs; leaves `laid` zero but for the ants."""
    n_actions = levels.shape[1]
    for pair in touched:
        cell, u = pair // n_actions, pair % n_actions
        deposit = laid[pair, _TOTAL] + laid[pair, _DUE]
        kept = (1.0 - global_decay * laid[pair, _LARGEST]) * levels[cell, u]
        levels[cell, u] = kept + global_decay * deposit
        stale[cell] = True
        laid[pair, 1:] = 0.0
