"""Policies over a partition: the result of every method of this package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from acl_gym.colony.greedy import NUMBERS_PER_ACTION, greedy_actions
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import choose_actions
from acl_gym.partitions import Partition
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, RankArray


def random_ranks(n_cells: int, n_actions: int, rng: np.random.Generator) -> RankArray:
    """A random order of the actions for each cell, `(n_cells, n_actions)`.

    Ties are broken at random (4.16). Drawing the order once makes the policy a function
    (a decision).
    """
    ranks = np.tile(np.arange(n_actions, dtype=np.int32), (n_cells, 1))
    return np.asarray(rng.permuted(ranks, axis=1), dtype=np.int32)


class Action(np.ndarray[tuple[()], np.dtype[np.int64]]):
    """One action: an array without axes, as Stable-Baselines3 gives it, with a hash.

    The environments of `gymnasium.envs.toy_text` look actions up in a dict, where a
    plain array without axes is refused. What is calculated with it is plain again.
    """

    def __hash__(self) -> int:  # type: ignore[override]
        """That of the number, to which it is equal."""
        return hash(self.item())

    def __array_wrap__(
        self, array: Any, context: Any = None, return_scalar: bool = False
    ) -> Any:
        """The result of a calculation, a number where it has no axes."""
        return array[()]


class PartitionPolicy(ABC):
    """A policy that sees cells and degrees, with Stable-Baselines3's `predict`.

    Attributes:
        partition: turns observations into cells and degrees.
        first_action: the action that column 0 of a table stands for,
            `Discrete.start`.
    """

    partition: Partition
    first_action: int

    @property
    @abstractmethod
    def n_actions(self) -> int:
        """The number of actions, the columns of the table."""

    @staticmethod
    def _check_fits(name: str, table: FloatArray, partition: Partition) -> None:
        """Refuse a table that has not one row per cell: kernels do not check indices.

        Raises:
            ValueError: the table does not fit the partition.
        """
        if table.ndim != 2 or len(table) != partition.n_cells:
            raise ValueError(
                f"{name} must have shape ({partition.n_cells}, n_actions), a row for "
                f"each cell of the partition, got shape {table.shape}."
            )

    @abstractmethod
    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        """Choose columns of the table, `(n,)`, for cells and degrees `(n, k)`."""

    def _act_in_state(
        self, state: Any, episode_start: Any, *situation: Any
    ) -> tuple[IntArray, Any]:
        """Choose by `_act(*situation)`; return the next state with the columns."""
        return self._act(*situation), state

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
        action_masks: ArrayLike | None = None,
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose actions, as in Stable-Baselines3 but for the default of `deterministic`.

        There it is False, since its agents learn policies that draw their actions. Here
        the policy is a function of the observation, and random actions belong to
        learning; who asks for an action gets that of the policy.

        Args:
            observation: one observation or a batch of them, an array or lists, of any
                real dtype.
            state: returned as it is, except by a `SoftPolicy`; a table has no memory.
            episode_start: only used by a `SoftPolicy`.
            deterministic: True follows the policy; False makes an agent explore as it
                does in learning. A policy that is not an agent does not explore and
                follows itself in both cases.
            action_masks: which actions may be chosen, `(n_actions,)` or
                `(n, n_actions)`, such as `info["action_mask"]`; None: all.

        Returns:
            `(actions, state)`, the actions as an int64 array `(n,)`, for a single
            observation `()`, ready for `env.step`.

        Raises:
            ValueError: an observation is not finite or has the wrong shape, or a mask
                has the wrong shape or allows nothing.
        """
        batch = np.asarray(observation)
        single = batch.ndim == self.partition.state_ndim
        index, degree = self.partition(batch[None] if single else batch)
        allowed = self._checked_masks(action_masks, len(index))
        columns, state = self._act_in_state(
            state, episode_start, index, degree, deterministic, allowed
        )
        actions = columns + self.first_action
        return (actions.reshape(()).view(Action) if single else actions), state

    def _checked_masks(self, masks: ArrayLike | None, count: int) -> BoolArray | None:
        if masks is None:
            return None
        allowed = np.asarray(masks) != 0
        if allowed.ndim == 1:
            allowed = allowed[None]
        shape = (count, self.n_actions)
        if allowed.shape != shape or not allowed.any(axis=1).all():
            raise ValueError(
                f"action_masks must have shape {shape} and allow an action in each "
                f"row, got {np.asarray(masks).tolist()!r:.200}."
            )
        return np.ascontiguousarray(allowed)


class TablePolicy(PartitionPolicy):
    """The greedy policy, eq. (4.16): the action of the largest degree-weighted entry.

    Args:
        partition: turns observations into cells and degrees.
        table: `(n_cells, n_actions)`, pheromone levels or action values.
        ranks: `(n_cells, n_actions)`, the order in which tied actions are preferred;
            None draws it from a fixed seed.
        first_action: the action that column 0 stands for, `Discrete.start`.

    Raises:
        ValueError: `table` or `ranks` do not fit the partition.
    """

    def __init__(
        self,
        partition: Partition,
        table: FloatArray,
        ranks: RankArray | None = None,
        first_action: int = 0,
    ) -> None:
        if table.dtype != np.float64:
            raise ValueError(f"table must be float64, got {table.dtype}.")
        self._check_fits("table", table, partition)
        n_cells, n_actions = table.shape
        if ranks is None:
            ranks = random_ranks(n_cells, n_actions, np.random.default_rng(0))
        if ranks.shape != table.shape:
            raise ValueError(
                f"ranks must have the shape of the table, {table.shape}, got "
                f"{ranks.shape}."
            )
        self.partition = partition
        self.table = table
        self.ranks = ranks
        self.first_action = first_action

    @property
    def n_actions(self) -> int:
        """See `PartitionPolicy.n_actions`."""
        return int(self.table.shape[1])

    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        return greedy_actions(self.table, self.ranks, index, degree, allowed)

    def best_actions(self) -> IntArray:
        """The greedy policy, eq. (3.10): the best column of each cell, `(n_cells,)`."""
        return _best_actions(self.table, self.ranks)

    def copy(self) -> TablePolicy:
        """The same policy over a table that no longer changes."""
        return TablePolicy(
            self.partition, self.table.copy(), self.ranks, self.first_action
        )


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
        self.first_action = first_action
        n_cells, n_actions = levels.shape
        self._pheromone = Pheromone(n_cells, n_actions, 1.0, exponent)
        self._pheromone.set_levels(levels)
        self._seeds = np.random.SeedSequence(seed)
        self._by_hand = self._stream(0)

    @property
    def n_actions(self) -> int:
        """See `PartitionPolicy.n_actions`."""
        return int(self._pheromone.levels.shape[1])

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
        drawn = 0 if state is None else int(state[0])
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


@njit(cache=True)
def _best_actions(table: FloatArray, ranks: RankArray) -> IntArray:
    best = np.zeros(table.shape[0], dtype=np.int64)
    for cell in range(table.shape[0]):
        for u in range(1, table.shape[1]):
            lead = table[cell, u] - table[cell, best[cell]]
            if lead > 0.0 or (lead == 0.0 and ranks[cell, u] < ranks[cell, best[cell]]):
                best[cell] = u
    return best
