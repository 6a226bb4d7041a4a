"""What colonies share: when their ants set out."""

from __future__ import annotations

from typing import Any, ClassVar

from gymnasium.vector import VectorEnv

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.limits import time_limit
from acl_gym.evaluation.rollout import Rollout
from acl_gym.evaluation.stream import Stream
from acl_gym.partitions import Partition
from acl_gym.utils import validation
from acl_gym.utils.parameters import fixed

SCHEDULES = ("synchronous", "asynchronous")
"""In which all ants wait for the last, or none waits (§7.3)."""


class ColonyAgent(TabularAgent):
    """An agent whose slots are ants, which set out together or one by one.

    Args:
        env: see `TabularAgent`.
        partition: see `TabularAgent`.
        schedule: one of `SCHEDULES`.
        max_steps: see `TabularAgent`.
        seed: see `TabularAgent`.
        n_actions: see `TabularAgent`.

    Raises:
        ValueError: there is no such schedule, or `env` cannot keep to it.
    """

    slots_are = "ants"

    _completes: ClassVar[bool]
    """Of the asynchronous schedule: whether episodes are completed, see `Stream`."""

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        schedule: str,
        max_steps: int | None,
        seed: int | None,
        n_actions: int | None = None,
    ) -> None:
        self._schedule = validation.one_of("schedule", schedule, SCHEDULES)
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )

    @property
    def schedule(self) -> str:
        """When ants set out again; fixed once the agent is made."""
        return self._schedule

    @schedule.setter
    def schedule(self, value: str) -> None:
        raise fixed("schedule", value)

    @property
    def is_asynchronous(self) -> bool:
        """Whether no ant waits for another."""
        return self._schedule == "asynchronous"

    def _new_rollout(self, env: VectorEnv[Any, Any, Any]) -> Rollout:
        if not self.is_asynchronous:
            return super()._new_rollout(env)
        limit = time_limit(env)
        return Stream(env, self.max_steps, limit, completes=self._completes)
