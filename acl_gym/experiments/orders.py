"""Other readings of the local update: in which order ants choose and decay, how often.

The colony of this package has two phases (a decision): all ants choose on the same
pheromone, then all decay, at each visit. Algorithms 3.1 to 4.2 can be read otherwise,
and so can the analysis. What the readings change is part of the reproduction.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from acl_gym.agents.acl import ACL
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

TWO_PHASES = "two phases"
ONE_PHASE = "one phase"
ONCE_AN_ANT = "once an ant"
ONCE_A_TRIAL = "once a trial"

ORDERS = {
    TWO_PHASES: "all ants choose, then all decay, at each visit",
    ONE_PHASE: "each ant in turn chooses and decays before the next one chooses",
    ONCE_AN_ANT: "a pair decays once for each ant that visited it, (3.13)",
    ONCE_A_TRIAL: "a pair decays once a trial, whoever visited it",
}
"""What the names of the readings mean."""


def colony(order: str, *arguments: Any, **keywords: Any) -> ACL:
    """`ACL(*arguments, **keywords)` with another reading of the local update.

    Args:
        order: a key of `ORDERS`.
        *arguments: of `ACL`.
        **keywords: of `ACL`.

    Raises:
        ValueError: there is no such reading, or it does not go with the selection.
    """
    if order not in ORDERS:
        raise ValueError(f"order must be one of {', '.join(ORDERS)}, got {order!r}.")
    if order == ONE_PHASE:
        return OnePhase(*arguments, **keywords)
    made = ACL(*arguments, **keywords)
    if order != TWO_PHASES:
        old = made.pheromone
        late = AtTheEnd(len(old.levels), old.n_actions, old.tau0, old.alpha)
        late.each_ant = order == ONCE_AN_ANT
        made.pheromone = late
    return made


class AtTheEnd(Pheromone):
    """Pheromone that decays at the end of the trial, not on the way.

    Attributes:
        each_ant: once for each ant that has visited a pair, or once.
        gamma: the local decay of the trial.
    """

    each_ant = True
    gamma = 0.0

    def local_update(
        self,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Remember gamma."""
        self.gamma = local_decay

    def global_update(
        self, solutions: Solutions, deposits: FloatArray, global_decay: float
    ) -> None:
        """Decay what was visited, with each ant's largest degree; then reinforce."""
        n_pairs = self.levels.size
        kept, most = np.ones(n_pairs), np.zeros(n_pairs)
        for block in solutions.blocks():
            pairs = block.index * self.n_actions + block.action[:, None]
            for start, end in zip(
                np.concatenate([[0], block.ends[:-1]]), block.ends, strict=True
            ):
                own = np.zeros(n_pairs)
                np.maximum.at(
                    own, pairs[start:end].ravel(), block.degree[start:end].ravel()
                )
                kept *= 1.0 - self.gamma * own
                np.maximum(most, own, out=most)
        left = kept if self.each_ant else 1.0 - self.gamma * most
        levels = self.levels.ravel()
        self.set_levels(
            (left * (levels - self.tau0) + self.tau0).reshape(self.levels.shape)
        )
        super().global_update(solutions, deposits, global_decay)


class _Decayed(Pheromone):
    """Pheromone that has decayed when the ants chose."""

    def local_update(
        self,
        index: CellArray,
        degree: FloatArray,
        actions: IntArray,
        local_decay: float,
    ) -> None:
        """Nothing is left to do."""


class OnePhase(ACL):
    """A colony whose ants choose one after the other, each on what the last has left.

    For Boltzmann and Max-Boltzmann selection on systems where every action is allowed.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        if self.selection == "epsilon_greedy":
            raise ValueError(
                "selection must be 'boltzmann' or 'max_boltzmann' for ants that choose "
                "in turn, got 'epsilon_greedy'."
            )
        old = self.pheromone
        self.pheromone = _Decayed(len(old.levels), old.n_actions, old.tau0, old.alpha)

    def _choose(
        self,
        index: CellArray,
        degree: FloatArray,
        epsilon: float,
        rng: np.random.Generator,
        allowed: BoolArray | None,
    ) -> IntArray:
        if allowed is not None:
            raise ValueError(
                "every action must be allowed for ants that choose in turn, got a mask."
            )
        actions = np.empty(index.shape[0], dtype=np.int64)
        pheromone = self.pheromone
        _choose_and_decay(
            index,
            degree,
            rng.random((2, index.shape[0])),
            epsilon if self.selection == "max_boltzmann" else 0.0,
            pheromone.alpha,
            self.local_decay,
            pheromone.tau0,
            pheromone.levels,
            actions,
        )
        pheromone.stale[index.ravel()] = True
        return actions


@njit(cache=True)
def _choose_and_decay(
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    alpha: float,
    local_decay: float,
    tau0: float,
    levels: FloatArray,
    actions: IntArray,
) -> None:
    """(3.6) with (4.11), then (4.12), ant by ant; writes `actions` and `levels`."""
    n_actions = levels.shape[1]
    weight, share = np.empty(n_actions), np.empty(n_actions)
    for j in range(actions.size):
        weight[:] = 0.0
        for c in range(index.shape[1]):
            row = levels[index[j, c]]
            share[:] = (row / row.max()) ** alpha
            weight += degree[j, c] * share / share.sum()
        action = n_actions - 1
        if draws[0, j] < epsilon:
            action = int(draws[1, j] * n_actions)
        else:
            cumulated = 0.0
            for u in range(n_actions - 1):
                cumulated += weight[u]
                if draws[1, j] < cumulated:
                    action = u
                    break
        actions[j] = action
        for c in range(index.shape[1]):
            excess = levels[index[j, c], action] - tau0
            levels[index[j, c], action] = (
                tau0 + (1.0 - local_decay * degree[j, c]) * excess
            )
