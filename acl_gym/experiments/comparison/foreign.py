"""Any environment of Gymnasium as a system on which methods are compared.

It has no model, no states to start evaluations from, and perhaps rewards that are not
negative costs. So policies are evaluated over random episodes, nothing is held against
an optimum, and returns are reported. The settings are general ones, not tuned.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium as gym
from gymnasium.vector import VectorEnv

from acl_gym.agents.suitable import PROBES, suitable_deposit
from acl_gym.envs.limits import usual_max_steps
from acl_gym.envs.wrappers.waiting import WaitingVectorEnv
from acl_gym.experiments.comparison.tasks import Budget, System
from acl_gym.experiments.study import Study, Task
from acl_gym.partitions import KINDS, Partition
from acl_gym.partitions.automatic import automatic_partition
from acl_gym.partitions.discrete import FINITE_SPACES
from acl_gym.utils.serialization import to_settings
from acl_gym.utils.typing import FloatArray
from acl_gym.utils.vector_envs import has_independent_slots

EPISODES = 100
"""Episodes of an evaluation, the same in each."""

RANDOM_STEPS = 10_000
"""Random steps from which missing bounds of observations are estimated."""

_SETTINGS: dict[str, dict[str, Any]] = {
    "q": {"learning_rate": 0.1, "discount": 0.99, "epsilon": 0.05},
    "q-lambda": {
        "learning_rate": 0.1,
        "discount": 0.99,
        "epsilon": 0.05,
        "trace_decay": 0.9,
    },
    "q-replay": {
        "learning_rate": 0.3,
        "discount": 0.99,
        "epsilon": 0.1,
        "trace_decay": 0.6,
        "replay": 30,
        "optimism": 1.0,
    },
    "ppo": {"n_steps": 128, "learning_rate": 1e-3, "batch_size": 64},
    "a2c": {"n_steps": 8},
    "dqn": {
        "learning_rate": 1e-3,
        "buffer_size": 50_000,
        "learning_starts": 1_000,
        "batch_size": 64,
        "train_freq": 1,
        "gradient_steps": -1,  # as many as slots
        "target_update_interval": 500,
        "exploration_fraction": 0.2,
        "exploration_final_eps": 0.05,
    },
}

_BUDGETS = {
    "smoke": Budget(2, dqn_steps=1_200, evaluate_every=600, memory_steps=1_200),
    "quick": Budget(
        60, dqn_steps=30_000, evaluate_every=1_500, memory_steps=60_000, on_policy=2
    ),
    "full": Budget(100, dqn_steps=100_000, evaluate_every=2_500, memory_steps=200_000),
}
_SLOTS = 200
NETWORK_SLOTS = {"dqn": 4, "ppo": 8, "a2c": 8}


@dataclass(frozen=True, kw_only=True)
class ForeignTask(Task):
    """An environment of another package as a learner meets it."""

    @property
    def short_name(self) -> str:
        """The name in files: CartPole of CartPole-v1."""
        return re.sub(r"-v\d+$", "", re.split(r"[:/]", self.env_id)[-1])

    def make_env(self, slots: int) -> VectorEnv[Any, Any, Any]:
        """The environment, natively where it can be."""
        name = self.env_id.rpartition(":")[2]
        if has_independent_slots(self.env_id):
            return gym.make_vec(self.env_id, num_envs=slots, **self.env)
        return WaitingVectorEnv.make(name, slots, **self.env)

    def make_partition(self, kind: str, cells: Any = None) -> Partition:
        """The automatic partition; missing bounds are estimated from random steps."""
        return automatic_partition(
            self.make_env(1),
            kind=KINDS[kind],
            cells=cells,
            random_steps=RANDOM_STEPS,
        )

    def evaluation_env(self) -> tuple[VectorEnv[Any, Any, Any], FloatArray | None]:
        """An environment with a slot for each episode; states are random."""
        return self.make_env(EPISODES), None

    def network_evaluation(
        self,
    ) -> tuple[VectorEnv[Any, Any, Any], FloatArray | None, int | None]:
        """As the other methods: networks see the observations as they are."""
        return *self.evaluation_env(), self.longest_evaluation

    def make_network(self, method: str, settings: dict[str, Any], seed: int) -> Any:
        """A model of Stable-Baselines3 with general settings."""
        from stable_baselines3 import A2C, DQN, PPO
        from stable_baselines3.common.vec_env import VecMonitor

        from acl_gym.sb3.adapter import VectorEnvAdapter

        name = self.env_id.rpartition(":")[2]
        env = WaitingVectorEnv.make(name, NETWORK_SLOTS[method], **self.env)
        return {"dqn": DQN, "ppo": PPO, "a2c": A2C}[method](
            "MlpPolicy",
            VecMonitor(VectorEnvAdapter(env)),
            seed=seed,
            device="cpu",
            **settings,
        )

    @cached_property
    def longest_evaluation(self) -> int:
        """T of an evaluation."""
        return usual_max_steps(self.make_env(1))

    @property
    def highest_cost(self) -> float:
        """Nothing is known of it."""
        raise ValueError(
            f"the action values have overflowed in {self.env_id}, whose highest cost is "
            "not known; leave out the method that failed."
        )


@dataclass(frozen=True, kw_only=True)
class ForeignSystem(System):
    """An environment of another package, and how the methods run on it."""

    @property
    def task(self) -> Task:
        """What the learners meet."""
        return self.colony.task

    @property
    def has_model(self) -> bool:
        """Whether dynamic programming can be held against the methods."""
        return False


def foreign_system(env_id: str) -> ForeignSystem:
    """An environment with general settings.

    Args:
        env_id: a registered id, or `module:id`.

    Raises:
        ValueError: its actions are not Discrete, or its observations have no bounds
            that can be estimated.
    """
    task = ForeignTask(env_id=env_id)
    env = task.make_env(PROBES)
    settings: dict[str, Any] = {"max_steps": task.longest_evaluation}
    deposit = suitable_deposit(env, task.longest_evaluation)
    if deposit is not None:
        settings["deposit"] = to_settings(deposit)
    task.make_partition("fuzzy")  # fails now where there is none
    finite = isinstance(env.single_observation_space, FINITE_SPACES)
    return ForeignSystem(
        label=env_id,
        colony=Study(
            task=task,
            method="acl",
            settings=settings,
            slots=_SLOTS,
            kind="crisp" if finite else "fuzzy",
        ),
        settings=_SETTINGS,
        budgets=_BUDGETS,
        finite=finite,
        optimum=False,
    )
