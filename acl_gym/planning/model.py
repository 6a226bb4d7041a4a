"""The model of a finite Markov decision process, read from an environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv, VectorEnv
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class TabularModel:
    """What each action does in each state: the model of a finite MDP.

    Each array is `(n_states, n_actions, n_outcomes)`. Every action has the same number
    of outcomes; those that cannot happen have probability 0.

    Args:
        probability: transition probabilities P of the Bellman equation (3.39), each
            >= 0, summing to 1 over the outcomes.
        next_state: the state that an outcome leads to, counted from 0.
        reward: its reward R.
        terminated: whether the episode ends with this outcome.
        first_state: the observation of state 0, `Discrete.start`.
        first_action: the environment's number for action 0, `Discrete.start`.

    Raises:
        ValueError: shapes differ, probabilities are negative or do not sum to 1, a
            state is out of range, or a reward is not finite.
    """

    probability: FloatArray
    next_state: IntArray
    reward: FloatArray
    terminated: BoolArray
    first_state: int = 0
    first_action: int = 0

    def __post_init__(self) -> None:
        probability = validation.real_array("probability", self.probability, ndim=3)
        reward = validation.real_array("reward", self.reward, ndim=3)
        next_state = self._like(probability, "next_state", "iu", "integers")
        terminated = self._like(probability, "terminated", "b", "bools")
        if reward.shape != probability.shape:
            raise ValueError(
                f"reward must have the shape of probability, {probability.shape}, got "
                f"{reward.shape}."
            )
        total = probability.sum(axis=2)
        wrong = (probability < 0).any(axis=2) | ~np.isclose(total, 1, rtol=0, atol=1e-9)
        if wrong.any():
            state, action = np.argwhere(wrong)[0]
            raise ValueError(
                "probability must be >= 0 and sum to 1 over the outcomes, got "
                f"{probability[state, action].tolist()} for action {action} in state "
                f"{state}."
            )
        if next_state.min() < 0 or next_state.max() >= len(probability):
            raise ValueError(
                f"next_state must lie in 0..{len(probability) - 1}, got "
                f"{next_state.min()} to {next_state.max()}."
            )
        # Read-only copies, so that nobody else can change the model.
        arrays: dict[str, NDArray[Any]] = {
            "probability": probability,
            "next_state": next_state.astype(np.int64),
            "reward": reward,
            "terminated": terminated.copy(),
        }
        for name, kept in arrays.items():
            kept.flags.writeable = False
            object.__setattr__(self, name, kept)

    def _like(
        self, probability: FloatArray, name: str, kinds: str, wanted: str
    ) -> NDArray[Any]:
        """Check an argument before it is copied; a view may stand for far more."""
        array = validation.as_array(getattr(self, name))
        if (
            array is not None
            and array.shape == probability.shape
            and array.dtype.kind in kinds
        ):
            return array
        got = f"{array.dtype} in {array.shape}" if array is not None else "no array"
        raise ValueError(
            f"{name} must hold {wanted} in the shape of probability, "
            f"{probability.shape}, got {got}."
        )

    @property
    def n_states(self) -> int:
        """The number of states."""
        return int(self.probability.shape[0])

    @property
    def n_actions(self) -> int:
        """The number of actions."""
        return int(self.probability.shape[1])

    @classmethod
    def from_env(cls, env: gym.Env[Any, Any] | VectorEnv[Any, Any, Any]) -> Self:
        """Read the model of an environment that publishes it.

        This works for environments of this package whose system has `outcomes()`, and
        for those with a table `P`, such as Gymnasium's FrozenLake, CliffWalking and
        Taxi, alone or in a `SyncVectorEnv`. Wrappers are ignored: what they change is
        not in the model.

        Raises:
            TypeError: the environment does not publish its model.
        """
        base: Any = getattr(env, "unwrapped", env)
        if isinstance(base, SyncVectorEnv):
            base = base.envs[0].unwrapped
        outcomes = getattr(getattr(base, "system", None), "outcomes", None)
        table = getattr(base, "P", None)
        if outcomes is not None:
            probability, next_state, reward, terminated = outcomes()
        elif isinstance(table, dict) and table:
            probability, next_state, reward, terminated = _arrays_of(table)
        else:
            raise TypeError(
                "env must publish its model, as outcomes() of its system or as a table "
                f"P[state][action], got {type(base).__name__}; build a TabularModel "
                "from arrays, or learn with QLearning, which needs no model."
            )
        vector = isinstance(base, VectorEnv)
        seen = base.single_observation_space if vector else base.observation_space
        done = base.single_action_space if vector else base.action_space
        first_state = int(seen.start) if isinstance(seen, spaces.Discrete) else 0
        return cls(
            probability,
            next_state,
            reward,
            terminated,
            first_state=first_state,
            first_action=int(done.start),
        )


def _arrays_of(
    table: dict[int, dict[int, list[tuple[float, int, float, bool]]]],
) -> tuple[FloatArray, IntArray, FloatArray, BoolArray]:
    """The arrays of a model from `P[state][action]`, padded with probability 0."""
    n_states, n_actions = len(table), len(table.get(0, ()))
    if set(table) != set(range(n_states)) or any(
        set(row) != set(range(n_actions)) for row in table.values()
    ):
        raise ValueError(
            "P must have the keys P[0..n_states - 1][0..n_actions - 1], with the same "
            "actions for each state; number states and actions from 0."
        )
    most = max(len(listed) for row in table.values() for listed in row.values())
    shape = (n_states, n_actions, most)
    probability, reward = np.zeros(shape), np.zeros(shape)
    next_state = np.zeros(shape, dtype=np.int64)
    terminated = np.ones(shape, dtype=np.bool_)
    for state, row in table.items():
        for action, listed in row.items():
            for i, outcome in enumerate(listed):
                at = state, action, i
                probability[at], next_state[at], reward[at], terminated[at] = outcome
    return probability, next_state, reward, terminated
