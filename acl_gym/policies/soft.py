"""A policy that draws its actions in proportion to pheromone."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.colony.greedy import NUMBERS_PER_ACTION
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import choose_actions
from acl_gym.partitions import Partition
from acl_gym.policies.base import PartitionPolicy, checked_first_action
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


class SoftPolicy(PartitionPolicy):
    """Boltzmann selection, eq. (4.11), as in learning, but with a larger exponent.

    A greedy policy on a coarse table can fall into a cycle beside the goal that it
    never leaves (docs/hovering.md). Drawing in proportion to tau^exponent follows
    the same pheromone, and leaves every cycle sooner or later.

    An evaluation is a function of the seed. Called with `episode_start`, as
    Stable-Baselines3's `evaluate_policy` and `evaluate_policy_cost` do, `predict`
    changes nothing: the state that it takes, None at first, and returns holds how many
    numbers the evaluation has drawn. Called without `episode_start`, for instance in
    a loop of your own, it continues the random numbers of its own generator.
    `deterministic` makes no difference.

    Args:
        partition: turns observations into cells and degrees.
        levels: pheromone, `(n_cells, n_actions)`, finite and > 0; copied.
        exponent: > 0; the larger, the closer to the greedy policy.
        seed: of the draws, >= 0; None draws one from the system.
        first_action: the action that column 0 stands for, `Discrete.start`.

    Raises:
        TypeError: `seed` is not an integer.
        ValueError: `levels` do not fit the partition or are not all > 0 and finite,
            `exponent` is not > 0 and finite, or `seed` is negative.
    """

    _fixed = ("partition", "first_action", "_pheromone")

    def __init__(
        self,
        partition: Partition,
        levels: FloatArray,
        exponent: float = 10.0,
        seed: int | None = None,
        first_action: int = 0,
    ) -> None:
        levels = validation.real_array("levels", levels)
        self._check_fits("levels", levels, partition)
        if not (levels > 0.0).all():
            raise ValueError(f"levels must all be > 0, got {levels.min():g}.")
        exponent = validation.number("exponent", exponent, above=0)
        seed = validation.seed(seed)
        self.partition = partition
        self.first_action = checked_first_action(first_action)
        n_cells, n_actions = levels.shape
        self._pheromone = Pheromone(n_cells, n_actions, 1.0, exponent)
        self._pheromone.set_levels(levels)
        self._seeds = np.random.SeedSequence(seed)
        self._by_hand = self._stream(0)

    @property
    def table(self) -> FloatArray:
        """The levels, `(n_cells, n_actions)`, read-only."""
        view = self._pheromone.levels.view()
        view.flags.writeable = False
        return view

    @property
    def n_actions(self) -> int:
        """See `PartitionPolicy.n_actions`."""
        return int(self._pheromone.levels.shape[1])

    @property
    def _n_cells(self) -> int:
        return len(self._pheromone.levels)

    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        return self._draw(self._by_hand, index, degree, allowed)

    def _act_in_state(
        self, state: Any, episode_start: Any, *situation: Any
    ) -> tuple[IntArray, Any]:
        if episode_start is None:
            return super()._act_in_state(state, episode_start, *situation)
        index, degree, _, allowed = situation
        drawn = _drawn(state)
        columns = self._draw(self._stream(drawn), index, degree, allowed)
        return columns, (np.array(drawn + NUMBERS_PER_ACTION * len(columns)),)

    def _draw(
        self,
        rng: np.random.Generator,
        index: CellArray,
        degree: FloatArray,
        allowed: BoolArray | None,
    ) -> IntArray:
        return choose_actions(
            "boltzmann", self._pheromone, index, degree, 0.0, rng, allowed
        )

    def _stream(self, drawn: int) -> np.random.Generator:
        """The generator of the seed, advanced by `drawn` numbers."""
        return np.random.Generator(np.random.PCG64(self._seeds).advance(drawn))


def _drawn(state: Any) -> int:
    """How many numbers an evaluation has drawn, from the state of `SoftPolicy`."""
    if state is None:
        return 0
    if not isinstance(state, tuple) or len(state) != 1 or np.ndim(state[0]) != 0:
        raise ValueError(
            "state must be None at first, and then what predict returned, got "
            f"{validation.shown(state)}."
        )
    value = state[0].item() if isinstance(state[0], np.ndarray) else state[0]
    return validation.integer("the number in state", value, at_least=0)
