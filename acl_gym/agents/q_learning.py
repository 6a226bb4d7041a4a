"""Q-learning over the same partition and the same slots as the colony."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numba import njit
from numpy.typing import ArrayLike

from acl_gym import validation
from acl_gym.agents.pheromone import BoolArray
from acl_gym.agents.selection import epsilon_greedy_actions
from acl_gym.agents.tabular import TabularAgent
from acl_gym.agents.training import Training
from acl_gym.callbacks import Callbacks
from acl_gym.membership import CellArray, FloatArray, IntArray
from acl_gym.partition import Partition


class QLearning(TabularAgent):
    """Watkins's Q-learning (3.44), all slots learning one table in parallel.

    Through a `Crisp` partition it is tabular Q-learning; through a `Fuzzy` one the
    action value is linear in the degrees, Q(x, u) = sum of beta_i Q_iu, and each cell
    learns in proportion to its degree. Values start at 0, which is optimistic where
    rewards are negative costs, and so makes the slots explore.

    Args:
        env: a vector environment with `Discrete` actions.
        partition: turns observations into cells and degrees; None takes
            `automatic_partition(env)`.
        learning_rate: alpha_rl, in (0, 1].
        discount: gamma_rl, in [0, 1].
        epsilon: probability of a random action, in [0, 1].
        max_steps: the longest an episode may last, >= 1. None takes the limit that the
            environment is registered with, and 300 where it has none.
        seed: a run is a function of it; None draws one from the system.
        n_actions: only needed without an environment.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.
    """

    learning_rate = validation.Number(above=0, at_most=1)
    discount = validation.Number(at_least=0, at_most=1)
    epsilon = validation.Number(at_least=0, at_most=1)

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        learning_rate: float = 0.3,
        discount: float = 0.98,
        epsilon: float = 0.1,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.learning_rate = learning_rate
        self.discount = discount
        self.epsilon = epsilon
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        self._values: FloatArray = np.zeros((self.partition.n_cells, self.n_actions))

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Learn; a trial is one episode in every slot. Arguments as in `ACL.learn`.

        Raises:
            ValueError: the action values have grown beyond all numbers.
        """
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.next_trial():
                walk = self.walk
                observation = walk.start(seed=self._next_seed())
                index, degree = self.partition(observation)
                while walk.ants.size:
                    actions = epsilon_greedy_actions(
                        self._table, index, degree, self.epsilon, self.rng
                    )
                    step = walk.step(actions)
                    next_index, next_degree = self._locate(step.observation, step.ants)
                    _update(
                        self._table,
                        index,
                        degree,
                        actions,
                        step.cost,
                        step.terminated,
                        next_index,
                        next_degree,
                        self.learning_rate,
                        self.discount,
                    )
                    stays = ~step.finished
                    index, degree = next_index[stays], next_degree[stays]
                self._check_values()
                training.end_trial()
        return self

    @property
    def _table(self) -> FloatArray:
        return self._values

    def set_table(self, table: ArrayLike) -> None:
        """Replace the action values.

        Raises:
            ValueError: the shape differs, or a value is not finite.
        """
        values = self._checked_table(table)
        self._values[:] = values

    def _check_values(self) -> None:
        if not np.isfinite(self._values).all():
            raise ValueError(
                "action values must stay finite, but have overflowed in trial "
                f"{self.trials + 1}; scale the rewards down, or lower discount or "
                "learning_rate."
            )

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor."""
        return {
            "learning_rate": self.learning_rate,
            "discount": self.discount,
            "epsilon": self.epsilon,
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        return epsilon_greedy_actions(
            self._table, index, degree, self.epsilon, self._predict_rng, allowed
        )


@njit(cache=True)
def _update(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    costs: FloatArray,
    terminated: np.ndarray,
    next_index: CellArray,
    next_degree: FloatArray,
    learning_rate: float,
    discount: float,
) -> None:
    """(3.44) for one slot after the other, each on the values as they then are.

    Summing the slots' corrections instead would overshoot where many slots share a
    cell: ten of them at a rate of 0.3 would move it three times the way.
    """
    n_actions = values.shape[1]
    for j in range(actions.size):
        u = actions[j]
        best = 0.0
        if not terminated[j]:
            best = -np.inf
            for v in range(n_actions):
                value = 0.0
                for c in range(index.shape[1]):
                    value += next_degree[j, c] * values[next_index[j, c], v]
                best = max(best, value)
        error = -costs[j] + discount * best
        for c in range(index.shape[1]):
            error -= degree[j, c] * values[index[j, c], u]
        for c in range(index.shape[1]):
            values[index[j, c], u] += learning_rate * degree[j, c] * error
