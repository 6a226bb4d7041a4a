"""The pheromone that the ants share: its levels, and the probabilities they give."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.colony.greedy import cells_out_of_range
from acl_gym.colony.heuristic import checked_heuristic, to_the_power
from acl_gym.partitions.kernels import written_out
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


class Pheromone(Fixed):
    """A level tau for each (cell, action), and the probabilities that follow from it.

    Args:
        n_cells: rows of the table.
        n_actions: columns of the table.
        tau0: initial level, > 0.
        alpha: exponent of the levels in the selection rule, > 0.
        heuristic: eta, `(n_cells, n_actions)`, finite, >= 0 and positive somewhere in
            each row; None: 1 everywhere.
        beta: exponent of eta in the selection rule, >= 0.

    Attributes:
        levels: tau, `(n_cells, n_actions)`, > 0 and finite. Change it through
            `set_levels`, or in place, and then mark the cells changed in `stale`.
        probabilities: w / (sum of w over the actions), w = tau^alpha eta^beta (4.3),
            row by row; valid where `stale` is False. `repair` renews the rows that are
            needed, so that a cell is computed once per step for all ants.
        stale: whether the levels of a cell have changed since, `(n_cells,)`.

    Raises:
        TypeError: an argument is not a number.
        ValueError: an argument is out of range.
    """

    # The arrays may change, but not be replaced: kernels rely on their shapes and types.
    _fixed = ("levels", "probabilities", "stale", "tau0", "n_actions")

    def __init__(
        self,
        n_cells: int,
        n_actions: int,
        tau0: float,
        alpha: float,
        heuristic: FloatArray | None = None,
        beta: float = 1.0,
    ) -> None:
        n_cells = validation.integer("n_cells", n_cells, at_least=1)
        self.n_actions = validation.integer("n_actions", n_actions, at_least=1)
        self.tau0 = validation.number("tau0", tau0, above=0)
        self._alpha = validation.number("alpha", alpha, above=0)
        self._beta = validation.number("beta", beta, at_least=0)
        self.levels: FloatArray = np.full((n_cells, n_actions), self.tau0)
        self.probabilities: FloatArray = np.empty_like(self.levels)
        self.stale: BoolArray = np.ones(n_cells, dtype=np.bool_)
        self._heuristic: FloatArray | None = None
        if heuristic is not None:
            self._heuristic = checked_heuristic(heuristic, self.levels.shape)
        self._weights: FloatArray | None = None
        self._greedy_weights: FloatArray | None = None

    @property
    def alpha(self) -> float:
        """The exponent of the levels; setting it renews all probabilities."""
        return self._alpha

    @alpha.setter
    def alpha(self, value: float) -> None:
        if value != self._alpha:
            self._alpha = validation.number("alpha", value, above=0)
            self._greedy_weights = None
            self.stale[:] = True

    @property
    def beta(self) -> float:
        """The exponent of the heuristic; setting it renews all probabilities."""
        return self._beta

    @beta.setter
    def beta(self, value: float) -> None:
        if value != self._beta:
            self._beta = validation.number("beta", value, at_least=0)
            self._weights = self._greedy_weights = None
            self.stale[:] = True

    @property
    def heuristic(self) -> FloatArray | None:
        """The heuristic eta, `(n_cells, n_actions)`; None: 1 everywhere."""
        return self._heuristic

    @heuristic.setter
    def heuristic(self, value: FloatArray | None) -> None:
        if value is not None:
            value = checked_heuristic(value, self.levels.shape)
        self._heuristic = value
        self._weights = self._greedy_weights = None
        self.stale[:] = True

    @property
    def weights(self) -> FloatArray | None:
        """What tau^alpha is multiplied by: eta^beta, each row divided by its largest.

        The scale of a row has no effect, because actions are compared within a cell.
        """
        if self._heuristic is not None and self._weights is None:
            self._weights = to_the_power(self._heuristic, self._beta)
        return self._weights

    @property
    def greedy_weights(self) -> FloatArray | None:
        """What tau is multiplied by to find the best action: eta^(beta / alpha).

        Each row is divided by its largest, as in `weights`, with which they share their
        memory where alpha is 1.
        """
        if self._alpha == 1.0:
            return self.weights
        if self._heuristic is not None and self._greedy_weights is None:
            exponent = self._beta / self._alpha
            self._greedy_weights = to_the_power(self._heuristic, exponent)
        return self._greedy_weights

    def set_tau0(self, tau0: float, everywhere: bool) -> None:
        """Set the initial level, where it was not known before.

        Args:
            tau0: > 0.
            everywhere: give all pairs that level.
        """
        self.__dict__["tau0"] = validation.number("tau0", tau0, above=0)
        if everywhere:
            self.levels.fill(self.tau0)
            self.stale[:] = True

    def set_levels(self, levels: ArrayLike, name: str = "levels") -> None:
        """Replace all levels.

        Args:
            levels: > 0 and finite, in the shape of the table.
            name: what error messages call them.

        Raises:
            ValueError: they do not have the shape of the table, or are not all > 0 and
                finite.
        """
        values = validation.real_array(name, levels)
        if values.shape != self.levels.shape:
            raise ValueError(
                f"{name} must have shape {self.levels.shape}, got {values.shape}."
            )
        if not (values > 0.0).all():
            raise ValueError(
                f"{name} must be positive everywhere, got {values.min():g}."
            )
        self.levels[:] = values
        self.stale[:] = True

    def check_levels(self) -> None:
        """Check that all levels are > 0 and finite, which in-place changes may spoil.

        Raises:
            ValueError: one is not.
        """
        valid = np.isfinite(self.levels) & (self.levels > 0.0)
        if not valid.all():
            cell, u = np.argwhere(~valid)[0]
            raise ValueError(
                "levels must stay > 0 and finite, got "
                f"{self.levels[cell, u]} for action {u} in cell {cell}; check the update "
                "rule, or scale the cost."
            )

    def repair(self, index: CellArray) -> None:
        """Renew the probabilities of those of the cells `index` that are stale.

        Raises:
            ValueError: a cell is not one of the table.
        """
        good = repair(
            self.levels,
            self._alpha,
            self.weights,
            index,
            written_out(self.n_actions),
            written_out(index.shape[1]),
            self.probabilities,
            self.stale,
        )
        if not good:
            raise cells_out_of_range(index, len(self.levels))


_WHOLE = 8
"""Powers up to this are products, which are cheaper than `pow`."""


@njit(inline="always")
def whole_exponent(alpha: float) -> int:
    """Alpha, where powers are to be products; else 0."""
    whole = int(min(alpha, _WHOLE + 1.0))  # what no integer holds would be anything
    return whole if whole == alpha and whole <= _WHOLE else 0


@njit(error_model="numpy")
def repair(
    levels: FloatArray,
    alpha: float,
    weights: FloatArray | None,
    index: CellArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    probabilities: FloatArray,
    stale: BoolArray,
) -> bool:
    """Compute the selection probabilities, eq. (4.3), of the stale cells in `index`.

    Levels are scaled by the largest of their cell: no underflow. Returns False where a
    cell is not one of the table.
    """
    n_actions = len(columns) or levels.shape[1]
    whole = whole_exponent(alpha)
    for j in range(index.shape[0]):
        for c in range(len(corners) or index.shape[1]):
            cell = np.uint64(index[j, c])  # unsigned: negative ones become huge
            if cell >= np.uint64(stale.size):
                return False
            if not stale[cell]:
                continue
            stale[cell] = False
            if weights is None:
                largest = levels[cell, 0]
                for u in range(1, n_actions):
                    largest = max(largest, levels[cell, u])
            else:
                largest = 0.0
                for u in range(n_actions):
                    if weights[cell, u] > 0.0:
                        largest = max(largest, levels[cell, u])
            total = 0.0
            for u in range(n_actions):
                ratio = levels[cell, u] / largest
                if weights is not None and weights[cell, u] == 0.0:
                    ratio = 0.0  # above 1 it could overflow below
                if whole > 0:
                    weight = ratio
                    for _ in range(1, whole):
                        weight *= ratio
                else:
                    weight = ratio**alpha
                if weights is not None:
                    weight *= weights[cell, u]
                probabilities[cell, u] = weight
                total += weight
            for u in range(n_actions):
                probabilities[cell, u] /= total
    return True


@njit
def mean_sensitivity(levels: FloatArray, policy: IntArray, alpha: float) -> float:
    """How near the second-best action comes to the policy's (3.48), mean over cells.

    A function of the pheromone alone, whatever heuristic the ants weigh it with.

    Args:
        levels: `(n_cells, n_actions)`.
        policy: the action of each cell, `(n_cells,)`.
        alpha: exponent of the levels, > 0.
    """
    total = 0.0
    for cell in range(levels.shape[0]):
        second = 0.0
        for u in range(levels.shape[1]):
            if u != policy[cell]:
                second = max(second, levels[cell, u])
        total += (second / levels[cell, policy[cell]]) ** alpha
    return float(total / levels.shape[0])
