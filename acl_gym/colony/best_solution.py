"""The best solution that ants have found, kept from trial to trial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.update_rule import TrialResult
from acl_gym.utils.typing import CellArray, FloatArray, IntArray


class BestSolution:
    """The solution of the lowest cost, as pairs of cell and action.

    Attributes:
        cost: J, infinite before one was found.
        fitness: F, what was deposited for it; 0 before.
        cells: int32 `(r,)`.
        actions: int64 `(r,)`.
        degree: of each pair, `(r,)`; 1 where a state is one cell.
    """

    def __init__(self) -> None:
        self.cost, self.fitness = np.inf, 0.0
        self.cells: CellArray = np.empty(0, np.int32)
        self.actions: IntArray = np.empty(0, np.int64)
        self.degree: FloatArray = np.empty(0)

    @property
    def found(self) -> bool:
        """Whether there is one."""
        return self.cells.size > 0

    def note(self, result: TrialResult) -> bool:
        """Take over the best complete solution of a trial if it is strictly better.

        Returns:
            Whether it is.
        """
        costs = np.where(result.terminated, result.costs, np.inf)
        ant = int(costs.argmin())
        if not costs[ant] < self.cost:
            return False
        self.cost, self.fitness = float(costs[ant]), float(result.deposits[ant])
        self.cells, self.actions, self.degree = _pairs(result.solutions, ant)
        return True

    def check_fits(self, n_cells: int, n_actions: int) -> None:
        """Check that all pairs are of a table: kernels do not.

        Raises:
            ValueError: one is not.
        """
        for name, found, most in (
            ("cells", self.cells, n_cells),
            ("actions", self.actions, n_actions),
        ):
            if found.size and not 0 <= found.min() <= found.max() < most:
                raise ValueError(
                    f"the {name} of the best solution must lie in 0..{most - 1}, got "
                    f"{found.min()} to {found.max()}; the file is damaged."
                )

    def arrays(self, prefix: str) -> dict[str, NDArray[Any]]:
        """What a file holds of it."""
        return {
            f"{prefix}cells": self.cells,
            f"{prefix}actions": self.actions,
            f"{prefix}degree": self.degree,
            f"{prefix}values": np.array([self.cost, self.fitness]),
        }

    @classmethod
    def of_arrays(cls, prefix: str, arrays: Mapping[str, NDArray[Any]]) -> BestSolution:
        """The solution whose `arrays` these are.

        Raises:
            KeyError: one is missing.
            ValueError: they do not fit together.
        """
        names = ("cells", "actions", "degree")
        cells, actions, degree = (arrays[f"{prefix}{name}"] for name in names)
        values = arrays[f"{prefix}values"]
        good = cells.ndim == 1 and cells.shape == actions.shape == degree.shape
        good = good and values.shape == (2,) and values.dtype.kind == "f"
        good = good and cells.dtype.kind == actions.dtype.kind == "i"
        if not (good and degree.dtype.kind == "f" and not np.isnan(values).any()):
            raise ValueError(f"the arrays {prefix}... are not those of a solution")
        solution = cls()
        solution.cost, solution.fitness = map(float, values)
        solution.cells = cells.astype(np.int32)
        solution.actions = actions.astype(np.int64)
        solution.degree = degree.astype(np.float64)
        return solution


def _pairs(solutions: Any, ant: int) -> tuple[CellArray, IntArray, FloatArray]:
    """The pairs of one ant, each once, with its largest degree, in order of first visits."""
    for block in solutions.blocks():
        if not block.ants.start <= ant < block.ants.stop:
            continue
        own = ant - block.ants.start
        rows = slice(int(block.ends[own - 1]) if own else 0, int(block.ends[own]))
        index, degree = block.index[rows], block.degree[rows]
        actions = np.repeat(block.action[rows].astype(np.int64), index.shape[1])
        cells, degrees = index.ravel().copy(), degree.ravel().copy()
        if solutions.may_repeat:
            width = int(actions.max()) + 1
            pairs, first, which = np.unique(
                cells * np.int64(width) + actions,
                return_index=True,
                return_inverse=True,
            )
            most = np.zeros(pairs.size)
            np.maximum.at(most, which, degrees)
            order = np.argsort(first)
            kept = first[order]
            return cells[kept], actions[kept], most[order]
        return cells, actions, degrees
    raise IndexError(f"there is no ant {ant}")  # pragma: no cover - it was found there
