"""The named update rules.

In the thesis all ants choose on the same pheromone, every visited pair decays at each
visit, and ants deposit at the end of the trial (a decision). Algorithms 3.1 to 4.2 can
also be read in other ways, and so can the analysis of chapter 3: those readings differ
in when and how often a pair decays.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from acl_gym.colony.ant_rules import ANT_RULES
from acl_gym.colony.greedy import ALL, check_choice, drawn_numbers
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.tours import Tours
from acl_gym.colony.update_kernels import (
    choose_and_decay,
    decay,
    decay_late,
    note_visits,
    reinforce,
    sum_deposits,
)
from acl_gym.colony.update_rule import (
    MissingRule,
    TrialResult,
    UpdateRule,
    WatchedRule,
)
from acl_gym.partitions.kernels import written_out
from acl_gym.utils import validation
from acl_gym.utils.serialization import from_settings
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


class Reinforcement:
    """The deposits of a trial, eq. (4.15), and the scratch memory they need.

    Args:
        n_pairs: entries of the table.
    """

    def __init__(self, n_pairs: int) -> None:
        self._summed: FloatArray = np.zeros((n_pairs, 4))
        self._touched: IntArray = np.empty(n_pairs + 1, dtype=np.int64)
        self._interrupted = False  # an update that did not end left the scratch dirty
        self._evaporated: FloatArray | None = None

    def __call__(
        self,
        pheromone: Pheromone,
        solutions: Solutions | Tours,
        deposits: FloatArray,
        global_decay: float,
        begins_batch: bool | None = None,
    ) -> None:
        """Reinforce along every solution.

        Within a solution a pair counts once, with its largest degree (4.13); the
        deposit is summed over ants, the decay weighs with the largest degree over
        all ants (4.14). Cells that no ant visited are not touched.

        In an asynchronous colony only some of the M ants of a batch have come back. The
        thesis leaves open how much a pair evaporates for them (a decision): as much as
        makes it, over the batch, what it would be in a synchronous trial of the same M
        solutions, 1 - rho times the largest degree. The first of them that has visited a
        pair pays for all, those after it only for what their degree exceeds. To let
        every ant evaporate by rho', (1 - rho')^M = 1 - rho, would make the sum over ants
        a mean: a pair that one ant has tried could come to as much as one that all took.

        Args:
            pheromone: the shared table, changed in place.
            solutions: of the ants that deposit.
            deposits: of each of them.
            global_decay: rho, in [0, 1].
            begins_batch: see `TrialResult`.

        Raises:
            ValueError: a deposit is not positive and finite.
        """
        _check_deposits(deposits)
        if (
            deposits.shape != (solutions.n_ants,)
            or self._summed.shape[0] != pheromone.levels.size
        ):
            raise ValueError(
                f"deposits must have shape ({solutions.n_ants},), one for each ant, for "
                f"a table of {self._summed.shape[0]} pairs, got {deposits.shape} for "
                f"{pheromone.levels.shape}."
            )
        if self._interrupted:
            self._summed[:] = 0.0
        self._interrupted = True
        n_touched = 0
        for block in solutions.blocks():
            n_touched = sum_deposits(
                block.index,
                block.degree,
                written_out(block.index.shape[1]),
                block.action,
                block.ends,
                block.ants.start,
                deposits[block.ants],
                self._summed,
                self._touched,
                n_touched,
                pheromone.n_actions,
            )
        touched = self._touched[:n_touched]
        reinforce(
            touched,
            self._summed,
            global_decay,
            pheromone.levels,
            pheromone.stale,
            self._evaporated_so_far(begins_batch),
        )
        self._interrupted = False

    def _evaporated_so_far(self, begins_batch: bool | None) -> FloatArray | None:
        """With which degree each pair has evaporated in this batch; None: with none."""
        if begins_batch is None:
            return None
        if self._evaporated is None:
            self._evaporated = np.zeros(len(self._summed))
        elif begins_batch:
            self._evaporated[:] = 0.0
        return self._evaporated


def _check_deposits(deposits: FloatArray) -> None:
    if not isinstance(deposits, np.ndarray) or deposits.dtype != np.float64:
        raise ValueError(
            f"deposits must be an array of float64, got {validation.shown(deposits)}."
        )
    with np.errstate(over="ignore"):
        total = deposits.sum()
    valid = np.isfinite(deposits) & (deposits > 0.0)
    if not (valid.all() and np.isfinite(total)):
        ant = int(np.argmin(valid)) if not valid.all() else int(np.argmax(deposits))
        raise ValueError(
            "deposits must be > 0 and their sum finite, got "
            f"{deposits[ant]} for ant {ant}; scale the cost, or check the deposit."
        )


class _DepositAtEnd(UpdateRule):
    """The deposit at the end of a trial, eq. (4.15), which the named rules share."""

    _reinforcement: Reinforcement | None = None

    def global_update(
        self,
        pheromone: Pheromone,
        result: TrialResult,
        local_decay: float,
        global_decay: float,
    ) -> None:
        """Deposit along every solution, eq. (4.15); see `Reinforcement`."""
        if self._reinforcement is None:
            self._reinforcement = Reinforcement(pheromone.levels.size)
        self._reinforcement(
            pheromone,
            result.solutions,
            result.deposits,
            global_decay,
            result.begins_batch,
        )


@dataclass
class EachVisit(_DepositAtEnd):
    """The thesis's rule: a pair decays at each visit, after all ants have chosen.

    Several ants on one pair multiply their factors, eq. (4.18), in any order.
    """

    def local_update(
        self,
        pheromone: Pheromone,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Decay the visited pairs towards tau0 by 1 - gamma * degree, eq. (4.12)."""
        if local_decay > 0.0 and not (
            decay(
                index,
                degree,
                written_out(index.shape[1]),
                actions,
                local_decay,
                pheromone.tau0,
                pheromone.levels,
                pheromone.stale,
            )
        ):
            raise ValueError(
                "local_update needs a cell of the table and an action for each ant, got "
                f"index {index.shape}, degree {degree.shape} and actions "
                f"{actions.shape} for {pheromone.levels.shape}."
            )


