"""How Ant System, Ant Colony System and Max-Min Ant System learn."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.agents.ant_agent import UNKNOWN_TAU0, AntAgent
from acl_gym.agents.salesman_checks import check_instance, check_steps, fitness_error
from acl_gym.agents.same_task import is_same_task, same_wrappers
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.ant_kernels import branching_factor
from acl_gym.colony.deposits import UndefinedDepositError, checked_deposits
from acl_gym.colony.local_search import METHODS, LocalSearch, nearest_neighbours
from acl_gym.colony.tours import Tours, nearest_neighbour_tour
from acl_gym.colony.update_rule import TrialResult
from acl_gym.envs.graph.instances import TravellingSalesmanInstance
from acl_gym.envs.graph.lengths import tour_lengths
from acl_gym.envs.graph.travelling_salesman.lookup import Salesman, salesman_of
from acl_gym.envs.limits import time_limit
from acl_gym.evaluation.steps import Outcome
from acl_gym.partitions import Partition
from acl_gym.utils import validation
from acl_gym.utils.hashing import NUMBERS_BYTES
from acl_gym.utils.serialization import from_json, to_settings
from acl_gym.utils.typing import FloatArray, IntArray, Row

_NEIGHBOURS = 20
"""How many neighbours of a city local search looks at, as in ACOTSP."""

_LEAST_DEPOSIT, _MOST_DEPOSIT = 1e-150, 1e150
"""What ants may deposit, so that no sum or quotient of levels leaves the range of floats."""


class NoSolutionWarning(UserWarning):
    """No ant has completed a solution in a whole call of `learn`."""


class AntOptimizer(AntAgent):
    """A colony that looks for one best solution, by an update rule of chapter 2.

    Args:
        env: a vector environment with `Discrete` actions; its slots are the m ants.
        partition: see `AntAgent`.
        **parameters: see `AntAgent`.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None,
        **parameters: Any,
    ) -> None:
        super().__init__(env, partition, **parameters)
        self._instance: TravellingSalesmanInstance | None = None
        # Of the instance that a file was made with, which holds no more of it.
        self._fingerprint: bytes | None = None
        self._tours: Tours | None = None
        self._result: TrialResult | None = None
        self._set_tau0()
        self._check_env()

    _usual_ants: ClassVar[int | None] = None
    """How many ants are usual, whatever the problem; None: it depends on the cities."""

    @classmethod
    def usual_ants(cls, n_cities: int, local_search: str | None = None) -> int:
        """How many ants are usual, as in ACOTSP.

        As many as there are cities, with local search 25; Ant Colony System has 10 in any
        case.

        Args:
            n_cities: n, >= 2.
            local_search: as of the constructor.

        Raises:
            TypeError: `n_cities` is not an integer.
            ValueError: it is less than 2, or there is no such local search.
        """
        n_cities = validation.integer("n_cities", n_cities, at_least=2)
        if local_search is not None:
            validation.one_of("local_search", local_search, METHODS)
        if cls._usual_ants is not None:
            return cls._usual_ants
        return n_cities if local_search is None else 25

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Let the ants construct solutions, and update the pheromone after each trial.

        Called again, it continues from the pheromone and the best solution as they are.

        Args:
            total_timesteps: stop after the trial that reaches this many steps of all
                ants together; None sets no such limit. A tour has as many steps as
                there are cities.
            trials: how many trials to make, of one solution an ant; None sets no such
                limit. Without either limit, 100.
            callback: as in `ACL.learn`.
            log_interval: print a line every `log_interval` trials; None prints nothing.
            progress_bar: show a bar (of tqdm).

        Returns:
            The agent itself.

        Raises:
            ValueError: a solution has a cost for which ants can deposit nothing.

        Warns:
            NoSolutionWarning: in no trial has an ant come to a terminal state.
        """
        has_solved, first = False, self.trials
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.next_trial():
                self._set_exponents()
                result = self._build_tours() if self.builds_tours else self._walk()
                self._result = result
                self._set_tau0()
                self._rule.global_update(
                    self.pheromone, result, self.local_decay, self.global_decay
                )
                has_solved |= bool(result.terminated.any())
                training.end_trial(result.costs)
        if not has_solved and self.trials > first:
            walks = "" if self.tabu else ", or tabu=True, which rules out most circles"
            warnings.warn(
                f"in {self.trials - first} trials none of {self.num_envs} ants has come to "
                f"a terminal state within {self.max_steps} steps, so nothing was "
                f"deposited or learned; try more steps (max_steps) or more ants{walks}.",
                NoSolutionWarning,
                stacklevel=2,
            )
        return self

    @property
    def builds_tours(self) -> bool:
        """Whether whole tours are built at once, without stepping the environment."""
        return self._salesman is not None and self._salesman.is_plain and not self.walk

    def _set_tau0(self) -> None:
        """Set tau0 by the formula of the literature, as soon as that is possible.

        On the travelling salesman problem by the length of the nearest-neighbour tour
        from city 0. Elsewhere, and where a wrapper may change what a tour costs, by the
        best cost of the first trial, in which all levels are equal, so that it does not
        matter which they are.
        """
        if not self._tau0_is_due or self.env is None:
            return
        tau0, salesman = self.tau0, self._salesman
        if tau0 is None and salesman is not None and salesman.is_plain:
            distances = salesman.instance.distances
            tour = nearest_neighbour_tour(distances, 0)[None]
            length = tour_lengths(tour, distances)
            if not length[0] > 0.0:
                return  # the first trial tells what is wrong
            tau0 = self._formula(float(self._fitness(length)[0]), tour.size)
        elif tau0 is None and self._result is not None:
            result = self._result
            complete = np.flatnonzero(result.terminated)
            if not complete.size:
                return
            ant = complete[result.costs[complete].argmin()]
            steps = int(result.solutions.length[ant])
            tau0 = self._formula(float(result.deposits[ant]), steps)
        if tau0 is not None:
            self.pheromone.set_tau0(tau0, everywhere=not self._levels_are_set)
            self._tau0_is_due = False

    def _formula(self, fitness: float, steps: int) -> float:
        return self._rule.initial_level(
            fitness, steps, self.num_envs, self.global_decay
        )

    def _fitness(self, costs: FloatArray) -> FloatArray:
        """F of solutions, what ants deposit for them."""
        # The offset of some deposits must not change when tau0 becomes known: F of
        # solutions of different trials are compared.
        try:
            found = self.deposit(costs, UNKNOWN_TAU0)
        except UndefinedDepositError as error:
            raise fitness_error(error, self._salesman) from None
        deposits = checked_deposits(found, costs.size)
        if not _LEAST_DEPOSIT <= deposits.min() <= deposits.max() <= _MOST_DEPOSIT:
            raise ValueError(
                "ants must deposit between "
                f"{_LEAST_DEPOSIT:g} and {_MOST_DEPOSIT:g}, got {deposits.min():g} to "
                f"{deposits.max():g}; scale the costs, or take another deposit."
            )
        return deposits

    def _build_tours(self) -> TrialResult:
        """Let all ants build their tours at once, and improve them by local search."""
        salesman = self._salesman
        if salesman is None:  # pragma: no cover - builds_tours says it is there
            raise TypeError("env is not the travelling salesman's")
        distances, start = salesman.instance.distances, salesman.start
        n, m = len(distances), self.num_envs
        self._next_seed()  # which ants that walk would give to the environment
        starts = np.full(m, start)
        if isinstance(start, str):
            starts = self.rng.integers(n, size=m)
        solutions = self._tours
        if solutions is None or solutions.tours.shape != (m, n):
            solutions = self._tours = Tours(m, n)
        tours = solutions.tours
        if self._lists is None:
            self._lists = np.tile(np.arange(n, dtype=np.int32), (n, 1))
        draws = self.rng.random((n, 2, m))
        self._rule.build(self.pheromone, starts, draws, self._lists, self._decay, tours)
        if self._search is None:
            lengths = tour_lengths(tours, distances)
        else:
            lengths = self._search.improve(tours)
        complete = np.ones(m, np.bool_)
        return TrialResult(solutions, lengths, self._fitness(lengths), complete)

    @property
    def _decay(self) -> float:
        """gamma; 0 as long as tau0, towards which levels decay, is not known."""
        return 0.0 if self._tau0_is_due else float(self.local_decay)

    def _walk(self) -> TrialResult:
        """Let all ants walk in the environment, step by step, each to its end."""
        rule, pheromone, rollout = self._rule, self.pheromone, self.rollout
        solutions = self._empty_solutions()
        observation = rollout.start(seed=self._next_seed())
        while rollout._ants.size:
            ants = rollout._ants
            index, degree = self._locate(observation, ants)
            allowed = self._allowed(solutions, index)
            actions = rule.choose(
                "boltzmann",
                pheromone,
                index,
                degree,
                0.0,
                self.rng,
                allowed,
                self._decay,
            )
            solutions.append(ants, observation, index, actions)
            observation = rollout.move(actions)
            rule.local_update(pheromone, index, degree, actions, self._decay)
        complete = rollout.terminated
        deposits = np.zeros(rollout.num_envs)
        if complete.any():  # else there is no solution
            deposits[complete] = self._fitness(rollout.cost[complete])
        return TrialResult(solutions, rollout.cost, deposits, complete)

    def outcome(self) -> Outcome:
        """What the solutions of the trial that has just ended came to."""
        result = self._result
        if result is None or not isinstance(result.solutions, Tours):
            return super().outcome()
        steps = result.solutions.tours.size
        return Outcome(result.costs, result.terminated, steps)

    def measures(self, policy: IntArray) -> Row:
        """The best costs, of all trials and of this one, and the branching factor.

        Where an ant of the trial has reached a terminal state, or one ever has. The
        lambda-branching factor is the mean number of actions that ants may still take in
        a cell of the best solution, see `branching_factor`, among candidates where there
        are.
        """
        row: Row = {}
        result = self._result
        if result is not None and result.terminated.any():
            row["trial_best_cost"] = float(result.costs[result.terminated].min())
        best = self._rule.best
        if best.found:
            row["best_cost"] = self.best_cost
            levels, lists = self.pheromone.levels, self._rule.candidates
            row["branching_factor"] = branching_factor(levels, lists, best.cells)
        return row

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """Learn on another environment from now on; its number of slots may differ.

        The pheromone stays. The best solution stays only where the task is known to be
        the same: the same object; or the same wrappers, those that only watch aside,
        around the same instance of the travelling salesman problem, the same object,
        equal systems of this package, or slots that Gymnasium made by the same id with
        the same arguments. Of any other task its cost would say nothing, so the colony
        begins without one. An agent that had no environment, such as one read from a
        file, keeps it.

        Raises:
            TypeError: `env` is not a vector environment.
            ValueError: it does not fit the table or the parameters, or is another
                travelling salesman problem than that by whose distances ants choose.
            RuntimeError: a trial is under way.
        """
        found = salesman_of(env)
        if found is not None:
            check_instance(found.instance, self._instance, self._fingerprint)
        before, known, instance = self.env, self._salesman, self._instance
        super().set_env(env)
        try:
            self._salesman = found
            self._check_env()
            same = before is None or self._is_same_task(before, known)
            if same:
                self._check_best()
        except ValueError:
            self._salesman, self._instance = known, instance
            if before is None:
                self.env = self._rollout = None
            else:  # which the agent goes on with
                super().set_env(before)
            self._check_env()
            raise
        if not same:
            self._rule.forget()
            self._result = None
        if self._open:
            self._settle()
            self._set_candidates()
        self._set_tau0()

    def _is_same_task(self, before: Any, known: Salesman | None) -> bool:
        """Whether the environment poses the task of that which was there before."""
        if known is not None or self._salesman is not None:
            # Another instance is refused.
            found = self._salesman
            if known is None or found is None:
                return False
            if before is self.env or (known.is_plain and found.is_plain):
                return True
            return same_wrappers(before, self.env)
        return is_same_task(before, self.env)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        known = self._instance
        found = self._fingerprint if known is None else known.fingerprint
        if found is None:
            return super()._arrays()
        # The heuristic and the candidate lists are of these cities only.
        return {**super()._arrays(), "instance": np.frombuffer(found, np.uint8)}

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        self._rule.check_fits(self.pheromone)
        kept = arrays.get("instance")  # which older files do not hold
        if kept is not None:
            if kept.dtype != np.uint8 or kept.shape != (NUMBERS_BYTES,):
                raise ValueError(f"instance must be a hash of {NUMBERS_BYTES} bytes")
            self._fingerprint = kept.tobytes()
        saved = from_json(header["parameters"])["deposit"]
        if to_settings(self.deposit) != saved:  # `load` was given another
            for solution in self._rule.solutions:
                if solution.found:
                    fitness = self._fitness(np.array([solution.cost]))
                    solution.fitness = float(fitness[0])
        self._check_env()

    def _check_env(self) -> None:
        """Check that the environment fits, and prepare the local search on it."""
        self._search: LocalSearch | None = None
        if self.env is None:
            return
        salesman = self._salesman
        if salesman is not None:
            n_cities = salesman.instance.n_cities
            check_steps(n_cities, time_limit(self.env), self.max_steps)
        if self._local_search is not None:
            if salesman is None or not self.builds_tours:
                raise ValueError(
                    "local_search needs the travelling salesman's environment, without "
                    f"wrappers of your own, and walk=False, got {validation.shown(self.env)} "
                    f"and walk={self.walk}; leave local_search out."
                )
            near = nearest_neighbours(salesman.instance, _NEIGHBOURS)
            self._search = LocalSearch(self._local_search, salesman.instance, near)
        if salesman is not None:
            self._instance = salesman.instance

    def _check_best(self) -> None:
        """Check that the best tour is one through the cities of the environment."""
        best, salesman = self._rule.best, self._salesman
        # Where a wrapper may change rewards, the cost of a tour need not be its length.
        if best.found and salesman is not None and salesman.is_plain:
            length = tour_lengths(best.cells[None], salesman.instance.distances)[0]
            if not np.isclose(length, best.cost, rtol=1e-9):
                raise ValueError(
                    "env must be the instance on which the best tour has a length of "
                    f"{best.cost:g}, got one where it has {length:g}; take the one that "
                    "the agent learned on, with its wrappers, or make a new agent."
                )
