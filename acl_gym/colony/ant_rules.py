"""The update rules of Ant Colony Optimization, chapter 2 of the thesis.

Ant System (§2.5.1), Ant Colony System (§2.5.2) and Max-Min Ant System (Stützle and Hoos,
2000), as update rules of a colony like any other: `ACL(env, update=AntSystemUpdate())`
works too. F(s) is what an ant deposits, by default 1 / J.

A candidate solution is what an ant has done when it has reached a terminal state, as
§2.4.2 has it. Ants that were stopped before deposit nothing.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.ant_kernels import (
    LEAST_LEVEL,
    add_deposits,
    branching_factor,
    choose_in_turn,
    evaporate,
    limit,
    mix_in,
)
from acl_gym.colony.best_solution import BestSolution
from acl_gym.colony.candidates import NONE
from acl_gym.colony.greedy import ALL, check_choice, drawn_numbers
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.tours import build_tours, build_tours_in_turn, weigh_candidates
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
        self._check_fits(pheromone)
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

    def _check_fits(self, pheromone: Pheromone) -> None:
        """Refuse what kernels, which do not check indices, must not see."""
        n_cells, n_actions = pheromone.levels.shape
        if self.symmetric and n_cells != n_actions:
            raise ValueError(
                "symmetric needs an action for each cell, which leads there, got "
                f"{n_cells} cells and {n_actions} actions; set symmetric=False."
            )
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


@dataclass
class AntSystemUpdate(AntRule):
    """Ant System: evaporation on all pairs, then deposits of the update set, (2.3)-(2.4).

    Attributes:
        update_set: one of `UPDATE_SETS`.
        elitists: e of the elitist Ant System: the best solution so far deposits so many
            times its fitness in addition, >= 0. Dorigo et al. (1996) take as many as
            there are ants.
        ranks: w of the rank-based Ant System (Bullnheimer, Hartl and Strauss, 1999): of
            the solutions of the trial only the w - 1 best deposit, the best w - 1 times,
            the next w - 2 times its fitness, and so on; the best so far w times. 6 is
            usual, and 0 means no ranks. In place of `update_set` and `elitists`.
        symmetric: a component and its reverse have the same level.
    """

    update_set: str = "trial"
    elitists: float = 0.0
    ranks: int = 0
    symmetric: bool = False

    def __post_init__(self) -> None:
        validation.one_of("update_set", self.update_set, UPDATE_SETS)
        self.elitists = validation.number("elitists", self.elitists, at_least=0)
        self.ranks = validation.integer("ranks", self.ranks, at_least=0)
        _check_flag("symmetric", self.symmetric)
        if self.ranks and (self.elitists or self.update_set != "trial"):
            raise ValueError(
                "ranks must stand alone, got elitists="
                f"{self.elitists:g} and update_set={self.update_set!r} as well; leave "
                "these out."
            )

    def initial_level(self, fitness: float, steps: int, ants: int, rho: float) -> float:
        """m / L_nn, and with elitists or ranks what Dorigo and Stützle (2004) give."""
        rho = max(rho, LEAST_LEVEL)
        if self.ranks:
            return max(0.5 * self.ranks * (self.ranks - 1), 1.0) * fitness / rho
        if self.elitists:
            return (self.elitists + ants) * fitness / rho
        return ants * fitness

    def _update(
        self, pheromone: Pheromone, result: TrialResult, global_decay: float
    ) -> None:
        evaporate(pheromone.levels, global_decay, LEAST_LEVEL)
        amounts, of_best = self._amounts(result)
        self._deposit(pheromone, result, amounts)
        self._deposit_of(pheromone, self.best, of_best * self.best.fitness)
        pheromone.stale[:] = True

    def _amounts(self, result: TrialResult) -> tuple[FloatArray, float]:
        """What each ant deposits, `(m,)`, and how often the best so far does."""
        complete = np.flatnonzero(result.terminated)
        amounts, of_best = np.zeros(result.deposits.size), self.elitists
        if self.ranks:
            order = np.argsort(result.costs[complete], kind="stable")
            first = complete[order[: self.ranks - 1]]
            shares = self.ranks - 1.0 - np.arange(first.size)
            amounts[first] = shares * result.deposits[first]
            of_best = float(self.ranks)
        elif self.update_set == "trial":
            amounts[complete] = result.deposits[complete]
        elif self.update_set == "trial-best" and complete.size:
            ant = complete[result.costs[complete].argmin()]
            amounts[ant] = result.deposits[ant]
        elif self.update_set == "best-so-far":
            of_best += 1.0
        return amounts, of_best


@dataclass
class AntColonySystemUpdate(AntRule):
    """Ant Colony System (Dorigo and Gambardella, 1997): (2.5), (2.6) and the rule q0.

    Attributes:
        q0: the probability to EXPLOIT, in [0, 1]: to take the best action. It is the
            epsilon of §2.5.2, which is the opposite of epsilon everywhere else in the
            thesis and in this package, the probability to explore.
        update_set: "best-so-far", as (2.5) has it, or "trial-best".
        symmetric: a component and its reverse have the same level.
    """

    q0: float = 0.9
    update_set: str = "best-so-far"
    symmetric: bool = False

    def __post_init__(self) -> None:
        self.q0 = validation.number("q0", self.q0, at_least=0, at_most=1)
        validation.one_of("update_set", self.update_set, UPDATE_SETS[1:])
        _check_flag("symmetric", self.symmetric)

    @property
    def exploitation(self) -> float:
        """See `AntRule`."""
        return self.q0

    @property
    def decays_on_the_way(self) -> bool:
        """See `AntRule`."""
        return True

    def build(
        self,
        pheromone: Pheromone,
        starts: IntArray,
        draws: FloatArray,
        lists: CellArray,
        local_decay: float,
        tours: CellArray,
    ) -> None:
        """See `AntRule`; each ant's arc decays before the next ant chooses."""
        build_tours_in_turn(
            starts,
            draws,
            lists,
            pheromone.levels,
            pheromone.alpha,
            pheromone.weights,
            pheromone.greedy_weights,
            self.q0,
            local_decay,
            pheromone.tau0,
            self.symmetric,
            pheromone.stale,
            tours,
        )

    def initial_level(self, fitness: float, steps: int, ants: int, rho: float) -> float:
        """1 / (n L_nn)."""
        return fitness / steps

    def _update(
        self, pheromone: Pheromone, result: TrialResult, global_decay: float
    ) -> None:
        solution = self.best
        if self.update_set == "trial-best":
            solution = BestSolution()
            solution.note(result)
        if solution.found:
            mix_in(
                solution.cells,
                solution.degree,
                solution.actions,
                global_decay,
                solution.fitness,
                self.symmetric,
                pheromone.levels,
                pheromone.stale,
            )


