"""Where methods meet: systems as they are, and made harder in one way or another.

An arena is data, JSON types all of it. Systems, partitions and limits are those of
`experiments.courses`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.envs.control_env import ControlVectorEnv
from acl_gym.evaluation import control_env
from acl_gym.experiments.courses import COURSES, Course
from acl_gym.partition import Crisp, Discrete, Fuzzy, Partition, named
from acl_gym.reproduction.settings import GRID_1D, GRID_2D, NAVIGATION, PENDULUM
from acl_gym.reproduction.versus.veils import veiled
from acl_gym.reproduction.versus.wholes import WHOLES

KINDS = {"crisp": Crisp, "fuzzy": Fuzzy}


@dataclass(frozen=True)
class Arena:
    """A system as learners meet it, and how much of it they get.

    Attributes:
        env_id: the system.
        steps: interactions of a table-based method, all slots together.
        max_steps: T, the longest episode.
        cells: of the pendulum N_theta and N_omega; None takes the course's partition.
        env: keyword arguments of the environment.
        veil: what lies between system and learner, see `veils.veiled`.
        judged_by: a key of `wholes.WHOLES`; None: the sum of the stage costs.
        dqn_steps: interactions of DQN; 0: it does not take part.
        dqn_every: interactions between two evaluations of DQN.
        repeats: how often an evaluation starts from each state, where luck decides.
    """

    env_id: str
    steps: int
    max_steps: int
    cells: Any = None
    env: dict[str, Any] = field(default_factory=dict)
    veil: dict[str, Any] = field(default_factory=dict)
    judged_by: str | None = None
    dqn_steps: int = 0
    dqn_every: int = 500
    repeats: int = 1

    @property
    def course(self) -> Course:
        """The course of the comparison on the same system."""
        return COURSES[self.env_id]

    @property
    def finite(self) -> bool:
        """Whether a state is a cell."""
        return self.env_id in (GRID_1D, GRID_2D)

    def base(self, slots: int) -> ControlVectorEnv:
        """The environment itself, without the veil."""
        return control_env(gym.make_vec(self.env_id, num_envs=slots, **self.env))

    def make_env(self, slots: int) -> VectorEnv[Any, Any, Any]:
        """The environment that learners see."""
        return veiled(self.base(slots), self.veil)

    def partition(self, kind: str) -> Partition:
        """The partition of a table-based method.

        Args:
            kind: "crisp" or "fuzzy"; not looked at where a state is a cell.
        """
        if self.finite:
            return Discrete(self.base(1).system.n_states)  # type: ignore[attr-defined]
        if self.env_id == PENDULUM:
            return named.pendulum(*self.cells, kind=KINDS[kind])
        grid = named.navigation("regular", kind=KINDS[kind])
        hidden = self.veil.get("hidden", ())
        return KINDS[kind](
            [line for i, line in enumerate(grid.centres) if i not in hidden]
        )

    def states(self) -> NDArray[np.float64]:
        """The initial states of an evaluation, `(n, d)`."""
        return np.repeat(self.base(1).system.evaluation_states(), self.repeats, axis=0)

    @property
    def evaluation_steps(self) -> int:
        """T of an evaluation."""
        return int(self.base(1).system.evaluation_steps)

    @property
    def ceiling(self) -> float:
        """No policy costs more; what a run that breaks down counts as."""
        if self.judged_by is not None:
            return WHOLES[self.judged_by].ceiling
        return self.evaluation_steps * self.base(1).system.max_stage_cost


_SWING = Arena(PENDULUM, 1_000_000, 300, (40, 41))

SYSTEMS = {
    "row": Arena(GRID_1D, 5_000, 50, dqn_steps=3_000, dqn_every=100),
    "grid": Arena(GRID_2D, 200_000, 435, dqn_steps=10_000, dqn_every=250),
    "navigation": Arena(NAVIGATION, 2_500_000, 150, dqn_steps=15_000),
    "pendulum": replace(_SWING, steps=2_500_000, dqn_steps=15_000),
}
"""The four systems as they are."""


def _swing(**changes: Any) -> Arena:
    return replace(_SWING, **{"steps": 500_000, **changes})


def _slippery(p: float) -> Arena:
    return Arena(
        GRID_2D,
        400_000,
        round(435 / p),
        env={"transition_probability": p},
        repeats=3,
    )


HARDER = {
    "pendulum-10x11": replace(_SWING, cells=(10, 11)),
    "pendulum-16x17": replace(_SWING, cells=(16, 17)),
    "pendulum-24x25": replace(_SWING, cells=(24, 25)),
    "pendulum-40x41": _SWING,
    "grid-p0.7": _slippery(0.7),
    "grid-p0.5": _slippery(0.5),
    "pendulum-noise": _swing(veil={"noise": [0.1, 0.5]}),
    "pendulum-slips": _swing(veil={"slips": 0.2}),
    "navigation-hidden": Arena(NAVIGATION, 500_000, 150, veil={"hidden": [3]}),
    "pendulum-sign": _swing(veil={"rounded": [0, 2]}, cells=(40, 3)),
    "pendulum-settling": _swing(judged_by="settling"),
    "pendulum-switches": _swing(judged_by="switches"),
    "pendulum-peak": _swing(judged_by="peak"),
}
"""Where ACL might win: coarse cells, noise, partial state, costs of whole solutions."""

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
