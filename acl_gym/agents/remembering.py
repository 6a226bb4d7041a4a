"""The base of agents that remember what was done, and whose partition may grow."""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.agents.base import TabularAgent
from acl_gym.agents.growth import Growth, carried_with_known
from acl_gym.agents.saving import with_prefix
from acl_gym.colony.memory import Memory
from acl_gym.colony.optimism import promised_level
from acl_gym.colony.walk import Walk
from acl_gym.partitions import Grid, Partition
from acl_gym.partitions.growing import initial_partition
from acl_gym.utils import validation
from acl_gym.utils.parameters import Parameter
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray, Row

logger = logging.getLogger("acl_gym")


class RememberingAgent(TabularAgent):
    """An agent with a memory, which a partition that grows locates anew.

    The memory is made when it is first needed, so that an agent may do without it.

    Args:
        env: a vector environment with `Discrete` actions.
        partition: turns observations into cells and degrees. None: it is chosen; one
            that grows begins coarse.
        grows: whether the partition becomes wider and finer.
        grows_where: where it becomes finer first, see `Growth`.
        memory_size: how many states are remembered, >= 1.
        max_steps: see `TabularAgent`.
        seed: see `TabularAgent`.
        n_actions: see `TabularAgent`.
        of_other_bases: what the next base takes, where there is another.
    """

    always_remembers: ClassVar[bool] = False
    """Whether it has a memory whatever its parameters are."""

    discount: Parameter
    """gamma_rl, weight of what follows a step."""

    max_cells: Parameter
    """The partition does not become finer than this."""

    visits_to_grow: Parameter
    """Steps that are remembered for each pair and state variable before cells are split."""

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None,
        *,
        grows: bool,
        grows_where: str,
        memory_size: int,
        max_steps: int | None,
        seed: int | None,
        n_actions: int | None,
        **of_other_bases: Any,
    ) -> None:
        self._growth = Growth(grows, grows_where)
        self._kept_memory: Memory | None = None
        self.memory_size = memory_size
        if partition is None and self.grows and env is not None:
            partition = initial_partition(env, self.max_cells)
        super().__init__(
            env,
            partition,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
            **of_other_bases,
        )

    @property
    @abstractmethod
    def _known(self) -> BoolArray:
        """Whether anything was learned of each pair, `(n_cells, n_actions)`."""

    @abstractmethod
    def _set_partition(
        self, partition: Partition, table: FloatArray, known: BoolArray
    ) -> None:
        """Take over a partition, its table and what of it is known."""
        self._replace_partition(partition)

    @property
    def _remembers(self) -> bool:
        """Whether it has a memory, or is to have one."""
        return self.always_remembers

    @property
    def _memory(self) -> Memory:
        if self._kept_memory is None:
            self._kept_memory = Memory(self.memory_size, self.n_actions, self.partition)
        return self._kept_memory

    @property
    def memory_size(self) -> int:
        """How many states are remembered; the next walk forgets the oldest beyond that."""
        return self._memory_size

    @memory_size.setter
    def memory_size(self, value: int) -> None:
        self._memory_size = validation.integer(
            "memory_size", value, at_least=1, at_most=2**25
        )
        if self._kept_memory is not None:
            self._kept_memory.most = self._memory_size

    @property
    def grows(self) -> bool:
        """Whether the partition becomes wider and finer."""
        return self._growth.on

    @grows.setter
    def grows(self, value: bool) -> None:
        self._growth.on = value

    @property
    def grows_where(self) -> str:
        """Where the partition becomes finer first: "tried", "varied" or "everywhere"."""
        return self._growth.where

    @grows_where.setter
    def grows_where(self, value: str) -> None:
        self._growth.where = value

    @property
    def remembered_steps(self) -> int:
        """How many steps are remembered."""
        return 0 if self._kept_memory is None else self._kept_memory.n_steps

    def forget(self, keep: int = 0) -> None:
        """Forget what was done, but for the newest; what was learned of it stays.

        For a plant that has changed: remembered paths would pull levels back to what
        they were.

        Args:
            keep: how many states are still remembered, >= 0; only whole paths are kept.

        Raises:
            ValueError: `keep` is negative.
            TypeError: it is not an integer.
        """
        keep = validation.integer("keep", keep, at_least=0)
        if self._kept_memory is not None:
            self._kept_memory.forget(keep)

    def _remember(self, walk: Walk) -> IntArray:
        """Remember what was done, in a partition wide enough; the numbers of its paths."""
        if self.grows and isinstance(self.partition, Grid):
            space: Any = self.rollout.env.single_observation_space
            wider = self._growth.wider(
                self.partition, walk.states(), space, self.max_cells
            )
            if wider is not None:
                self._grow_to(wider)
                logger.info("The range of what is seen has grown: %r.", wider)
        return self._memory.add(walk)

    def _promise(self, optimism: float) -> None:
        """Set what pairs promise of which nothing is known yet."""
        level = promised_level(
            self._memory, self._table, optimism, self.discount, self.max_steps
        )
        self._table[~self._known] = level

    def _split(self) -> None:
        """Halve cells along the next variable if there is evidence for finer ones."""
        finer = self._growth.finer(
            self.partition,
            self._memory.evidence,
            self._table,
            self.visits_to_grow,
            self.max_cells,
        )
        self._grow_to(finer)

    def _grow_to(self, partition: Grid | None) -> None:
        """Take over a partition that has grown, if it has; what is known is carried over."""
        if partition is None:
            return
        both = carried_with_known(self._table, self._known, self.partition, partition)
        self._set_partition(partition, *both)
        self._memory.set_partition(partition)

    def measures(self, policy: IntArray) -> Row:
        """How many cells the partition has, and how many steps are remembered."""
        if not self._remembers:
            return {}
        return {
            "cells": self.partition.n_cells,
            "remembered_steps": self.remembered_steps,
        }

    def _arrays(self) -> dict[str, NDArray[Any]]:
        if not self._remembers:
            return {}
        remembered = {f"memory_{n}": a for n, a in self._memory.arrays().items()}
        turn = np.array(self._growth.turn)
        return {"known": self._known, "growth_turn": turn, **remembered}

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        if not self.always_remembers and "known" not in arrays:
            return  # the agent that was saved remembered nothing
        known = arrays["known"]
        if known.shape != self._table.shape or known.dtype.kind != "b":
            raise ValueError("the array known does not fit the table")
        self._known[:] = known
        self._growth.restore(arrays["growth_turn"])
        self._memory.restore(with_prefix("memory_", arrays))

    def _state(self) -> Any:
        # What is remembered is shared with the agent, not copied.
        kept = self._kept_memory
        return (
            self.partition,
            self._ranks,
            self._known.copy(),
            self._growth.turn,
            None if kept is None else kept.copy(),
        )

    def _take_over(self, table: FloatArray, state: Any) -> None:
        partition, ranks, known, self._growth.turn, memory = state
        if partition is not self.partition:
            self._set_partition(partition, table.copy(), known.copy())
        self._table[:], self._known[:] = table, known
        self._ranks = ranks
        self._kept_memory = None
        if memory is not None:
            self._kept_memory = memory.copy()
            self._kept_memory.most = self.memory_size  # parameters are not taken back
