"""What Ant System, Ant Colony System and Max-Min Ant System share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, ClassVar, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym.agents.base import TabularAgent
from acl_gym.agents.saving import with_prefix
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.ant_kernels import branching_factor
from acl_gym.colony.ant_rules import AntRule
from acl_gym.colony.candidates import NONE, candidate_lists, inverse_distances
from acl_gym.colony.deposits import (
    Deposit,
    as_deposit,
    checked_deposits,
    deposit_from_settings,
)
from acl_gym.colony.greedy import greedy_actions
from acl_gym.colony.heuristic import Heuristic, as_heuristic
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.schedules import Setting, schedule_from_settings
from acl_gym.colony.selection import choose_actions
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.tours import Tours, nearest_neighbour_tour, tour_lengths
from acl_gym.colony.update_rule import TrialResult
from acl_gym.envs.graph.travelling_salesman import TravellingSalesmanVectorEnv
from acl_gym.evaluation.rollout import Outcome
from acl_gym.partitions import Partition
from acl_gym.policies import TablePolicy
from acl_gym.utils import validation
from acl_gym.utils.parameters import Parameter, fixed
from acl_gym.utils.serialization import Missing, to_settings
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, Row

LOCAL_SEARCHES = {"2-opt": "two_opt", "or-opt": "or_opt", "3-opt": "three_opt"}
"""The local searches by name, and their functions in `acl_gym.colony.local_search`."""

_NEIGHBOURS = 20
"""How many neighbours of a city local search looks at, as in ACOTSP."""

UNKNOWN_TAU0 = 1.0
"""The level until the first trial tells tau0: ants choose alike at any level that all
pairs have."""


class AntOptimizer(TabularAgent):
    """A colony that looks for one best solution, by an update rule of chapter 2.

    Args:
        env: a vector environment with `Discrete` actions; its slots are the m ants.
        partition: see `TabularAgent`; a state must be one cell.
        rule: how pheromone is updated.
        tau0: see `AntSystem`.
        global_decay: rho.
        alpha: exponent of the levels.
        beta: exponent of the heuristic variables.
        heuristic: see `AntSystem`.
        candidates: see `AntSystem`.
        local_search: see `AntSystem`.
        deposit: see `AntSystem`.
        tabu: see `AntSystem`.
        walk: see `AntSystem`.
        max_steps: see `TabularAgent`.
        seed: see `TabularAgent`.
        n_actions: see `TabularAgent`.
    """

    slots_are = "ants"
    measures_policy: ClassVar[bool] = False

    global_decay: Any
    """rho, the evaporation rate, a `Parameter`."""

    alpha: Any
    """Exponent of the levels in (2.2)."""

    beta: Any
    """Exponent of the heuristic variables in (2.2)."""

    local_decay: Any = 0.0
    """gamma of (2.6), where there is a local update."""

    _fixed = (*TabularAgent._fixed, "deposit", "tau0", "tabu", "walk")

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None,
        *,
        rule: AntRule,
        tau0: float | None,
        global_decay: float,
        alpha: Setting,
        beta: Setting,
        heuristic: Heuristic | str | None,
        candidates: int | None,
        local_search: str | None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray],
        tabu: bool,
        walk: bool,
        max_steps: int | None,
        seed: int | None,
        n_actions: int | None,
    ) -> None:
        self.global_decay = global_decay
        self.alpha, self.beta = alpha, beta
        if tau0 is not None:
            tau0 = validation.number("tau0", tau0, above=0)
        if candidates is not None:
            candidates = validation.integer("candidates", candidates, at_least=1)
        if local_search is not None:
            validation.one_of("local_search", local_search, LOCAL_SEARCHES)
        for name, value in (("tabu", tabu), ("walk", walk)):
            if not isinstance(value, bool):
                raise TypeError(
                    f"{name} must be True or False, got {validation.shown(value)}."
                )
        self.tau0, self.deposit = tau0, as_deposit(deposit)
        self.tabu, self.walk = tabu, walk
        self._candidates, self._local_search = candidates, local_search
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        if self.partition.cells_per_state > 1:
            raise ValueError(
                "partition must have one cell per state, such as Discrete or Crisp, got "
                f"{validation.shown(self.partition)}."
            )
        self._rule = rule
        self._solutions: Solutions | None = None
        self._tours: Tours | None = None
        self._result: TrialResult | None = None
        self.pheromone = Pheromone(
            self.partition.n_cells,
            self.n_actions,
            UNKNOWN_TAU0,
            self._at_first("alpha"),
            self._chosen_heuristic(heuristic),
            self._at_first("beta"),
        )
        self._tau0_is_due, self._levels_are_set = True, False
        self._set_candidates()
        self._set_tau0()
        self._check_env()

    @staticmethod
    @abstractmethod
    def usual_ants(n_cities: int, local_search: str | None = None) -> int:
        """How many ants the literature takes for so many cities.

        Args:
            n_cities: n.
            local_search: as of the constructor.
        """

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
        """
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
                training.end_trial(result.costs)
        return self

    @property
    def update(self) -> AntRule:
        """The update rule, with what it remembers; fixed once the agent is made."""
        return self._rule

    @property
    def best_cost(self) -> float:
        """J of the best solution so far, the length of the best tour; infinite before."""
        return self._rule.best.cost

    @property
    def best_solution(self) -> IntArray | None:
        """The components of the best solution so far; None before.

        Pairs of cell and action in the order of the steps, each once, `(r, 2)`, a copy.
        """
        best = self._rule.best
        if not best.found:
            return None
        return np.column_stack([best.cells.astype(np.int64), best.actions])

    @property
    def best_tour(self) -> CellArray | None:
        """The cells of the best solution so far, in the order of the steps; None before.

        On the travelling salesman problem the cities of the shortest tour, int32 `(n,)`,
        a copy.
        """
        best = self._rule.best
        return best.cells.copy() if best.found else None

    @property
    def builds_tours(self) -> bool:
        """Whether whole tours are built at once, without stepping the environment."""
        # Subclasses and wrappers may change what a step does.
        return type(self.env) is TravellingSalesmanVectorEnv and not self.walk

    @property
    def candidates(self) -> int | None:
        """How many actions ants look at first; fixed once the agent is made."""
        return self._candidates

    @candidates.setter
    def candidates(self, value: int | None) -> None:
        raise fixed("candidates", value)

    @property
    def local_search(self) -> str | None:
        """The local search; fixed once the agent is made."""
        return self._local_search

    @local_search.setter
    def local_search(self, value: str | None) -> None:
        raise fixed("local_search", value)

    @property
    def heuristic(self) -> FloatArray | None:
        """The heuristic variables eta, `(n_cells, n_actions)`, read-only; None: 1."""
        return self.pheromone.heuristic

    @heuristic.setter
    def heuristic(self, value: Heuristic | None) -> None:
        raise fixed("heuristic", value)

    @property
    def _salesman(self) -> TravellingSalesmanVectorEnv | None:
        """The travelling salesman's environment below all wrappers, if it is that."""
        base = None if self.env is None else self.env.unwrapped
        return base if isinstance(base, TravellingSalesmanVectorEnv) else None

    def _chosen_heuristic(self, heuristic: Heuristic | str | None) -> FloatArray | None:
        """The heuristic variables as an array; see `AntSystem`."""
        salesman = self._salesman
        if isinstance(heuristic, str):
            validation.one_of("heuristic", heuristic, ("distance",))
            if salesman is None:
                raise ValueError(
                    "heuristic='distance' needs the travelling salesman's environment, "
                    f"got {validation.shown(self.env)}; pass an array, or a function of "
                    "the environment and the partition."
                )
        if salesman is not None and (heuristic is None or isinstance(heuristic, str)):
            heuristic = inverse_distances(salesman.distances)
        shape = self.partition.n_cells, self.n_actions
        return as_heuristic(heuristic, self.env, self.partition, shape)

    def _set_candidates(self) -> None:
        """Make the candidate lists, and the room that tours need."""
        eta, lists = self.heuristic, NONE
        if self._candidates is not None and eta is not None:
            lists = candidate_lists(eta, self._candidates)
        self._rule.candidates = lists
        # Where there are no lists, every city is a candidate of every other.
        self._lists: CellArray | None = lists if lists.size else None
        self._neighbours: CellArray | None = None

    def _set_tau0(self) -> None:
        """Set tau0 by the formula of the literature, as soon as that is possible.

        On the travelling salesman problem by the length of the nearest-neighbour tour
        from city 0. Elsewhere by the best cost of the first trial, in which all levels are
        equal, so that it does not matter which they are.
        """
        if not self._tau0_is_due or self.env is None:
            return
        tau0, salesman = self.tau0, self._salesman
        if tau0 is None and salesman is not None:
            tour = nearest_neighbour_tour(salesman.distances, 0)[None]
            length = tour_lengths(tour, salesman.distances)
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
        deposits = self.deposit(costs, self.pheromone.tau0)
        return checked_deposits(deposits, costs.size)

    def _build_tours(self) -> TrialResult:
        """Let all ants build their tours at once, and improve them by local search."""
        env = self._salesman
        if env is None:  # pragma: no cover - builds_tours says it is there
            raise TypeError("env is not the travelling salesman's")
        n, m = env.instance.n_cities, self.num_envs
        self._next_seed()  # which ants that walk would give to the environment
        start = env.system.start
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
        if self._local_search is None:
            lengths = tour_lengths(tours, env.distances)
        else:
            lengths = self._improve(tours, env.distances)
        complete = np.ones(m, np.bool_)
        return TrialResult(solutions, lengths, self._fitness(lengths), complete)

    def _improve(self, tours: CellArray, distances: FloatArray) -> FloatArray:
        """Improve tours by local search, in place; return their lengths."""
        module = import_module("acl_gym.colony.local_search")
        if self._neighbours is None:
            count = min(_NEIGHBOURS, len(distances) - 1)
            self._neighbours = module.nearest_neighbours(distances, count)
        search = getattr(module, LOCAL_SEARCHES[str(self._local_search)])
        lengths: FloatArray = search(tours, distances, self._neighbours)
        return lengths

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

    def _allowed(self, solutions: Solutions, index: CellArray) -> BoolArray | None:
        """What each walking ant may do, less what is tabu; None: everything."""
        rollout = self.rollout
        allowed = rollout.allowed()
        if not self.tabu:
            return allowed
        if allowed is None:
            allowed = np.ones((rollout._ants.size, self.n_actions), np.bool_)
        return solutions.untried(rollout._ants, index, allowed)

    def _empty_solutions(self) -> Solutions:
        """Memory for a trial, reused from trial to trial."""
        kept, shape = self._solutions, (self.num_envs, self.max_steps)
        if kept is None or (kept.n_ants, kept.max_steps) != shape:
            kept = Solutions(*shape, self.n_actions, self.partition)
            self._solutions = kept
        kept.clear()
        return kept

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
        lambda-branching factor is the mean number of actions in a cell that ants may
        still take, see `branching_factor`, among candidates where there are.
        """
        row: Row = {}
        result = self._result
        if result is not None and result.terminated.any():
            row["trial_best_cost"] = float(result.costs[result.terminated].min())
        if self._rule.best.found:
            row["best_cost"] = self.best_cost
        levels = self.pheromone.levels
        row["branching_factor"] = branching_factor(levels, self._rule.candidates)
        return row

    @property
    def _table(self) -> FloatArray:
        return self.pheromone.levels

    def set_table(self, table: ArrayLike) -> None:
        """Replace all pheromone levels.

        Raises:
            ValueError: the shape differs, or a level is not positive and finite.
        """
        levels = self._checked_table(table)
        if not (levels > 0.0).all():
            raise ValueError(
                f"table must hold positive levels only, got {levels.min():g}."
            )
        self.pheromone.set_levels(levels)
        self._levels_are_set = True

    @property
    def policy(self) -> TablePolicy:
        """The policy of §2.5.1, the action with the largest tau^alpha eta^beta, as it is now.

        Its table is tau eta^(beta / alpha), a copy, which does not follow learning. On
        the travelling salesman problem it needs the masks, to know where it has been.
        """
        weights = self.pheromone.greedy_weights
        table = self._table if weights is None else self._table * weights
        return TablePolicy(
            self.partition, table, self._ranks, self.first_action, self._signals
        )

    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        weights = self.pheromone.greedy_weights
        if not deterministic or weights is None:
            return super()._act(index, degree, deterministic, allowed)
        cells = index[:, 0]
        table = self._table[cells] * weights[cells]
        own = np.arange(len(cells), dtype=np.int32)[:, None]
        return greedy_actions(table, self._ranks[cells], own, degree, allowed)

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        self._set_exponents()
        rng = self._predict_rng
        return choose_actions(
            "boltzmann", self.pheromone, index, degree, 0.0, rng, allowed
        )

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """See `TabularAgent.set_env`.

        Raises:
            ValueError: it is another travelling salesman problem than that whose best
                tour is known.
        """
        super().set_env(env)
        self._check_env()
        self._set_tau0()

    def _check_env(self) -> None:
        if self.env is None:
            return
        best, salesman = self._rule.best, self._salesman
        if self._local_search is not None and not self.builds_tours:
            raise ValueError(
                "local_search needs the travelling salesman's environment, not wrapped, "
                f"and walk=False, got {validation.shown(self.env)} and "
                f"walk={self.walk}; leave local_search out."
            )
        if best.found and salesman is not None:
            length = tour_lengths(best.cells[None], salesman.distances)[0]
            if not np.isclose(length, best.cost, rtol=1e-9):
                raise ValueError(
                    "env must be the instance on which the best tour has a length of "
                    f"{best.cost:g}, got one where it has {length:g}; make a new agent "
                    "for another instance."
                )

    def _now(self, name: str) -> float:
        """The value that a number or schedule has in the next trial."""
        parameter: Parameter = getattr(type(self), name)
        return parameter.at(self, self.trials)

    def _at_first(self, name: str) -> float:
        """The value with which to begin; 1 where a file could not hold the schedule."""
        value = self.__dict__[name]
        if isinstance(value, Missing):
            return 1.0
        parameter: Parameter = getattr(type(self), name)
        return parameter.at(self, 0)

    def _set_exponents(self) -> None:
        self.pheromone.alpha = self._now("alpha")
        self.pheromone.beta = self._now("beta")

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor, except `heuristic`, an array."""
        return {
            "tau0": self.tau0,
            "global_decay": self.global_decay,
            "alpha": to_settings(self.alpha),
            "beta": to_settings(self.beta),
            "candidates": self.candidates,
            "local_search": self.local_search,
            "deposit": to_settings(self.deposit),
            "symmetric": self._rule.symmetric,
            "tabu": self.tabu,
            "walk": self.walk,
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    @classmethod
    def _restored_parameters(cls, saved: dict[str, Any]) -> dict[str, Any]:
        return {
            **saved,
            "alpha": schedule_from_settings("alpha", saved["alpha"]),
            "beta": schedule_from_settings("beta", saved["beta"]),
            "deposit": deposit_from_settings(saved["deposit"]),
        }

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {f"update_{name}": a for name, a in self._rule.memory().items()}
        arrays["tau0"] = np.array([self.pheromone.tau0, float(self._tau0_is_due)])
        if self.heuristic is not None:
            arrays["heuristic"] = self.heuristic
        return arrays

    def _state(self) -> Any:
        arrays = self._arrays()
        arrays.pop("heuristic", None)  # which never changes
        return {name: array.copy() for name, array in arrays.items()}

    def _set_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._rule.restore(with_prefix("update_", arrays))
        tau0, due = validation.real_array("tau0", arrays["tau0"], ndim=1)
        self.pheromone.set_tau0(float(tau0), everywhere=False)
        self._tau0_is_due = bool(due)

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        self._set_arrays(arrays)
        self.pheromone.heuristic = as_heuristic(
            arrays.get("heuristic"), None, self.partition, self._table.shape
        )
        self._set_candidates()


def is_symmetric(env: Any, symmetric: bool | None) -> bool:
    """Whether deposits are symmetric: as given, or as the instance is.

    Args:
        env: the environment, or None.
        symmetric: as given; None: True on a symmetric travelling salesman problem.
    """
    if symmetric is not None:
        return symmetric
    base = getattr(env, "unwrapped", None)
    return isinstance(base, TravellingSalesmanVectorEnv) and base.instance.symmetric
