"""Costs of whole solutions on the pendulum that no reward per step expresses (§3.5.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from acl_gym.colony.costs import Cost, Overshoot, SettlingTime, Steps
from acl_gym.colony.episodes import Episodes
from acl_gym.utils.typing import FloatArray

_ANGLE = {"variable": 0, "target": math.pi, "period": 2 * math.pi}
_STEP = 0.1  # s, T_s of Table 5.1
_LONGEST = 300 * _STEP  # s, T of Table 5.2


@dataclass(frozen=True)
class Switches(Cost):
    """How often the action differs from the one before it."""

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        changed = episodes.actions[1:] != episodes.actions[:-1]
        return np.asarray(np.sum(changed & episodes.taken()[1:], axis=0, dtype=float))


@dataclass(frozen=True)
class Peak(Cost):
    """The largest size that a state variable has on the way.

    Attributes:
        variable: index of the variable.
    """

    variable: int

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.asarray(np.abs(episodes.variable(self.variable)).max(axis=0))


class Whole(NamedTuple):
    """A cost of whole solutions.

    Attributes:
        cost: the cost, > 0.
        ceiling: no solution costs more.
        unit: what it is counted in.
    """

    cost: Cost
    ceiling: float
    unit: str


WHOLES = {
    "settling": Whole(
        SettlingTime(**_ANGLE, tolerance=0.3, sampling_time=_STEP)  # type: ignore[arg-type]
        + 0.5 * Overshoot(**_ANGLE)  # type: ignore[arg-type]
        + 0.1,
        _LONGEST + 0.5 * 300 * _STEP * 9.0 + 0.1,
        "settling time in s + overshoot in 2 rad",
    ),
    "switches": Whole(
        _STEP * Steps() + 0.5 * Switches(),
        _LONGEST + 0.5 * 299,
        "time in s + a half for each change of torque",
    ),
    "peak": Whole(
        _STEP * Steps() + Peak(1),
        _LONGEST + 9.0,
        "time in s + top speed in rad/s",
    ),
}
"""By name; overshoot is at most what a pendulum turns at 9 rad/s for all of the time."""
