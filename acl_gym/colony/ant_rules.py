"""The update rules of Ant Colony Optimization, chapter 2 of the thesis.

Ant System (§2.5.1), Ant Colony System (§2.5.2) and Max-Min Ant System (Stützle and Hoos,
2000), as update rules of a colony like any other: `ACL(env, update=AntSystemUpdate())`
works too. F(s) is what an ant deposits, by default 1 / J.

A candidate solution is what an ant has done when it has reached a terminal state, as
§2.4.2 has it. Ants that were stopped before deposit nothing. In an asynchronous colony
each group of ants that come back together counts as a trial.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.ant_kernels import (
    LEAST_LEVEL,
    branching_factor,
    evaporate,
    limit,
    mix_in,
)
from acl_gym.colony.ant_rule import UPDATE_SETS, AntRule
from acl_gym.colony.best_solution import BestSolution
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.tours import build_tours_in_turn
from acl_gym.colony.update_rule import TrialResult
from acl_gym.utils import validation
from acl_gym.utils.typing import CellArray, FloatArray, IntArray


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
        self.symmetric = validation.boolean("symmetric", self.symmetric)
        others = {}
        if self.elitists:
            others["elitists"] = f"elitists={self.elitists:g}"
        if self.update_set != "trial":
            others["update_set"] = f"update_set={self.update_set!r}"
        if self.ranks and others:
            raise ValueError(
                f"ranks must stand alone, got ranks={self.ranks} with "
                f"{' and '.join(others.values())}; leave {' and '.join(others)} out, or "
                "ranks."
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
        self.symmetric = validation.boolean("symmetric", self.symmetric)

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
    choices is how many actions a cell has, or candidates, of which half are left on the
    average of a tour. Where solutions are no tours through all cells, that average is not
    known, and tau_min = tau_max / (2 n).

    Where the ants all follow one solution, by the lambda-branching factor, levels are
    moved towards tau_max.

    Attributes:
        update_set: "trial-best"; "best-so-far"; or the best solution since the last
            restart in every u-th trial, else the best of the trial. With
            "mostly-trial-best" u is 25. With "mixed" u falls with the trials since the
            restart, see `_MIXED`; where u is 1 and the solution is older than 50 trials,
            the best solution of all is taken.
        p_best: in (0, 1), for tours; None: tau_min = tau_max / (2 n), which is usual with
            local search.
        smoothing: delta, in [0, 1]: where the ants have converged, each level moves by
            this share of its distance to tau_max. 1 is a restart, which also forgets the
            best solution since the last one; 0 does nothing.
        patience: how many trials without a better solution since the last restart there
            must be before the next, >= 0.
        symmetric: a component and its reverse have the same level.

    Attributes that are no parameters:
        since_restart: the best solution since the last restart.
        restarts: how often levels were moved.
    """

    update_set: str = "mostly-trial-best"
    p_best: float | None = 0.05
    smoothing: float = 1.0
    patience: int = 250
    symmetric: bool = False

    def __post_init__(self) -> None:
        sets = (*UPDATE_SETS[1:], *_SCHEDULES)
        validation.one_of("update_set", self.update_set, sets)
        if self.p_best is not None:
            self.p_best = validation.number("p_best", self.p_best, above=0, below=1)
        self.smoothing = validation.number(
            "smoothing", self.smoothing, at_least=0, at_most=1
        )
        self.patience = validation.integer("patience", self.patience, at_least=0)
        self.symmetric = validation.boolean("symmetric", self.symmetric)
        self.forget()

    @property
    def solutions(self) -> list[BestSolution]:
        """See `AntRule`."""
        return [*super().solutions, self.since_restart]

    def forget(self) -> None:
        """See `AntRule`."""
        super().forget()
        self.since_restart = BestSolution()
        self.restarts = 0
        # Trials since the last restart, and since its best solution was found.
        self._trials, self._age = 0, 0

    def initial_level(self, fitness: float, steps: int, ants: int, rho: float) -> float:
        """tau_max = 1 / (rho L_nn)."""
        return fitness / max(rho, LEAST_LEVEL)

    def limits(self, n_cells: int, n_actions: int, rho: float) -> tuple[float, float]:
        """tau_min and tau_max by the best solution so far.

        Args:
            n_cells: rows of the table.
            n_actions: its columns.
            rho: the evaporation rate, > 0.
        """
        most, n = self.best.fitness / rho, self.best.cells.size
        is_tour = n == n_cells == n_actions
        if self.p_best is None or not is_tour:
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
        rho = max(global_decay, LEAST_LEVEL)
        n_cells, n_actions = levels.shape
        least, most = self.limits(n_cells, n_actions, rho)
        evaporate(levels, global_decay, least)
        solution = self._depositor(result)
        self._deposit_of(pheromone, solution, solution.fitness)
        limit(levels, least, most)
        if self._age > self.patience and self._converged(levels):
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
        if self.update_set in _SCHEDULES:
            steps = _SCHEDULES[self.update_set]
            every = next(u for trials, u in steps if self._trials <= trials)
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
        found = branching_factor(levels, self.candidates, self.best.cells)
        return found <= fewest * _CONVERGED

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

_SCHEDULES = {"mixed": _MIXED, "mostly-trial-best": ((np.inf, 25),)}
"""Of both update sets that mix; without local search ACOTSP takes the second."""

_OLD = 50
"""Trials after which, with u = 1, the best solution of all deposits."""

_CONVERGED = 1.00001
"""How many times the least branching factor counts as converged."""

ANT_RULES = (AntSystemUpdate, AntColonySystemUpdate, MaxMinUpdate)
"""The rules of chapter 2."""