@dataclass
class InTurn(_DepositAtEnd):
    """Each ant in turn chooses and decays its pair before the next one chooses.

    Later ants of a step see what earlier ones have left, so the order of the ants
    matters: the ants of a step are computed sequentially, which is slower than with
    the other rules. Predictions, which change nothing, choose on the table as it is.
    """

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
        """Choose by `selection` and decay by eq. (4.12), ant by ant."""
        check_choice(index, degree, pheromone.levels, allowed)
        greedy = selection == "epsilon_greedy"
        actions = np.empty(index.shape[0], dtype=np.int64)
        choose_and_decay(
            pheromone.levels,
            pheromone.alpha,
            pheromone.greedy_weights if greedy else pheromone.weights,
            index,
            degree,
            drawn_numbers(rng, len(index)),
            0.0 if selection == "boltzmann" else epsilon,
            greedy,
            ALL if allowed is None else allowed,
            local_decay,
            pheromone.tau0,
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
        """Do nothing: the pairs decayed when the ants chose."""


class _AtTheEnd(_DepositAtEnd):
    """Pairs decay at the end of the trial, before the deposit, not on the way."""

    _each_ant: ClassVar[bool]

    def local_update(
        self,
        pheromone: Pheromone,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Do nothing: the pairs decay at the end of the trial."""

    def global_update(
        self,
        pheromone: Pheromone,
        result: TrialResult,
        local_decay: float,
        global_decay: float,
    ) -> None:
        """Decay what was visited, with largest degrees; then deposit, eq. (4.15)."""
        n_pairs = pheromone.levels.size
        visits, kept = np.zeros((n_pairs, 3)), np.ones(n_pairs)
        visits[:, 0] = -1.0  # no ant yet
        for block in result.solutions.blocks():
            note_visits(
                block.index,
                block.degree,
                block.action,
                block.ends,
                block.ants.start,
                local_decay,
                visits,
                kept,
                pheromone.n_actions,
            )
        decay_late(
            visits,
            kept,
            self._each_ant,
            local_decay,
            pheromone.tau0,
            pheromone.levels,
        )
        pheromone.stale[:] = True
        super().global_update(pheromone, result, local_decay, global_decay)


@dataclass
class OncePerAnt(_AtTheEnd):
    """A pair decays once for each ant that visited it, the total local update, eq. (3.13).

    An ant that visits a pair several times counts with its largest degree.
    """

    _each_ant = True


@dataclass
class OncePerTrial(_AtTheEnd):
    """A pair decays once per trial, with the largest degree of all its visits.

    In an asynchronous colony: once for all ants that come back in the same step.
    """

    _each_ant = False


UPDATE_RULES: dict[str, UpdateRule] = {
    "each_visit": EachVisit(),
    "in_turn": InTurn(),
    "once_per_ant": OncePerAnt(),
    "once_per_trial": OncePerTrial(),
}
"""The update rules by name. Those of chapter 2, `ANT_RULES`, are given as objects."""

_KINDS = (*map(type, UPDATE_RULES.values()), *ANT_RULES)


def as_update(update: str | UpdateRule) -> UpdateRule:
    """A rule of its own for one colony, from its name or from a rule.

    Raises:
        ValueError: there is no rule of that name.
        TypeError: it is neither a name nor an `UpdateRule`.
    """
    if isinstance(update, str):
        update = UPDATE_RULES[validation.one_of("update", update, UPDATE_RULES)]
    if not isinstance(update, UpdateRule):
        raise TypeError(
            f"update must be one of {', '.join(map(repr, UPDATE_RULES))} or an UpdateRule, "
            f"got {validation.shown(update)}."
        )
    return copy.deepcopy(update)


def watched(rule: UpdateRule, n_actions: int) -> UpdateRule:
    """The rule itself if it is one of this package, else behind a `WatchedRule`."""
    own = type(rule) in _KINDS or isinstance(rule, MissingRule)
    return rule if own else WatchedRule(rule, n_actions)


def update_from_settings(settings: Any) -> UpdateRule:
    """An update rule from the settings in a file.

    Raises:
        ValueError: the settings are those of no rule.
    """
    rule = from_settings("update", settings, _KINDS, MissingRule)
    if not isinstance(rule, UpdateRule):
        raise ValueError(
            f"update must be an UpdateRule, got {validation.shown(settings)}."
        )
    return rule
