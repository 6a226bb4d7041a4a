"""Plants that may be asked a few hundred times, for few_interactions.py.

A plant is an environment as the methods meet it: with starts anywhere or at rest, with
its goal and cost known or hidden, and with continuous actions numbered for methods that
choose among numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym import WaitingVectorEnv, evaluate_policy_cost
from acl_gym.envs import ENVIRONMENTS

PENDULUM, NAVIGATION = "acl_gym/Pendulum-v0", "acl_gym/Navigation-v0"

BEST = {PENDULUM: 38.4, NAVIGATION: 55.6}
"""The cost of the best policy known; docs/comparison.md says where it comes from."""

EPISODES = 100
"""Of an evaluation where the environment has no evaluation states."""

VALUES = 5
"""Of each continuous action, from end to end: as many as learn_from_plant takes."""

EVALUATION_SEED = 12_345

_RESTARTS = {
    (PENDULUM, "anywhere"): 10,
    (PENDULUM, "rest"): 40,
    (NAVIGATION, "anywhere"): 40,
}
"""After how many steps learn_from_plant resets a plant."""


ROUNDS = {NAVIGATION: (300, 600)}
"""Interactions after which the colony learns in a model, where that takes long."""


@dataclass(frozen=True)
class Measured:
    """What an evaluation has found; a cost is minus the return."""

    policy_cost: float
    success_rate: float | None


@dataclass(frozen=True)
class PlantTask:
    """A plant and how policies for it are judged.

    Attributes:
        env_id: a registered environment.
        starts: "anywhere", as the environment has it, or "rest", with all variables 0.
        learned_task: whether goal and cost must be learned from rewards and
            terminations, though the environment knows them.
        restart_after: steps after which learn_from_plant resets the plant; None takes
            what is usual, see `_RESTARTS`.

    Raises:
        ValueError: there is no such environment, or it cannot start at rest.
    """

    env_id: str
    starts: str = "anywhere"
    learned_task: bool = False
    restart_after: int | None = None

    def __post_init__(self) -> None:
        if self.env_id not in gym.registry:
            raise ValueError(
                f"--env must be a registered environment, got {self.env_id!r}; see "
                "acl-gym envs."
            )
        seen = self._plain.single_observation_space
        if not isinstance(seen, spaces.Box) or len(seen.shape) != 1:
            raise ValueError(
                "--env needs observations that are numbers, a Box of one axis, got "
                f"{seen} of {self.env_id}."
            )
        if self.starts == "rest" and not self.is_own:
            raise ValueError(
                "--starts rest needs an environment of this package, whose state can be "
                f"set, got {self.env_id}; leave it out."
            )

    @property
    def is_own(self) -> bool:
        """Whether it is of this package, and has evaluation states."""
        return self.env_id in ENVIRONMENTS

    @property
    def steps_of_a_run(self) -> int | None:
        """After how many steps learn_from_plant resets the plant; None: at its limit."""
        usual = _RESTARTS.get((self.env_id, self.starts))
        return usual if self.restart_after is None else self.restart_after

    @property
    def limit(self) -> int:
        """The registered limit of an episode, or 300."""
        return int(gym.spec(self.env_id).max_episode_steps or 300)

    @property
    def best(self) -> float | None:
        """The cost of the best policy known, if one is."""
        return BEST.get(self.env_id)

    def plant(self) -> Any:
        """What learn_from_plant runs: one slot, continuous actions as they are."""
        if self.is_own:
            return gym.make_vec(self.variant, num_envs=1)
        return gym.make(self.env_id)

    @cached_property
    def variant(self) -> str:
        """The id of the plant with numbered actions, which all other methods meet."""
        if not self.is_own and not isinstance(
            self._plain.single_action_space, spaces.Box
        ):
            return self.env_id
        known = self.learned_task, self.starts
        if self.is_own and known == (False, "anywhere"):
            return self.env_id
        words = "-".join(["hidden"] * self.learned_task + [self.starts])
        name = f"few_interactions/{self.env_id.replace('/', '-')}-{words}-v0"
        if name not in gym.registry:
            make = self._own_variant if self.is_own else self._numbered
            gym.register(name, max_episode_steps=self.limit, **make())
        return name

    def measure(self, policy: Any) -> Measured:
        """Follow a policy without exploration.

        Args:
            policy: `predict` gives numbers of actions, as they are counted in `variant`.
        """
        if self.is_own:
            found = evaluate_policy_cost(policy, self._plain)
        else:
            env = WaitingVectorEnv([lambda: gym.make(self.variant)] * EPISODES)
            found = evaluate_policy_cost(
                policy, env, seed=EVALUATION_SEED, max_steps=self.limit
            )
            env.close()
        return Measured(found.cost, found.success_rate)

    @cached_property
    def _plain(self) -> VectorEnv[Any, Any, Any]:
        if self.is_own:
            return gym.make_vec(self.env_id, num_envs=1)
        return WaitingVectorEnv([lambda: gym.make(self.env_id)])

    def _own_variant(self) -> dict[str, Any]:
        """The native environment with another start, or without its task."""
        base: Any = type(self._plain.unwrapped)
        changes: dict[str, Any] = {}
        if self.learned_task:
            changes["task"] = property(lambda system: None)
        if self.starts == "rest":
            changes["sample_states"] = _at_rest
        system = type(base.system_type.__name__, (base.system_type,), changes)
        found = type(base.__name__, (base,), {"system_type": system})
        return {"vector_entry_point": found, "entry_point": None}

    def _numbered(self) -> dict[str, Any]:
        """A single environment whose continuous actions are numbered."""
        space: Any = self._plain.single_action_space
        if len(space.shape) != 1 or not space.is_bounded():
            raise ValueError(
                "--env needs Discrete actions or a bounded Box of one axis, got "
                f"{space} of {self.env_id}."
            )
        values = numbered_values(space)
        name = self.env_id

        def make(**how: Any) -> gym.Env[Any, Any]:
            return NumberedActions(gym.make(name, **how), values)

        return {"entry_point": make}


class NumberedActions(gym.ActionWrapper):  # type: ignore[type-arg]
    """An environment with continuous actions, of which some are numbered."""

    def __init__(self, env: gym.Env[Any, Any], values: NDArray[np.float64]) -> None:
        super().__init__(env)
        self._values = values.astype(env.action_space.dtype)
        self.action_space = spaces.Discrete(len(values))

    def action(self, action: Any) -> Any:
        """The values that belong to a number."""
        return self._values[int(action)].copy()


def numbered_values(space: spaces.Box) -> NDArray[np.float64]:
    """Values from end to end of each dimension, `(n_actions, n_inputs)`."""
    count = math.prod(space.shape)
    lines = [
        np.linspace(low, high, VALUES)
        for low, high in zip(space.low, space.high, strict=True)
    ]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, count)


def _at_rest(system: Any, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    return np.zeros((system.observation_space.shape[0], count))
