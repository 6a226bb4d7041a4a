"""Walks of many ants, made in advance: for the deposit, and to be walked back."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from acl_gym.colony.memory import Memory
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.update_rules import Reinforcement
from acl_gym.colony.walk import Walk
from acl_gym.colony.walking_back import WalkBack
from acl_gym.partitions import Fuzzy

CENTRES = 64, 65
"""Cells of the pendulum's angle and speed, as fine as its partition becomes."""


class Trial:
    """A trial of random walks over a grid, ready for the deposit.

    Args:
        cells: centres of each of the two axes.
        walked: centres per axis, from the first, that the ants visit; 0 means all.
        ants: M.
        steps: T.
    """

    def __init__(
        self, cells: int, walked: int = 0, ants: int = 200, steps: int = 100
    ) -> None:
        rng = np.random.default_rng(1)
        last = (walked or cells) - 1  # the distance between centres is 1
        grid = Fuzzy([np.arange(float(cells))] * 2)
        self.solutions = Solutions(ants, steps, 3, grid)
        everyone, states = np.arange(ants), rng.uniform(0, last, (ants, 2))
        for _ in range(steps):
            moves = rng.normal(scale=0.025 * last, size=states.shape)
            states = np.clip(states + moves, 0, last)
            actions = rng.integers(0, 3, ants)
            self.solutions.append(everyone, states, grid(states)[0], actions)
        self.table = Pheromone(grid.n_cells, 3, 1e-4, 3.0)
        self.deposits = np.full(ants, 1e-3)
        self.reinforcement = Reinforcement(self.table.levels.size)
        self.n_steps = ants * steps

    def deposit(self) -> None:
        """Let all ants lay their deposits, as after a trial."""
        self.reinforcement(self.table, self.solutions, self.deposits, 0.1)


class Remembered:
    """Walks of the pendulum in a memory, and the levels of a colony.

    Three steps of ten are drawn, the others push with the motion, which swings up.

    Args:
        ants: M.
        steps: T, the most steps an ant takes.
    """

    def __init__(self, ants: int, steps: int = 60) -> None:
        env: Any = gym.make_vec("acl_gym/Pendulum-v0", num_envs=ants)
        box, rng = env.single_observation_space, np.random.default_rng(0)
        grid = Fuzzy(
            [
                np.linspace(low, high, count)
                for low, high, count in zip(box.low, box.high, CENTRES, strict=True)
            ]
        )
        walking, walk = np.arange(ants), Walk(ants)
        observation, _ = env.reset(seed=0)
        for _ in range(steps):
            seen, drawn = observation[walking], rng.integers(0, 3, ants)
            pushed = np.where(observation[:, 1] > 0, 2, 0)
            actions = np.where(rng.random(ants) < 0.3, drawn, pushed)
            observation, rewards, terminated, *_ = env.step(actions)
            walk.append(walking, seen, actions[walking], rewards[walking], None)
            done = walking[terminated[walking]]
            if done.size:
                walk.stop(done, observation, np.ones(done.size, np.bool_), None)
                walking = np.setdiff1d(walking, done)
        if walking.size:
            walk.stop(walking, observation, np.zeros(walking.size, np.bool_), None)
        self.memory = Memory(ants * (steps + 1), 3, grid)
        self.paths = self.memory.add(walk)
        self.n_steps = self.memory.n_steps
        self.ants = WalkBack(-50.0 * rng.random((grid.n_cells, 3)))

    def walk_back(self) -> None:
        """Let all ants walk back once, and merge what they laid."""
        self.ants.walk(
            self.memory,
            self.paths,
            discount=0.99,
            mix=0.2,
            rate=0.9,
            trust=1.0,
            bounds=(-1_000.0, 0.0),
        )
