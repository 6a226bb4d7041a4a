"""Small environments whose best values are known in closed form."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv

from acl_gym.planning.model import TabularModel

Outcome = tuple[float, int, float, bool]
Table = dict[int, dict[int, list[Outcome]]]


def corridor(length: int, success: float = 1.0, jump: int = 0) -> Table:
    """Cells in a row, the goal in the last; each step costs 1.

    Action 0 leads one cell on, with probability `success`, and else nowhere. With
    `jump`, action 1 leads so many cells on from cell 0, and nowhere from all others.
    """
    goal = length - 1
    table: Table = {}
    for cell in range(goal):
        following: list[Outcome] = [(success, cell + 1, -1.0, cell + 1 == goal)]
        if success < 1:
            following.append((1 - success, cell, -1.0, False))
        table[cell] = {0: following}
        if jump:
            end = jump if cell == 0 else cell
            table[cell][1] = [(1.0, end, -1.0, end == goal)]
    ends: list[Outcome] = [(1.0, goal, 0.0, True)]
    table[goal] = dict.fromkeys(table[0], ends)
    return table


class TableEnv(gym.Env):
    """An environment made of a table as toy-text environments have one.

    Args:
        table: `P[state][action]`, a list of (probability, next, reward, terminated).
        start: the first state; None draws it from those that do not end at once.
        masks: which actions each state offers, given in `info["action_mask"]`.
        limit: truncate after so many steps.
    """

    def __init__(
        self,
        table: Table,
        start: int | None = None,
        masks: np.ndarray | None = None,
        limit: float = np.inf,
    ) -> None:
        self.P = table
        self.observation_space = spaces.Box(0, len(table) - 1, (1,), np.float64)
        self.action_space = spaces.Discrete(len(table[0]))
        self.start, self.masks, self.limit = start, masks, limit

    def _observation(self) -> tuple[np.ndarray, dict[str, Any]]:
        info = {} if self.masks is None else {"action_mask": self.masks[self.cell]}
        return np.array([float(self.cell)]), info

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(len(self.P) - 1))
        self.cell = drawn if self.start is None else self.start
        self.steps = 0
        return self._observation()

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        outcomes = self.P[self.cell][int(action)]
        which = self.np_random.choice(len(outcomes), p=[o[0] for o in outcomes])
        _, self.cell, reward, terminated = outcomes[which]
        self.steps += 1
        observation, info = self._observation()
        return observation, reward, terminated, self.steps >= self.limit, info


def vector(table: Table, slots: int, mode: str = "NextStep", **keywords: Any) -> Any:
    """Several such environments, one per slot."""
    return SyncVectorEnv(
        [lambda: TableEnv(table, **keywords)] * slots, autoreset_mode=mode
    )


def model(table: Table) -> TabularModel:
    return TabularModel.from_env(TableEnv(table))
