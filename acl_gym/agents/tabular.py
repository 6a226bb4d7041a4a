"""What the colony and Q-learning share: a table over a partition, and its policy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym import storage, validation
from acl_gym.agents.policy import RankArray, TablePolicy, random_ranks
from acl_gym.agents.walk import Walk
from acl_gym.callbacks import Callbacks, Row
from acl_gym.partition import (
    CellArray,
    FloatArray,
    IntArray,
    Partition,
    partition_from_settings,
)


class TabularAgent(ABC):
    """An agent whose policy is the best entry of a (cell, action) table.

    Args:
        env: a vector environment with `Discrete` actions; each slot is one ant.
        partition: turns observations into cells and degrees.
        max_steps: T, the longest an episode may last, >= 1.
        seed: a run is a function of it; None draws one from the system.

    Attributes:
        num_timesteps: steps that all slots have taken together.
        trials: trials finished, k.
        seconds: wall-clock time spent learning, without callbacks.
        history: one row a trial: `trial`, `env_steps`, `seconds` (all three
            cumulated), `ants_cost` (mean J of the ants), `ants_success_rate`,
            `policy_variation` (§3.6.1), what the agent adds in `measures`, and,
            where a `PolicyEvaluation` ran, `policy_cost` (3.47) and `success_rate`.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition,
        *,
        max_steps: int,
        seed: int | None,
        n_actions: int | None = None,
    ) -> None:
        if not isinstance(partition, Partition):
            raise TypeError(
                "partition must be a Partition such as Crisp or Fuzzy, got "
                f"{type(partition).__name__}; build one with Fuzzy.from_box("
                "env.single_observation_space, cells)."
            )
        self.partition = partition
        self.max_steps = validation.integer("max_steps", max_steps, at_least=1)
        if seed is not None:
            seed = validation.integer("seed", seed, at_least=0)
        self.env: VectorEnv[Any, Any, Any] | None = None
        self._walk: Walk | None = None
        self._n_actions = n_actions
        if env is not None:
            self.set_env(env)
        self.num_timesteps = 0
        self.trials = 0
        self.seconds = 0.0
        self.history: list[Row] = []
        self.set_random_seed(seed)

    @property
    @abstractmethod
    def table(self) -> FloatArray:
        """The values the policy maximises, `(n_cells, n_actions)`, a live array."""

    @abstractmethod
    def set_table(self, table: ArrayLike) -> None:
        """Replace the table, for instance by a better one kept from an earlier trial.

        Raises:
            ValueError: the shape differs or an entry is not valid.
        """

    @abstractmethod
    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Learn; see the agent's own docstring."""

    @abstractmethod
    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor, as saved in a file."""

    def measures(self, policy: IntArray) -> Row:
        """More columns for the row of a trial, given the policy `(n_cells,)`."""
        return {}

    @abstractmethod
    def _explore(self, index: CellArray, degree: FloatArray) -> IntArray:
        """Choose actions as in learning, with `self._predict_rng`."""

    @property
    def n_actions(self) -> int:
        """The number of actions."""
        if self._n_actions is None:
            raise ValueError("the agent has no environment; call set_env(env) first.")
        return self._n_actions

    @property
    def walk(self) -> Walk:
        """The slots of the environment, ready to walk."""
        if self._walk is None:
            raise ValueError("the agent has no environment; call set_env(env) first.")
        return self._walk

    @property
    def num_envs(self) -> int:
        """The number of slots: M, the number of ants."""
        return int(self.walk.env.num_envs)

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """Learn on another environment from now on, also with other slots.

        Raises:
            TypeError: `env` is not a vector environment.
            ValueError: its actions are not as many as the table has.
        """
        walk = Walk(env, self.max_steps)
        if self._n_actions not in (None, walk.n_actions):
            raise ValueError(
                f"env must have {self._n_actions} actions as the table has, got "
                f"{walk.n_actions}."
            )
        self._n_actions = walk.n_actions
        self.env = env
        self._walk = walk
        k = self.partition.cells_per_state
        self._index: CellArray = np.zeros((env.num_envs, k), dtype=np.int32)
        self._degree: FloatArray = np.zeros((env.num_envs, k))

    def set_random_seed(self, seed: int | None) -> None:
        """Begin the agent's random numbers anew.

        Three independent streams: learning, exploring predictions, and the ranks by
        which ties of the policy are broken, so that asking the agent for an action
        never changes what it learns.
        """
        self.seed = seed
        learning, predicting, ties = np.random.SeedSequence(seed).spawn(3)
        self.rng = np.random.default_rng(learning)
        self._predict_rng = np.random.default_rng(predicting)
        self._ranks: RankArray = random_ranks(
            self.partition.n_cells, self.n_actions, np.random.default_rng(ties)
        )

    @property
    def policy(self) -> TablePolicy:
        """The policy as it is now; it follows the table until you `copy()` it."""
        first_action = 0 if self._walk is None else self._walk.first_action
        return TablePolicy(self.partition, self.table, self._ranks, first_action)

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose actions, with the signature of Stable-Baselines3.

        Args:
            observation: one observation or a batch of them.
            state: passed through; the agent has no memory.
            episode_start: not used.
            deterministic: True follows the policy (4.16); ties are broken by ranks
                drawn once, so that it is a function. False explores as in learning.

        Returns:
            `(actions, state)`; the action of a single observation has no axis.

        Raises:
            ValueError: an observation is not finite or has the wrong shape.
        """
        policy = self.policy
        if deterministic:
            return policy.predict(observation, state)
        batch = np.asarray(observation)
        single = batch.ndim == self.partition.state_ndim
        index, degree = self.partition(batch[None] if single else batch)
        actions = self._explore(index, degree) + policy.first_action
        return (actions[0] if single else actions), state

    def _locate(
        self, observation: NDArray[Any], ants: IntArray
    ) -> tuple[CellArray, FloatArray]:
        """`(index, degree)` of the walking ants, valid until the next call."""
        m = ants.size
        self.partition.locate(observation, ants, self._index, self._degree)
        return self._index[:m], self._degree[:m]

    def _next_seed(self) -> int:
        """The seed of the next trial: environments follow the agent's own stream."""
        return int(self.rng.integers(2**31))

    def save(self, path: str | Path) -> Path:
        """Write the agent to one `.npz` file, without pickle, in one piece.

        Returns:
            The path written, with `.npz` added where it was missing.
        """
        header = {
            "agent": type(self).__name__,
            "parameters": self.parameters(),
            "partition": self.partition.settings(),
            "n_actions": self.n_actions,
            "num_timesteps": self.num_timesteps,
            "trials": self.trials,
            "seconds": self.seconds,
            "history": self.history,
            "generators": [
                rng.bit_generator.state for rng in (self.rng, self._predict_rng)
            ],
        }
        arrays: dict[str, NDArray[Any]] = {"table": self.table, "ranks": self._ranks}
        return storage.save(path, header, arrays)

    @classmethod
    def load(
        cls, path: str | Path, env: VectorEnv[Any, Any, Any] | None = None
    ) -> Self:
        """Read an agent that `save` wrote; learning goes on where it stopped.

        Args:
            path: the file, with or without `.npz`.
            env: the environment to learn on; not needed to predict.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is not one of ours, is damaged, or holds another
                kind of agent.
        """
        header, arrays = storage.load(path)
        if header.get("agent") != cls.__name__:
            raise ValueError(
                f"{path} must hold a {cls.__name__}, got {header.get('agent')!r}; "
                "load it with that class."
            )
        try:
            agent = cls(
                env,
                partition_from_settings(header["partition"]),
                n_actions=header["n_actions"],
                **header["parameters"],
            )
            agent.set_table(arrays["table"])
            agent._ranks[:] = arrays["ranks"]
            agent.num_timesteps = header["num_timesteps"]
            agent.trials = header["trials"]
            agent.seconds = header["seconds"]
            agent.history = header["history"]
            generators = (agent.rng, agent._predict_rng)
            for rng, state in zip(generators, header["generators"], strict=True):
                rng.bit_generator.state = state
        except (KeyError, TypeError) as error:
            raise ValueError(f"{path} is damaged: {error}.") from error
        return agent
