"""Where methods meet: systems as they are, and made harder in one way or another.

An arena is data, JSON types all of it. Systems, partitions and limits are those of
`experiments.courses`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from acl_gym.reproduction.settings import GRID_1D, GRID_2D, NAVIGATION, PENDULUM
from acl_gym.reproduction.versus.arena import Arena

SYSTEMS = {
    "row": Arena(GRID_1D, 5_000, 50, dqn_steps=3_000, dqn_every=100),
    "grid": Arena(GRID_2D, 200_000, 435, dqn_steps=10_000, dqn_every=250),
    "navigation": Arena(NAVIGATION, 2_500_000, 150, dqn_steps=15_000),
    "pendulum": Arena(PENDULUM, 2_500_000, 300, (40, 41), dqn_steps=15_000),
}
"""The four systems as they are."""

SELDOM = 1.3
"""The spacing of evaluations where the last policy is what counts."""

_SWING = Arena(PENDULUM, 2_000_000, 300, (40, 41), spacing=SELDOM)


def _swing(**changes: Any) -> Arena:
    return replace(_SWING, **changes)


def _slippery(p: float) -> Arena:
    return Arena(
        GRID_2D,
        1_000_000,
        round(435 / p),
        env={"transition_probability": p},
        repeats=3,
        spacing=SELDOM,
    )


HARDER = {
    "pendulum-10x11": _swing(cells=(10, 11)),
    "pendulum-16x17": _swing(cells=(16, 17)),
    "pendulum-24x25": _swing(cells=(24, 25)),
    "pendulum-40x41": _SWING,
    "grid-p0.7": _slippery(0.7),
    "grid-p0.5": _slippery(0.5),
    "pendulum-noise": _swing(veil={"noise": [0.1, 0.5]}),
    "pendulum-slips": _swing(veil={"slips": 0.2}),
    "navigation-hidden": Arena(
        NAVIGATION, 1_000_000, 150, veil={"hidden": [3]}, spacing=SELDOM
    ),
    "pendulum-sign": _swing(veil={"rounded": [0, 2]}, cells=(40, 3)),
    "pendulum-settling": _swing(judged_by="settling"),
    "pendulum-switches": _swing(judged_by="switches"),
    "pendulum-peak": _swing(judged_by="peak"),
}
"""Where ACL might win: coarse cells, noise, partial state, costs of whole solutions.

How fast methods are is measured on the systems as they are, here it is how far they come.
"""

ARENAS = {**SYSTEMS, **HARDER}
"""All of them by name."""

LABELS = {
    "row": "1-D grid",
    "grid": "2-D grid",
    "navigation": "navigation",
    "pendulum": "pendulum",
    "pendulum-10x11": "10 x 11 cells",
    "pendulum-16x17": "16 x 17 cells",
    "pendulum-24x25": "24 x 25 cells",
    "pendulum-40x41": "40 x 41 cells",
    "grid-p0.7": "2-D grid, p = 0.7",
    "grid-p0.5": "2-D grid, p = 0.5",
    "pendulum-noise": "pendulum, noisy observations",
    "pendulum-slips": "pendulum, slipping actions",
    "navigation-hidden": "navigation, a velocity hidden",
    "pendulum-sign": "pendulum, the velocity's sign only",
    "pendulum-settling": "settling time and overshoot",
    "pendulum-switches": "time and switching",
    "pendulum-peak": "time and top speed",
}
"""What they are called in tables and figures."""
