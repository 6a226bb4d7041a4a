"""Environments, models, partitions and rules that hand in what they should not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from acl_gym import Crisp, Discrete, Fuzzy, Partition
from acl_gym.colony.update_rules import EachVisit

SLOTS, ACTIONS, STEPS = 4, 3, 6

BOX = spaces.Box(-1.0, 1.0, (2,), np.float64)
CELLS = spaces.Discrete(7)


class Liar(VectorEnv[Any, Any, Any]):
    """Episodes of a few steps, known in advance; one thing that it returns is changed.

    Args:
        boxes: observe real numbers, else cells.
        mode: of autoreset.
        what: which thing, such as "rewards"; None tells the truth.
        change: makes of the true value what is returned.
        when: in which step; 0 is the reset.
        masked: give action masks.
    """

    def __init__(
        self,
        boxes: bool,
        mode: AutoresetMode,
        what: str | None = None,
        change: Callable[[Any], Any] = lambda value: value,
        when: int = 0,
        masked: bool = False,
    ) -> None:
        self.num_envs = SLOTS
        self.single_observation_space = BOX if boxes else CELLS
        self.single_action_space = spaces.Discrete(ACTIONS)
        self.observation_space = batch_space(self.single_observation_space, SLOTS)
        self.action_space = batch_space(self.single_action_space, SLOTS)
        self.metadata = {"autoreset_mode": mode}
        self._mode, self._what, self._change = mode, what, change
        self._when, self._masked, self._boxes = when, masked, boxes
        self._t = 0
        self.mischief: Callable[[], Any] | None = None

    def _see(self) -> Any:
        rng = np.random.default_rng(self._t)
        if self._boxes:
            return rng.uniform(-1.0, 1.0, (SLOTS, 2))
        return rng.integers(7, size=SLOTS)

    def _told(self, what: str, value: Any) -> Any:
        if what == self._what and self._t >= self._when:
            return self._change(value)
        return value

    def _infos(self) -> Any:
        infos: dict[str, Any] = {}
        if self._masked:
            mask = np.ones((SLOTS, ACTIONS), dtype=np.bool_)
            mask[:, self._t % ACTIONS] = False
            infos["action_mask"] = self._told("mask", mask)
        return self._told("infos", infos)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        """Start, or go on where only some slots are reset."""
        if options is None or "reset_mask" not in options:
            self._t = 0
        return self._told("observations", self._see()), self._infos()

    def step(self, actions: Any) -> Any:
        """Count a step; all slots end together after `STEPS`."""
        assert np.shape(actions) == (SLOTS,)
        if self.mischief is not None:
            self.mischief()
        self._t += 1
        end = np.full(SLOTS, self._t >= STEPS)
        rewards = -1.0 - np.arange(SLOTS) - self._t % 2
        infos = self._infos()
        if self._mode is AutoresetMode.SAME_STEP and end.any():
            final = np.full(SLOTS, None, dtype=object)
            for slot, row in enumerate(self._see()):
                final[slot] = row
            infos = {
                **infos,
                "final_obs": self._told("final", final),
                "_final_obs": end,
            }
        return (
            self._told("observations", self._see()),
            self._told("rewards", rewards),
            self._told("terminated", end),
            self._told("truncated", np.zeros_like(end)),
            infos,
        )


class Model:
    """Always takes action 1, and hands it in as it likes."""

    def __init__(self, change: Callable[[Any], Any] = lambda actions: actions) -> None:
        self._change = change

    def predict(self, observation: Any, deterministic: bool = True) -> Any:
        """As Stable-Baselines3's, for batches."""
        return self._change(np.full(len(observation), 1)), None


class OwnPartition(Partition):
    """Three cells; `lie` may change what it says of them."""

    n_cells = 3
    cells_per_state = 2

    def __init__(self, lie: Callable[[Any, Any, Any], None]) -> None:
        self._lie = lie

    def locate(self, states: Any, slots: Any, index: Any, degree: Any) -> None:
        """Half in one cell, half in another."""
        index[: len(slots)] = (0, 2)
        degree[: len(slots)] = 0.5
        self._lie(slots, index, degree)

    def settings(self) -> dict[str, Any]:
        """None: it is not saved."""
        return {"type": "OwnPartition"}

    def cell_states(self) -> Any:
        """Three states."""
        return np.zeros((3, 2))


def _cells(value: Any) -> Callable[[Any, Any, Any], None]:
    def lie(slots: Any, index: Any, degree: Any) -> None:
        index.flat[-1] = value

    return lie


def _degrees(value: Any) -> Callable[[Any, Any, Any], None]:
    def lie(slots: Any, index: Any, degree: Any) -> None:
        degree.flat[-1] = value

    return lie


def _slots(slots: Any, index: Any, degree: Any) -> None:
    slots[:] = 2**40


LIES_OF_CELLS: dict[str, Callable[[Any, Any, Any], None]] = {
    "a cell too many": _cells(3),
    "far away": _cells(2**31 - 1),
    "negative": _cells(-(2**31)),
    "degree nan": _degrees(np.nan),
    "degree inf": _degrees(np.inf),
    "degree negative": _degrees(-0.5),
    "degree too large": _degrees(0.9),
    "slots": _slots,
}


class FarCrisp(Crisp):
    """A grid whose own `locate` writes out of range."""

    def locate(self, states: Any, slots: Any, index: Any, degree: Any) -> None:
        """Far away."""
        super().locate(states, slots, index, degree)
        index[:] = 2**30


class FarFuzzy(Fuzzy):
    """The same with several cells a state."""

    def locate(self, states: Any, slots: Any, index: Any, degree: Any) -> None:
        """Far away."""
        super().locate(states, slots, index, degree)
        index[:] = -5


class FarDiscrete(Discrete):
    """The same for integers."""

    def locate(self, states: Any, slots: Any, index: Any, degree: Any) -> None:
        """Far away."""
        index[:], degree[:] = 99, 1.0


class Rule(EachVisit):
    """An update rule of a user's own.

    Args:
        choice: makes of the actions what it returns.
        scribble: changes the cells that it was given.
        levels: changes the levels after a trial.
    """

    def __init__(
        self,
        choice: Callable[[Any], Any] = lambda actions: actions,
        scribble: Callable[[Any], None] = lambda index: None,
        levels: Callable[[Any], None] = lambda levels: None,
    ) -> None:
        self._choice, self._scribble, self._levels = choice, scribble, levels

    def choose(self, selection: Any, pheromone: Any, index: Any, *rest: Any) -> Any:
        """As usual, then changed."""
        actions = super().choose(selection, pheromone, index, *rest)
        self._scribble(index)
        return self._choice(actions)

    def local_update(self, pheromone: Any, index: Any, *rest: Any) -> None:
        """With cells that may have been changed."""
        super().local_update(pheromone, index, *rest)
        self._scribble(index)

    def global_update(self, pheromone: Any, *rest: Any) -> None:
        """As usual, then the levels are changed."""
        super().global_update(pheromone, *rest)
        self._levels(pheromone.levels)