@dataclass
class MaxMinUpdate(AntRule):
    """Max-Min Ant System (Stützle and Hoos, 2000): one solution deposits, within limits.

    After evaporation on all pairs (2.3) only the best solution of the trial or one of
    the best so far deposits, and levels are kept within [tau_min, tau_max]: tau_max =
    F / rho of the best solution so far, the limit of Proposition 2.2, and tau_min such
    that ants that have converged construct the best solution with probability p_best:
    tau_min = tau_max (1 - p) / ((choices / 2 - 1) p) with p = p_best^(1 / n), where
    choices is how many actions a cell has, or candidates.

    Where the ants all follow one solution, by the lambda-branching factor, levels are
    moved towards tau_max.

    Attributes:
        update_set: "trial-best"; "best-so-far"; or "mixed": the best solution since the
            last restart in every u-th trial, else the best of the trial. u falls with
            the trials since the restart, see `_MIXED`; where u is 1 and the solution is
            older than 50 trials, the best solution of all is taken.
        p_best: in (0, 1); None: tau_min = tau_max / (2 n), which is usual with local
            search.
        smoothing: delta, in [0, 1]: where the ants have converged, each level moves by
            this share of its distance to tau_max. 1 is a restart, which also forgets the
            best solution since the last one; 0 does nothing.
        patience: how many trials after a restart the next one may come, >= 0.
        symmetric: a component and its reverse have the same level.

    Attributes that are no parameters:
        since_restart: the best solution since the last restart.
        restarts: how often levels were moved.
    """

    update_set: str = "trial-best"
    p_best: float | None = 0.05
    smoothing: float = 1.0
    patience: int = 250
    symmetric: bool = False

    def __post_init__(self) -> None:
        sets = (*UPDATE_SETS[1:], "mixed")
        validation.one_of("update_set", self.update_set, sets)
        if self.p_best is not None:
            self.p_best = validation.number("p_best", self.p_best, above=0, below=1)
        self.smoothing = validation.number(
            "smoothing", self.smoothing, at_least=0, at_most=1
        )
        self.patience = validation.integer("patience", self.patience, at_least=0)
        _check_flag("symmetric", self.symmetric)
        self._forget()

    def _forget(self) -> None:
        self.since_restart = BestSolution()
        self.restarts = 0
        # Trials since the last restart, and since its best solution was found.
        self._trials, self._age = 0, 0

    def initial_level(self, fitness: float, steps: int, ants: int, rho: float) -> float:
        """tau_max = 1 / (rho L_nn)."""
        return fitness / max(rho, LEAST_LEVEL)

    def limits(self, n_actions: int, rho: float) -> tuple[float, float]:
        """tau_min and tau_max by the best solution so far.

        Args:
            n_actions: columns of the table.
            rho: the evaporation rate, > 0.
        """
        most, n = self.best.fitness / rho, self.best.cells.size
        if self.p_best is None:
            return most / (2.0 * n), most
        choices = self.candidates.shape[1] if self.candidates.size else n_actions
        p = self.p_best ** (1.0 / n)
        # With three choices or fewer the formula has no meaning.
        least = most * (1.0 - p) / (max(choices / 2.0 - 1.0, 1.0) * p)
        return min(least, most), most

    def _update(
        self, pheromone: Pheromone, result: TrialResult, global_decay: float
    ) -> None:
        self._trials += 1
        self._age = 0 if self.since_restart.note(result) else self._age + 1
        if not self.best.found:
            evaporate(pheromone.levels, global_decay, LEAST_LEVEL)
            pheromone.stale[:] = True
            return
        levels = pheromone.levels
        least, most = self.limits(pheromone.n_actions, max(global_decay, LEAST_LEVEL))
        evaporate(levels, global_decay, least)
        solution = self._depositor(result)
        self._deposit_of(pheromone, solution, solution.fitness)
        limit(levels, least, most)
        if self._trials > self.patience and self._converged(levels):
            levels += self.smoothing * (most - levels)
            self.restarts += 1
            self._trials = self._age = 0
            if self.smoothing == 1.0:
                self.since_restart = BestSolution()
        pheromone.stale[:] = True

    def _depositor(self, result: TrialResult) -> BestSolution:
        """The solution that deposits in this trial."""
        if self.update_set == "best-so-far":
            return self.best
        if self.update_set == "mixed":
            every = next(u for trials, u in _MIXED if self._trials <= trials)
            if every == 1 and self._age > _OLD:
                return self.best
            if self._trials % every == 0 and self.since_restart.found:
                return self.since_restart
        solution = BestSolution()
        solution.note(result)
        return solution

    def _converged(self, levels: FloatArray) -> bool:
        """Whether all ants all but surely follow one solution."""
        fewest = 2.0 if self.symmetric else 1.0
        if self.smoothing == 0.0:
            return False
        return branching_factor(levels, self.candidates) <= fewest * _CONVERGED

    def memory(self) -> dict[str, NDArray[Any]]:
        """The best solutions, and how many trials ago what happened."""
        counts = np.array([self._trials, self._age, self.restarts])
        of_restart = self.since_restart.arrays("restart_")
        return {**super().memory(), **of_restart, "counts": counts}

    def restore(self, memory: dict[str, NDArray[Any]]) -> None:
        """Take over what `memory` gave."""
        super().restore(memory)
        self.since_restart = BestSolution.of_arrays("restart_", memory)
        self._restored.append(self.since_restart)
        counts = memory["counts"]
        if counts.shape != (3,) or counts.dtype.kind != "i" or (counts < 0).any():
            raise ValueError("counts must be three integers >= 0")
        self._trials, self._age, self.restarts = map(int, counts)


_MIXED = ((25, 25), (75, 5), (125, 3), (250, 2), (np.inf, 1))
"""Up to how many trials since the restart the best since then deposits every how often
(Stützle and Hoos, 2000, who choose it for colonies with local search)."""

_OLD = 50
"""Trials after which, with u = 1, the best solution of all deposits."""

_CONVERGED = 1.00001
"""How many times the least branching factor counts as converged."""

ANT_RULES = (AntSystemUpdate, AntColonySystemUpdate, MaxMinUpdate)
"""The rules of chapter 2."""


def _check_flag(name: str, value: Any) -> None:
    if not isinstance(value, bool):
        raise TypeError(f"{name} must be True or False, got {validation.shown(value)}.")
