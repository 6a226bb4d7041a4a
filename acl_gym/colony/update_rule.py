"""What a colony does to its pheromone, as one replaceable part: the interface."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.episodes import Episodes
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import choose_actions
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.tours import Tours
from acl_gym.utils import validation
from acl_gym.utils.serialization import Missing, Savable
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class TrialResult:
    """What the ants of a trial did and what it cost.

    Attributes:
        solutions: S_trial, the cells, degrees and actions of every ant; `Tours` from
            colonies that build whole tours.
        costs: J of each ant, `(n_ants,)`.
        deposits: what each ant deposits, `(n_ants,)`, in the thesis 1 / J.
        terminated: whether each ant ended in a terminal state, `(n_ants,)`.
        episodes: observations, actions and stage costs, step by step; None unless
            the rule's `needs_episodes` is True.
        begins_batch: None where these are all M ants of a trial. In an asynchronous
            colony (§7.3) they are those that have come back in one step, and `solutions`
            and arrays hold only these. True: they are the first of the trial, or the
            first after another M. What happens once in a synchronous trial of M ants is
            then due again.
    """

    solutions: Solutions | Tours
    costs: FloatArray
    deposits: FloatArray
    terminated: BoolArray
    episodes: Episodes | None = None
    begins_batch: bool | None = None


class UpdateRule(Savable, ABC):
    """The local and the global update of the pheromone.

    Subclasses are dataclasses whose fields are the parameters of the rule. A colony
    works with a copy of the rule it is given, so a rule may also keep what it needs
    from step to step and from trial to trial; what it must remember across `save` and
    `load` it hands out in `memory`.

    In each trial a colony calls `start_trial`, then `choose` and `local_update` in
    every step, then `global_update`; an asynchronous colony calls `global_update` after
    each step in which ants come back. Predictions never call a rule.

    Attributes:
        needs_episodes: whether `TrialResult.episodes` is recorded, which costs memory
            for every step.
    """

    needs_episodes: ClassVar[bool] = False

    def start_trial(self, pheromone: Pheromone, trial: int) -> None:
        """Prepare for trial k = 0, 1, ...; by default there is nothing to do."""

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
        """Choose an action for each walking ant, by default all on the same pheromone.

        Args:
            selection: the selection rule, one of `acl_gym.colony.selection.RULES`.
            pheromone: the shared table.
            index: cells of the ants' states, `(m, k)`.
            degree: their degrees, `(m, k)`.
            epsilon: exploration probability, in [0, 1].
            rng: the colony's generator.
            allowed: U_q, `(m, n_actions)`; None: all actions.
            local_decay: gamma, in [0, 1).

        Returns:
            Indices of actions, `(m,)`.
        """
        return choose_actions(
            selection, pheromone, index, degree, epsilon, rng, allowed
        )

    @abstractmethod
    def local_update(
        self,
        pheromone: Pheromone,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Change the pheromone after a step of all walking ants.

        Args:
            pheromone: the shared table, changed in place.
            index: cells of the states that the ants acted in, `(m, k)`.
            degree: their degrees, `(m, k)`.
            actions: the actions chosen, `(m,)`.
            local_decay: gamma, in [0, 1).
        """

    @abstractmethod
    def global_update(
        self,
        pheromone: Pheromone,
        result: TrialResult,
        local_decay: float,
        global_decay: float,
    ) -> None:
        """Change the pheromone after a trial, or when some ants have come back.

        Args:
            pheromone: the shared table, changed in place.
            result: what the ants did and what it cost.
            local_decay: gamma, in [0, 1).
            global_decay: rho, in [0, 1].
        """

    def memory(self) -> dict[str, NDArray[Any]]:
        """What the rule must remember to go on after `load`; by default nothing."""
        return {}

    def restore(self, memory: dict[str, NDArray[Any]]) -> None:
        """Take over what `memory` gave when the agent was saved."""


class WatchedRule(UpdateRule):
    """Stands between a colony and a rule that is not of this package.

    Kernels address tables by what a colony keeps of a step, without further checks. So
    the rule is given copies, and the actions that it chooses are checked.

    Args:
        rule: the rule.
        n_actions: how many actions there are.
    """

    def __init__(self, rule: UpdateRule, n_actions: int) -> None:
        self._rule, self._n_actions = rule, n_actions

    def start_trial(self, pheromone: Pheromone, trial: int) -> None:
        """See `UpdateRule`."""
        self._rule.start_trial(pheromone, trial)

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
        """Let the rule choose.

        Raises:
            ValueError: it does not choose one allowed action for each ant.
        """
        found = self._rule.choose(
            selection,
            pheromone,
            index.copy(),
            degree.copy(),
            epsilon,
            rng,
            None if allowed is None else allowed.copy(),
            local_decay,
        )
        actions, m = validation.as_array(found), len(index)
        name = f"{type(self._rule).__name__}.choose"
        if actions is None or actions.dtype.kind not in "iu" or actions.shape != (m,):
            raise ValueError(
                f"{name} must return an integer for each of the {m} ants, got "
                f"{validation.shown(found)}."
            )
        good = (actions >= 0) & (actions < self._n_actions)
        if allowed is not None and good.all():
            good = allowed[np.arange(m), actions]
        if not good.all():
            j = int(np.argmin(good))
            raise ValueError(
                f"{name} must return allowed actions in 0..{self._n_actions - 1}, got "
                f"{actions[j]} for ant {j} of the {m} that walk."
            )
        return actions.astype(np.int64)

    def local_update(
        self,
        pheromone: Pheromone,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """See `UpdateRule`."""
        self._rule.local_update(
            pheromone, index.copy(), degree.copy(), actions.copy(), local_decay
        )

    def global_update(
        self,
        pheromone: Pheromone,
        result: TrialResult,
        local_decay: float,
        global_decay: float,
    ) -> None:
        """See `UpdateRule`."""
        own = replace(
            result,
            costs=result.costs.copy(),
            deposits=result.deposits.copy(),
            terminated=result.terminated.copy(),
        )
        self._rule.global_update(pheromone, own, local_decay, global_decay)


class MissingRule(Missing, UpdateRule):
    """Stands in for a user's own update rule in an agent read from a file.

    It keeps what that rule remembered, for the rule itself or for the next file.

    Args:
        parameter: "update".
        name: of the rule's class.

    Attributes:
        kept: what the rule's `memory` gave when the agent was saved.
    """

    def __init__(self, parameter: str, name: str) -> None:
        super().__init__(parameter, name)
        self.kept: dict[str, NDArray[Any]] = {}

    def start_trial(self, pheromone: Pheromone, trial: int) -> None:
        """Report which rule is missing.

        Raises:
            ValueError: always.
        """
        raise self.error()

    def local_update(self, *arguments: Any) -> None:
        """Never called: a trial does not start."""

    def global_update(self, *arguments: Any) -> None:
        """Never called: a trial does not start."""

    def memory(self) -> dict[str, NDArray[Any]]:
        """What the missing rule remembered."""
        return self.kept

    def restore(self, memory: dict[str, NDArray[Any]]) -> None:
        """Keep what the missing rule remembered."""
        self.kept = memory

    def hand_over(self, rule: UpdateRule) -> None:
        """Give what is kept to `rule`, if it is of the class that is missing."""
        # A script is a module of another name when it is imported; older files name the
        # class only.
        if self.kept and type(rule).__qualname__ == self.name.rpartition(":")[2]:
            rule.restore(self.kept)
