"""The courses of the comparison: what differs between one system and another.

A course is data: slots, partitions, settings of each method, budgets, reference. How
the settings were chosen is in docs/comparison-settings.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import gymnasium as gym
import numpy as np

from acl_gym.partitions import Crisp, Discrete, Fuzzy, Partition
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.utils import validation

Settings = Mapping[str, Any]
"""Keyword arguments of an agent."""

CONTINUOUS = {
    "acl-fuzzy": "ACL, fuzzy",
    "acl-crisp": "ACL, crisp",
    "q-fuzzy": "Q-learning, fuzzy",
    "q-crisp": "Q-learning, crisp",
    "q-lambda-fuzzy": "Q(λ), fuzzy",
    "q-lambda-crisp": "Q(λ), crisp",
    "dqn": "DQN",
}
"""The methods where states are continuous, and what they are called there."""

FINITE = {
    "acl-crisp": "ACL",
    "q-crisp": "Q-learning",
    "q-lambda-crisp": "Q(λ)",
    "dqn": "DQN",
}
"""The methods where a state is a cell, so that nothing is fuzzy."""


@dataclass(frozen=True, kw_only=True)
class Budget:
    """How much of a course is run.

    Attributes:
        trials: K of the table-based methods.
        dqn_steps: environment steps of DQN.
        dqn_every: environment steps between two evaluations of DQN.
        long_run: DQN's settings for long training instead of those for short.
        reference: makes the partition on which the reference is found; None where the
            exact model is there to iterate on.
    """

    trials: int
    dqn_steps: int
    dqn_every: int
    long_run: bool = False
    reference: Callable[[], Any] | None = None


@dataclass(frozen=True, kw_only=True)
class Course:
    """One system and how the methods run on it.

    Attributes:
        env_id: the environment.
        methods: names and labels of the methods that exist here, in order.
        slots: slots of the table-based methods, M ants.
        max_steps: T of their trials.
        partitions: "fuzzy" and "crisp", or "crisp" alone; each makes a partition.
        acl: settings of `ACL`.
        q_learning: settings of `QLearning`.
        q_lambda: the same with `trace_decay`.
        own: what differs for one method by itself, by its name.
        dqn_short: what differs from the defaults of `DQNSettings` in a short run.
        dqn_long: the same in a long run.
        budgets: one for each preset.
        optimum: whether the reference is taken for the optimum J*, or only for the
            best policy known.
        pictures: how policies are pictured, a key of `pictures.PICTURES`.
    """

    env_id: str
    methods: Mapping[str, str]
    slots: int
    max_steps: int
    partitions: Mapping[str, Callable[[], Partition]]
    acl: Settings
    q_learning: Settings
    q_lambda: Settings
    own: Mapping[str, Settings] = field(default_factory=dict)
    dqn_short: Settings = field(default_factory=dict)
    dqn_long: Settings = field(default_factory=dict)
    budgets: Mapping[str, Budget]
    optimum: bool = True
    pictures: Literal["pendulum", "navigation", "grid"]

    def require(self, method: str) -> None:
        """Refuse a method that does not exist here.

        Raises:
            ValueError: it does not.
        """
        validation.one_of("method", method, tuple(self.methods))

    def settings(self, method: str, *, long_run: bool = False) -> Settings:
        """What one method runs with here; of DQN, in a short or in a long run."""
        if method == "dqn":
            return self.dqn_long if long_run else self.dqn_short
        family = method.rpartition("-")[0]
        shared = {"acl": self.acl, "q": self.q_learning, "q-lambda": self.q_lambda}
        return {**shared[family], **self.own.get(method, {})}

    def partition(self, method: str) -> Partition:
        """The partition of a table-based method."""
        return self.partitions[method.rpartition("-")[2]]()


def _both_ways(*distances: float) -> tuple[float, ...]:
    """The distances from 0 and their negatives, in order."""
    return tuple(sorted({sign * each for each in distances for sign in (1.0, -1.0)}))


def _plane(positions: tuple[float, ...], velocities: tuple[float, ...]) -> Fuzzy:
    return Fuzzy((positions, velocities, positions, velocities))


def _navigation_coarse() -> Fuzzy:
    return _plane(
        _both_ways(0.0, 0.1, 0.3, 1.0, 2.0, 3.5, 5.0), _both_ways(0.0, 0.25, 1.0, 2.0)
    )


def _navigation_medium() -> Fuzzy:
    return _plane(
        _both_ways(0.0, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0),
        _both_ways(0.0, 0.1, 0.3, 0.7, 1.3, 2.0),
    )


def _navigation_fine() -> Fuzzy:
    near = (0.0, 0.08, 0.16, 0.25, 0.4, 0.7)
    far = tuple(np.arange(1.0, 5.1, 0.5).tolist())
    return _plane(
        _both_ways(*near, *far), _both_ways(0.0, 0.05, 0.15, 0.4, 0.8, 1.3, 2.0)
    )


PENDULUM = Course(
    env_id="acl_gym/Pendulum-v0",
    methods=CONTINUOUS,
    slots=250,
    max_steps=300,
    partitions={
        "fuzzy": lambda: thesis_partition(
            gym.make("acl_gym/Pendulum-v0"), (40, 41), kind=Fuzzy
        ),
        "crisp": lambda: thesis_partition(
            gym.make("acl_gym/Pendulum-v0"), (40, 41), kind=Crisp
        ),
    },
    # Table 5.2 and the base case of §5.3.
    acl={
        "tau0": 1e-4,
        "local_decay": 0.01,
        "global_decay": 0.1,
        "alpha": 3.0,
        "epsilon": 0.1,
        "selection": "max_boltzmann",
    },
    q_learning={"learning_rate": 0.3, "discount": 0.98, "epsilon": 0.1},
    q_lambda={
        "learning_rate": 0.3,
        "discount": 0.98,
        "epsilon": 0.1,
        "trace_decay": 0.5,
    },
    dqn_long={"exploration_fraction": 0.02, "final_learning_rate": 1e-5},
    budgets={
        # To see that all of it works; its figures mean nothing.
        "smoke": Budget(
            trials=2,
            dqn_steps=1_200,
            dqn_every=400,
            reference=lambda: thesis_partition(
                gym.make("acl_gym/Pendulum-v0"), (100, 101)
            ),
        ),
        "quick": Budget(
            trials=100,
            dqn_steps=20_000,
            dqn_every=1_000,
            reference=lambda: thesis_partition(
                gym.make("acl_gym/Pendulum-v0"), (400, 401)
            ),
        ),
        "full": Budget(
            trials=100,
            dqn_steps=200_000,
            dqn_every=2_000,
            long_run=True,
            reference=lambda: thesis_partition(
                gym.make("acl_gym/Pendulum-v0"), (1600, 1601)
            ),
        ),
    },
    pictures="pendulum",
)

NAVIGATION = Course(
    env_id="acl_gym/Navigation-v0",
    methods=CONTINUOUS,
    # Table 4.1, and the regular partition of §4.5.2.
    slots=200,
    max_steps=150,
    partitions={
        "fuzzy": lambda: thesis_partition(
            gym.make("acl_gym/Navigation-v0"), "regular", kind=Fuzzy
        ),
        "crisp": lambda: thesis_partition(
            gym.make("acl_gym/Navigation-v0"), "regular", kind=Crisp
        ),
    },
    acl={
        "tau0": 1e-3,
        "local_decay": 0.01,
        "global_decay": 0.1,
        "alpha": 3.0,
        "selection": "boltzmann",
    },
    q_learning={"learning_rate": 0.3, "discount": 0.9, "epsilon": 0.1},
    q_lambda={
        "learning_rate": 0.3,
        "discount": 0.95,
        "epsilon": 0.1,
        "trace_decay": 0.9,
    },
    # Bins make the next state uncertain: smaller steps average over it.
    own={
        "q-crisp": {"learning_rate": 0.1, "discount": 0.95},
        "q-lambda-crisp": {"learning_rate": 0.1},
    },
    dqn_short={"reward_scale": 1.0},
    dqn_long={
        "reward_scale": 1.0,
        "exploration_fraction": 0.02,
        "final_learning_rate": 1e-5,
    },
    budgets={
        "smoke": Budget(
            trials=2, dqn_steps=1_200, dqn_every=600, reference=_navigation_coarse
        ),
        "quick": Budget(
            trials=200, dqn_steps=20_000, dqn_every=1_000, reference=_navigation_medium
        ),
        "full": Budget(
            trials=200,
            dqn_steps=200_000,
            dqn_every=2_000,
            long_run=True,
            reference=_navigation_fine,
        ),
    },
    optimum=False,
    pictures="navigation",
)

GRID_1D = Course(
    env_id="acl_gym/GridSearch1D-v0",
    methods=FINITE,
    slots=9,
    max_steps=50,
    partitions={"crisp": lambda: Discrete(10)},
    acl={
        "tau0": 1e-3,
        "local_decay": 0.0,
        "global_decay": 0.1,
        "alpha": 3.0,
        "selection": "boltzmann",
    },
    q_learning={"learning_rate": 0.5, "discount": 1.0, "epsilon": 0.1},
    q_lambda={
        "learning_rate": 0.5,
        "discount": 1.0,
        "epsilon": 0.1,
        "trace_decay": 0.8,
    },
    dqn_short={"max_episode_steps": 50, "learning_starts": 200},
    dqn_long={"max_episode_steps": 50, "learning_starts": 200},
    budgets={
        "smoke": Budget(trials=3, dqn_steps=400, dqn_every=200),
        "quick": Budget(trials=100, dqn_steps=4_000, dqn_every=200),
        "full": Budget(trials=100, dqn_steps=10_000, dqn_every=200, long_run=True),
    },
    pictures="grid",
)

GRID_2D = Course(
    env_id="acl_gym/GridSearch2D-v0",
    methods=FINITE,
    slots=86,
    max_steps=435,
    partitions={"crisp": lambda: Discrete(87)},
    # tabu: the assumption of §3.4.2 that no ant walks in circles.
    acl={
        "tau0": 1e-3,
        "local_decay": 0.01,
        "global_decay": 0.1,
        "alpha": 3.0,
        "selection": "boltzmann",
        "tabu": True,
    },
    q_learning={"learning_rate": 0.5, "discount": 1.0, "epsilon": 0.1},
    q_lambda={
        "learning_rate": 0.5,
        "discount": 1.0,
        "epsilon": 0.1,
        "trace_decay": 0.8,
    },
    dqn_short={"max_episode_steps": 50},
    dqn_long={"max_episode_steps": 50},
    budgets={
        "smoke": Budget(trials=3, dqn_steps=1_200, dqn_every=600),
        "quick": Budget(trials=200, dqn_steps=10_000, dqn_every=500),
        "full": Budget(trials=200, dqn_steps=20_000, dqn_every=500, long_run=True),
    },
    pictures="grid",
)

COURSES = {course.env_id: course for course in (PENDULUM, NAVIGATION, GRID_1D, GRID_2D)}
"""The courses by environment, the default first."""
