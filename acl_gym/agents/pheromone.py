"""The pheromone that the ants share: its levels, and the two ways they change."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acl_gym.membership import CellArray, FloatArray, IntArray

ActionArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]


class Solutions:
    """The multiset S_trial: what every ant did in one trial.

    Memory is reserved for `max_steps` steps but touched only as far as ants walk.

    Args:
        n_ants: M.
        max_steps: T.
        cells_per_state: k.
    """

    def __init__(self, n_ants: int, max_steps: int, cells_per_state: int) -> None:
        shape = (n_ants, max_steps, cells_per_state)
        self.index: CellArray = np.empty(shape, dtype=np.int32)
        self.degree: FloatArray = np.empty(shape)
        self.action: ActionArray = np.empty(shape[:2], dtype=np.int32)
        self.length: IntArray = np.zeros(n_ants, dtype=np.int64)

    def clear(self) -> None:
        """Forget all solutions."""
        self.length[:] = 0

    def untried(
        self, ants: IntArray, index: CellArray, allowed: BoolArray
    ) -> BoolArray:
        """The tabu list of §3.4.2: no action twice from the same state in a trial.

        Each ant's own partial solution is its list, so that none has to be kept. An
        ant that has tried all that is allowed may choose from all of it again (a
        decision; the thesis is silent).

        Args:
            ants: who chooses, `(m,)`.
            index: their cells, `(m, 1)`.
            allowed: the actions they may take, `(m, n_actions)`.

        Returns:
            Those of `allowed` that the ant has not taken from its cell, `(m,
            n_actions)`.
        """
        left = allowed.copy()
        _strike_tried(ants, index, self.index, self.action, self.length, allowed, left)
        return left

    def append(
        self, ants: IntArray, index: CellArray, degree: FloatArray, actions: IntArray
    ) -> None:
        """Add one state-action pair to the solution of each of `ants`, shape `(m,)`."""
        _append(
            ants,
            index,
            degree,
            actions,
            self.index,
            self.degree,
            self.action,
            self.length,
        )


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
            row; valid where `stale` is False. Selection repairs the rows it needs,
            so that a cell is computed once a step, however many ants are there.
        stale: whether a cell's levels have changed since, `(n_cells,)`.
    """

    def __init__(self, n_cells: int, n_actions: int, tau0: float, alpha: float) -> None:
        self.tau0 = tau0
        self._alpha = alpha
        self.levels: FloatArray = np.full((n_cells, n_actions), tau0)
        self.probabilities: FloatArray = np.empty_like(self.levels)
        self.stale: BoolArray = np.ones(n_cells, dtype=np.bool_)
        # Scratch of the global update: zero between calls.
        self._own: FloatArray = np.zeros(self.levels.size)
        self._deposit: FloatArray = np.zeros(self.levels.size)
        self._union: FloatArray = np.zeros(self.levels.size)
        self._touched: IntArray = np.empty(self.levels.size, dtype=np.int64)
        self._touched_by_ant: IntArray = np.empty(self.levels.size, dtype=np.int64)

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
                index, degree, actions, local_decay, self.tau0, self.levels, self.stale
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
        _deposit(
            solutions.index,
            solutions.degree,
            solutions.action,
            solutions.length,
            deposits,
            global_decay,
            self.levels,
            self.stale,
            self._own,
            self._deposit,
            self._union,
            self._touched,
            self._touched_by_ant,
        )


@njit(cache=True)
def _strike_tried(
    ants: IntArray,
    index: CellArray,
    all_index: CellArray,
    all_action: ActionArray,
    length: IntArray,
    allowed: BoolArray,
    left: BoolArray,
) -> None:
    for j in range(ants.size):
        ant = ants[j]
        count = allowed[j].sum()
        for t in range(length[ant]):
            u = all_action[ant, t]
            if all_index[ant, t, 0] == index[j, 0] and left[j, u]:
                left[j, u] = False
                count -= 1
                if count == 0:
                    # Begin the list of this cell anew: what follows counts again.
                    left[j] = allowed[j]
                    count = allowed[j].sum()


@njit(cache=True)
def _append(
    ants: IntArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    all_index: CellArray,
    all_degree: FloatArray,
    all_action: ActionArray,
    length: IntArray,
) -> None:
    for j in range(ants.size):
        ant = ants[j]
        t = length[ant]
        for c in range(index.shape[1]):
            all_index[ant, t, c] = index[j, c]
            all_degree[ant, t, c] = degree[j, c]
        all_action[ant, t] = actions[j]
        length[ant] = t + 1


@njit(cache=True)
def _decay(
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    local_decay: float,
    tau0: float,
    levels: FloatArray,
    stale: BoolArray,
) -> None:
    for j in range(actions.size):
        action = actions[j]
        for c in range(index.shape[1]):
            if degree[j, c] > 0.0:
                cell = index[j, c]
                # (4.17): written around tau0, a level at tau0 stays there exactly.
                excess = levels[cell, action] - tau0
                levels[cell, action] = (
                    tau0 + (1.0 - local_decay * degree[j, c]) * excess
                )
                stale[cell] = True


@njit(cache=True)
def _deposit(
    index: CellArray,
    degree: FloatArray,
    action: ActionArray,
    length: IntArray,
    laid: FloatArray,
    global_decay: float,
    levels: FloatArray,
    stale: BoolArray,
    own: FloatArray,
    deposit: FloatArray,
    union: FloatArray,
    touched: IntArray,
    touched_by_ant: IntArray,
) -> None:
    """(4.13)-(4.15) over the touched pairs only; leaves the scratch arrays zero."""
    n_actions = levels.shape[1]
    n_touched = 0
    for ant in range(length.size):
        n_own = 0
        for t in range(length[ant]):
            for c in range(index.shape[2]):
                weight = degree[ant, t, c]
                if weight > 0.0:
                    pair = index[ant, t, c] * n_actions + action[ant, t]
                    if own[pair] == 0.0:
                        touched_by_ant[n_own] = pair
                        n_own += 1
                    own[pair] = max(own[pair], weight)
        for i in range(n_own):
            pair = touched_by_ant[i]
            if union[pair] == 0.0:
                touched[n_touched] = pair
                n_touched += 1
            union[pair] = max(union[pair], own[pair])
            deposit[pair] += laid[ant] * own[pair]
            own[pair] = 0.0
    for i in range(n_touched):
        pair = touched[i]
        cell, u = pair // n_actions, pair % n_actions
        kept = (1.0 - global_decay * union[pair]) * levels[cell, u]
        levels[cell, u] = kept + global_decay * deposit[pair]
        stale[cell] = True
        union[pair] = 0.0
        deposit[pair] = 0.0
