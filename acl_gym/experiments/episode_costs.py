"""Costs of whole episodes on the pendulum that no reward per step expresses (§3.5.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from acl_gym.colony.cost import Cost
from acl_gym.colony.costs import Steps
from acl_gym.colony.episodes import Episodes
from acl_gym.colony.response_costs import Overshoot, SettlingTime
from acl_gym.utils.typing import FloatArray

_STEP = 0.1
"""T_s of Table 5.1, s."""

_LONGEST = 300 * _STEP
"""T of Table 5.2, s."""


@dataclass(frozen=True)
class Switches(Cost):
    """How often the action differs from the one before it."""

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        changed = episodes.actions[1:] != episodes.actions[:-1]
        return np.asarray(np.sum(changed & episodes.taken()[1:], axis=0, dtype=float))


@dataclass(frozen=True)
class Peak(Cost):
    """The largest absolute value of a state variable in the episode.

    Attributes:
        variable: index of the variable.
    """

    variable: int

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.asarray(np.abs(episodes.variable(self.variable)).max(axis=0))


class EpisodeCost(NamedTuple):
    """A cost of whole episodes.

    Attributes:
        cost: the cost, > 0.
        ceiling: no episode costs more.
        unit: what it is counted in.
    """

    cost: Cost
    ceiling: float
    unit: str


_SETTLING = SettlingTime(
    variable=0,
    target=math.pi,
    period=2 * math.pi,
    tolerance=0.3,
    sampling_time=_STEP,
)
_OVERSHOOT = Overshoot(variable=0, target=math.pi, period=2 * math.pi)

EPISODE_COSTS = {
    "settling": EpisodeCost(
        _SETTLING + 0.5 * _OVERSHOOT + 0.1,
        # The pendulum overshoots by at most what it turns at 9 rad/s in all that time.
        _LONGEST + 0.5 * 300 * _STEP * 9.0 + 0.1,
        "settling time in s + overshoot in 2 rad",
    ),
    "switches": EpisodeCost(
        _STEP * Steps() + 0.5 * Switches(),
        _LONGEST + 0.5 * 299,
        "time in s + a half for each change of torque",
    ),
    "peak": EpisodeCost(
        _STEP * Steps() + Peak(1),
        _LONGEST + 9.0,
        "time in s + top speed in rad/s",
    ),
}
"""By name."""
