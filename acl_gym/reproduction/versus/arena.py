"""What an arena is: a system as learners meet it. Which ones there are: `arenas`.

The two are apart so that an arena more leaves the results of the others as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.perturbations import perturbed
from acl_gym.evaluation import control_env
from acl_gym.experiments.courses import COURSES, Course
from acl_gym.partitions import Crisp, Discrete, Fuzzy, Partition
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.reproduction.settings import GRID_1D, GRID_2D
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
        veil: what lies between system and learner, see `perturbations.perturbed`.
        judged_by: a key of `wholes.WHOLES`; None: the sum of the stage costs.
        dqn_steps: interactions of DQN; 0: it does not take part.
        dqn_every: interactions between two evaluations of DQN.
        repeats: how often an evaluation starts from each state, where luck decides.
        spacing: by what factor the interactions grow from one evaluation of a policy to
            the next, > 1.
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
    spacing: float = 1.04

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
        return perturbed(self.base(slots), self.veil)

    def partition(self, kind: str) -> Partition:
        """The partition of a table-based method.

        Args:
            kind: "crisp" or "fuzzy"; not looked at where a state is a cell.
        """
        if self.finite:
            return Discrete(self.base(1).system.n_states)  # type: ignore[attr-defined]
        return thesis_partition(self.make_env(1), self.cells, kind=KINDS[kind])

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
