"""Environments for workers; a module that a new process imports quickly."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

SLOTS = 5
SENSITIVE = 1  # the slot in which something goes wrong, with a neighbour in its worker


class Wanderer(gym.Env):
    """Walks at random, until chance ends it; what shall go wrong is in the options."""

    observation_space = gym.spaces.Box(-100.0, 100.0, (2,), np.float64)
    action_space = gym.spaces.Discrete(3)
    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012
    render_mode = "rgb_array"

    def __init__(self, number: int) -> None:
        self.number = number

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = self.np_random.normal(size=2)
        self.time = 0
        self.fault = (options or {}).get("fault")
        return self.place.copy(), self.info()

    def step(self, action):
        self.time += 1
        if self.fault is not None and (self.number, self.time) == (SENSITIVE, 3):
            self.fault()
        self.place += 0.1 * self.np_random.normal(size=2) + 0.1 * (action - 1)
        # Not before the step in which something goes wrong.
        ended = self.time > 3 and bool(self.np_random.random() < 0.1)
        return self.place.copy(), float(self.place[0]), ended, False, self.info()

    def render(self):
        return np.full((2, 2, 3), self.time, np.uint8)

    def info(self) -> dict[str, Any]:
        allowed = np.array([True, self.place[0] > 0, self.place[1] > 0])
        return {"action_mask": allowed, "pid": os.getpid()}


MAKERS: list[Callable[[], gym.Env]] = [partial(Wanderer, i) for i in range(SLOTS)]


class Once:
    """Calls a function the first time only, in whatever process that is."""

    def __init__(self, marker: Path, function: Callable[[], Any]) -> None:
        self.marker, self.function = marker, function

    def __call__(self) -> None:
        if not self.marker.exists():
            self.marker.touch()
            self.function()


def kill_myself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


class FromElsewhere(gym.Env):
    """Its chance is not that of its generator."""

    observation_space = gym.spaces.Box(0, 1, (1,), np.float64)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1), {"pid": os.getpid()}

    def step(self, action):
        return np.random.default_rng().random(1), 1.0, False, False, {}


class Picky(Exception):  # noqa: N818
    """Cannot be made again from its message."""

    def __init__(self, first: int, second: int) -> None:
        super().__init__(f"{first} is not {second}")


def break_down() -> None:
    raise ZeroDivisionError("the pole is broken")


def be_picky() -> None:
    raise Picky(1, 2)


class Locked(Wanderer):
    def info(self) -> dict[str, Any]:
        return {"lock": threading.Lock()}


class Shapeless(Wanderer):
    def step(self, action):
        observation, *others = super().step(action)
        return observation[:1], *others


class OldFashioned(Wanderer):
    def step(self, action):
        observation, reward, terminated, _, info = super().step(action)
        return observation, reward, terminated, info


class Wide(Wanderer):
    observation_space = gym.spaces.Box(-100.0, 100.0, (3,), np.float64)
