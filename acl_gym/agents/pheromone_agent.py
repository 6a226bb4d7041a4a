"""What agents share whose table is pheromone: `ACL`, and those of chapter 2."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from acl_gym.agents.base import TabularAgent
from acl_gym.colony.heuristic import Heuristic
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions
from acl_gym.utils.parameters import Parameter, fixed
from acl_gym.utils.serialization import Missing
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray


class PheromoneAgent(TabularAgent):
    """An agent whose ants choose by tau^alpha eta^beta, and remember their ways.

    Attributes:
        pheromone: the levels and the heuristic variables.
        tabu: whether an ant may choose an action only once in a cell in one trial.
    """

    pheromone: Pheromone
    tabu: bool
    _solutions: Solutions | None = None

    @property
    def heuristic(self) -> FloatArray | None:
        """The heuristic eta, `(n_cells, n_actions)`, read-only; None: 1 everywhere.

        Fixed once the agent is made.
        """
        return self.pheromone.heuristic

    @heuristic.setter
    def heuristic(self, value: Heuristic | None) -> None:
        raise fixed("heuristic", value)

    @property
    def _table(self) -> FloatArray:
        return self.pheromone.levels

    def set_table(self, table: ArrayLike) -> None:
        """Replace all pheromone levels.

        Raises:
            ValueError: the shape differs, or a level is not positive and finite.
        """
        self.pheromone.set_levels(table, "table")

    def _now(self, name: str) -> float:
        """The value that a number or schedule has in the next trial."""
        parameter: Parameter = getattr(type(self), name)
        return parameter.at(self, self.trials)

    def _at_first(self, name: str) -> float:
        """The value with which to begin; 1 where a file could not hold the schedule."""
        missing = isinstance(getattr(self, name), Missing)
        return 1.0 if missing else self._now(name)

    def _set_exponents(self) -> None:
        """Set alpha and beta to their values in the next trial."""
        self.pheromone.alpha = self._now("alpha")
        self.pheromone.beta = self._now("beta")

    def _allowed(self, solutions: Solutions, index: CellArray) -> BoolArray | None:
        """U_q of each walking ant, less what is tabu; None: all actions."""
        rollout: Any = self.rollout
        allowed: BoolArray | None = rollout.allowed()
        if not self.tabu:
            return allowed
        return solutions.untried(rollout._ants, index, allowed)

    def _empty_solutions(self) -> Solutions:
        """Memory for a trial, reused from trial to trial."""
        kept, shape = self._solutions, (self.num_envs, self.max_steps)
        if kept is None or (kept.n_ants, kept.max_steps) != shape:
            kept = Solutions(*shape, self.n_actions, self.partition)
            self._solutions = kept
        kept.clear()
        return kept
