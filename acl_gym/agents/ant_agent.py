"""What the agents of chapter 2 know: pheromone, heuristic variables, the best solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym.agents.base import TabularAgent
from acl_gym.agents.pheromone_agent import PheromoneAgent
from acl_gym.agents.saving import with_prefix
from acl_gym.colony.ant_rule import AntRule
from acl_gym.colony.candidates import NONE, candidate_lists, inverse_distances
from acl_gym.colony.deposits import Deposit, Rank, as_deposit, deposit_from_settings
from acl_gym.colony.greedy import greedy_actions
from acl_gym.colony.heuristic import Heuristic, as_heuristic
from acl_gym.colony.local_search import METHODS
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.schedules import Setting, schedule_from_settings
from acl_gym.colony.selection import choose_actions
from acl_gym.envs.graph.cities import TravellingSalesmanInstance
from acl_gym.envs.graph.travelling_salesman.lookup import salesman_of
from acl_gym.envs.limits import time_limit
from acl_gym.partitions import Partition
from acl_gym.policies import TablePolicy
from acl_gym.utils import validation
from acl_gym.utils.parameters import fixed
from acl_gym.utils.serialization import to_settings
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

UNKNOWN_TAU0 = 1.0
"""The level until the first trial tells tau0: ants choose alike at any level that all
pairs have."""

USUAL_CANDIDATES = 20
"""How many cities ants look at first on the travelling salesman problem, as in ACOTSP."""


class AntAgent(PheromoneAgent):
    """The table of a colony that looks for one best solution, and its files.

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
        symmetric: see `AntSystem`.
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
        candidates: int | str | None,
        local_search: str | None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray],
        symmetric: bool | None,
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
        if isinstance(candidates, str):
            validation.one_of("candidates", candidates, ("usual",))
        elif candidates is not None:
            candidates = validation.integer("candidates", candidates, at_least=1)
        if local_search is not None:
            validation.one_of("local_search", local_search, METHODS)
        if symmetric is not None:
            symmetric = validation.boolean("symmetric", symmetric)
        tabu = validation.boolean("tabu", tabu)
        walk = validation.boolean("walk", walk)
        self.tau0, self.deposit = tau0, as_deposit(deposit)
        if isinstance(self.deposit, Rank):
            raise ValueError(
                "deposit must say of each solution alone how good it is, so that the best "
                "so far can be told, got 'rank'; take 'inverse_cost' for costs, 'return' "
                "for rewards that are never negative, or a function of the costs."
            )
        self.tabu, self.walk = tabu, walk
        self._local_search = local_search
        if partition is None:
            self._check_states(env)
        self._salesman = salesman_of(env)
        if max_steps is None and self._salesman is not None:
            # One step more than a tour, so that its end is never a truncation as well.
            steps = self._salesman.instance.n_cities + 1
            max_steps = min(time_limit(env) or steps, steps)
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        if self.partition.cells_per_state > 1:
            raise ValueError(
                "partition must have one cell per state, such as Discrete or Crisp, got "
                f"{validation.shown(self.partition)}; take one of these, or an agent for "
                "states that share cells, ReturningACL or ACL."
            )
        self._rule = rule
        if symmetric is not None:
            rule.change("symmetric", symmetric)
        # What is to be chosen for the environment, as soon as there is one.
        open_ones = {
            "heuristic": heuristic is None and env is None,
            "candidates": isinstance(candidates, str),
            "symmetric": symmetric is None,
        }
        self._open = {name for name, is_open in open_ones.items() if is_open}
        self._candidates = None if isinstance(candidates, str) else candidates
        self.pheromone = Pheromone(
            self.partition.n_cells,
            self.n_actions,
            UNKNOWN_TAU0,
            self._at_first("alpha"),
            self._chosen_heuristic(heuristic),
            self._at_first("beta"),
        )
        self._tau0_is_due, self._levels_are_set = True, False
        self._settle()
        self._set_candidates()

    @property
    def update(self) -> AntRule:
        """The update rule, with what it remembers; fixed once the agent is made."""
        return self._rule

    @update.setter
    def update(self, value: AntRule) -> None:
        raise fixed("update", value)

    @property
    def instance(self) -> TravellingSalesmanInstance | None:
        """The cities, on the travelling salesman problem; else None."""
        return None if self._salesman is None else self._salesman.instance

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
    def symmetric(self) -> bool:
        """Whether deposits are symmetric; fixed once the agent is made."""
        return self._rule.symmetric

    @symmetric.setter
    def symmetric(self, value: bool | None) -> None:
        raise fixed("symmetric", value)

    def _check_states(self, env: Any) -> None:
        """Refuse observations of which no partition of single cells follows.

        Raises:
            ValueError: they are numbers on a scale.
        """
        space = getattr(env, "single_observation_space", None)
        if isinstance(space, spaces.Box):
            raise ValueError(
                f"{type(self).__name__} needs states that are cells, such as the "
                f"observations Discrete(48), got {space}; take ReturningACL or ACL, which "
                "are made for states on a scale, or pass a partition of single cells, "
                "such as Crisp.from_box(space, 10)."
            )

    def _chosen_for(self, name: str, value: Any) -> Any:
        """What a parameter of the rule becomes, where the value leaves it open."""
        return value

    def _settle(self) -> None:
        """Choose for the environment what was left open."""
        if self.env is None:
            return
        # Elsewhere a list is never used up, and would rule other actions out.
        if self._salesman is not None:
            if "heuristic" in self._open:
                eta = inverse_distances(self._salesman.instance.distances)
                self.pheromone.heuristic = eta
            if "candidates" in self._open:
                self._candidates = USUAL_CANDIDATES
            if "symmetric" in self._open:
                self._rule.change("symmetric", self._salesman.instance.symmetric)
        self._open.clear()

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
            heuristic = inverse_distances(salesman.instance.distances)
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

    def set_table(self, table: ArrayLike) -> None:
        """See `PheromoneAgent.set_table`; tau0 sets these levels no more."""
        super().set_table(table)
        self._levels_are_set = True

    @property
    def policy(self) -> TablePolicy:
        """The policy of §2.5.1: the action with the largest tau^alpha eta^beta now.

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
            "tabu": self.tabu,
            "walk": self.walk,
            "max_steps": self.max_steps,
            "seed": self.seed,
            **self._rule.parameters(),
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
        flags = float(self._tau0_is_due), float(self._levels_are_set)
        arrays["tau0"] = np.array([self.pheromone.tau0, *flags])
        if self.heuristic is not None:
            arrays["heuristic"] = self.heuristic
        return arrays

    def _state(self) -> Any:
        arrays = self._arrays()
        arrays.pop("heuristic", None)  # which never changes
        return {name: array.copy() for name, array in arrays.items()}

    def _set_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._rule.restore(with_prefix("update_", arrays))
        tau0, due, are_set = validation.real_array("tau0", arrays["tau0"], ndim=1)
        self.pheromone.set_tau0(float(tau0), everywhere=False)
        self._tau0_is_due, self._levels_are_set = bool(due), bool(are_set)

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        self._set_arrays(arrays)
        self._open.discard("heuristic")
        if self.tau0 != header["parameters"]["tau0"]:  # which `load` was given
            self._levels_are_set |= self.trials > 0
            self._tau0_is_due = True
        self.pheromone.heuristic = as_heuristic(
            arrays.get("heuristic"), None, self.partition, self._table.shape
        )
        self._set_candidates()
