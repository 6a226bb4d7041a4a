"""What the update rules of Ant Colony Optimization share."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.ant_kernels import (
    add_deposits,
    choose_in_turn,
)
from acl_gym.colony.best_solution import BestSolution
from acl_gym.colony.candidates import NONE
from acl_gym.colony.city_choice import weigh_candidates
from acl_gym.colony.greedy import ALL, check_choice, drawn_numbers
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.tours import build_tours
from acl_gym.colony.update_rule import TrialResult, UpdateRule
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

UPDATE_SETS = ("trial", "trial-best", "best-so-far")
"""S_upd (§2.5.1): all solutions of a trial, the best of them, or the best of all trials."""


class AntRule(UpdateRule):
    """What the rules of chapter 2 share: how ants choose, and the best solution so far.

    Attributes:
        best: the best solution since the beginning; `best.found` is False before.
        candidates: the actions that ants look at first in each cell, `(n_cells, k)`,
            see `candidate_lists`; empty where all are.
    """

    symmetric: bool
    candidates: CellArray = NONE

    @property
    def best(self) -> BestSolution:
        """The best solution since the beginning."""
        if (
            "_best" not in self.__dict__
        ):  # the fields of dataclasses are parameters only
            self._best = BestSolution()
        return self._best

    @property
    def solutions(self) -> list[BestSolution]:
        """All that are remembered."""
        return [self.best]

    def forget(self) -> None:
        """Forget all solutions: those of another task mean nothing."""
        self._best = BestSolution()
        self._restored.clear()

    def parameters(self) -> dict[str, Any]:
        """What the rule was made with, by name."""
        rule: Any = self  # each rule is a dataclass
        return {each.name: getattr(self, each.name) for each in fields(rule)}

    def change(self, name: str, value: Any) -> None:
        """Change a parameter from the next trial on; what is remembered stays.

        Args:
            name: of the parameter.
            value: checked as in the constructor, also against the other parameters.
        """
        rule: Any = self
        setattr(self, name, getattr(replace(rule, **{name: value}), name))

    @property
    def exploitation(self) -> float:
        """The probability to take the best action instead of drawing one."""
        return 0.0

    @property
    def decays_on_the_way(self) -> bool:
        """Whether there is a local update."""
        return False

    def choose(
        self,
        selection: str,
        pheromone: Pheromone,
        index: CellArray,
        degree: FloatArray,
        epsilon: float,
        rng: np.random.Generator,
        allowed: BoolArray | None,
        local_decay: float,
    ) -> IntArray:
        """Choose by (2.2), or by the pseudo-random-proportional rule of §2.5.2.

        Ant by ant, each followed by its local update where the rule has one. These
        algorithms have no exploration of their own, so `selection` and `epsilon` are not
        used.
        """
        self.check_fits(pheromone)
        check_choice(index, degree, pheromone.levels, allowed)
        actions = np.empty(len(index), dtype=np.int64)
        choose_in_turn(
            pheromone.levels,
            pheromone.alpha,
            pheromone.weights,
            pheromone.greedy_weights,
            index,
            degree,
            drawn_numbers(rng, len(index)),
            self.exploitation,
            ALL if allowed is None else allowed,
            self.candidates,
            local_decay if self.decays_on_the_way else 0.0,
            pheromone.tau0,
            self.symmetric,
            pheromone.stale,
            actions,
        )
        return actions

    def local_update(
        self,
        pheromone: Pheromone,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Do nothing: pairs decay at the end of the trial, or when the ants choose."""

    def build(
        self,
        pheromone: Pheromone,
        starts: IntArray,
        draws: FloatArray,
        lists: CellArray,
        local_decay: float,
        tours: CellArray,
    ) -> None:
        """Let all ants build their tours at once, as `choose` would step by step.

        Args:
            pheromone: the shared table, `(n, n)`.
            starts: the first city of each ant, `(m,)`.
            draws: uniform in [0, 1), `(n, 2, m)`, what `choose` draws in n steps.
            lists: the candidates of each city, `(n, k)`, each row ascending; all cities
                where `candidates` is empty.
            local_decay: gamma of (2.6), in [0, 1).
            tours: receives the tours, int32 `(m, n)`.
        """
        self.check_fits(pheromone)
        weighed = np.empty(lists.shape)
        alpha, weights = pheromone.alpha, pheromone.weights
        weigh_candidates(pheromone.levels, alpha, weights, lists, weighed)
        build_tours(
            starts,
            draws,
            lists,
            weighed,
            pheromone.levels,
            alpha,
            weights,
            pheromone.greedy_weights,
            tours,
        )

    def global_update(
        self,
        pheromone: Pheromone,
        result: TrialResult,
        local_decay: float,
        global_decay: float,
    ) -> None:
        """Note the best solution, evaporate and deposit."""
        self.check_fits(pheromone)
        self.best.note(result)
        self._update(pheromone, result, global_decay)

    @abstractmethod
    def _update(
        self, pheromone: Pheromone, result: TrialResult, global_decay: float
    ) -> None:
        """Evaporate and deposit."""

    @abstractmethod
    def initial_level(self, fitness: float, steps: int, ants: int, rho: float) -> float:
        """tau_0 by the formula of the literature.

        Args:
            fitness: F of a solution that is easily found, 1 / L_nn.
            steps: n, how many components it has.
            ants: m.
            rho: the evaporation rate.
        """

    def check_fits(self, pheromone: Pheromone) -> None:
        """Refuse what kernels, which do not check indices, must not see."""
        n_cells, n_actions = pheromone.levels.shape
        if self.symmetric and n_cells != n_actions:
            raise ValueError(
                "symmetric needs an action for each cell, which leads there, got "
                f"{n_cells} cells and {n_actions} actions; set symmetric=False."
            )
        lists = self.candidates
        if lists is not self.__dict__.get("_checked_candidates"):
            fit = lists.size == 0 or (
                lists.ndim == 2
                and len(lists) == n_cells
                and lists.dtype == np.int32
                and 0 <= lists.min() <= lists.max() < n_actions
            )
            if not fit:
                raise ValueError(
                    "candidates must be int32 numbers of actions, a row for each of "
                    f"{n_cells} cells, all below {n_actions}, got "
                    f"{validation.shown(lists)}."
                )
            self._checked_candidates = lists
        while self._restored:
            self._restored.pop().check_fits(n_cells, n_actions)

    @property
    def _restored(self) -> list[BestSolution]:
        """Solutions from a file that have not been held against the table yet."""
        found: list[BestSolution] = self.__dict__.setdefault("_unchecked", [])
        return found

    def _deposit(
        self, pheromone: Pheromone, result: TrialResult, amounts: FloatArray
    ) -> None:
        """Add what the ants of the trial deposit, `amounts`, `(m,)`."""
        noted: FloatArray = np.empty((0, 2))
        if result.solutions.may_repeat:
            noted = np.zeros((pheromone.levels.size, 2))
            noted[:, 0] = -1.0
        for block in result.solutions.blocks():
            add_deposits(
                block.index,
                block.degree,
                block.action,
                block.ends,
                block.ants.start,
                amounts[block.ants],
                self.symmetric,
                noted,
                pheromone.levels,
            )

    def _deposit_of(
        self, pheromone: Pheromone, solution: BestSolution, amount: float
    ) -> None:
        """Add what is deposited along one solution that is remembered."""
        if solution.found and amount > 0.0:
            add_deposits(
                solution.cells[:, None],
                solution.degree[:, None],
                solution.actions,
                np.array([solution.cells.size]),
                0,
                np.array([amount]),
                self.symmetric,
                np.empty((0, 2)),
                pheromone.levels,
            )

    def memory(self) -> dict[str, NDArray[Any]]:
        """The best solution so far."""
        return self.best.arrays("best_")

    def restore(self, memory: dict[str, NDArray[Any]]) -> None:
        """Take over what `memory` gave."""
        self._best = BestSolution.of_arrays("best_", memory)
        self._restored.append(self._best)
