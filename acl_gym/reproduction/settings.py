"""What is run: a setting is a colony on a system, a study the same with a name.

All of a setting is JSON, so that it can be kept beside its results and compared.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import gymnasium as gym

from acl_gym.partition import Crisp, Fuzzy, Partition, named

PENDULUM = "acl_gym/Pendulum-v0"
NAVIGATION = "acl_gym/Navigation-v0"
GRID_1D = "acl_gym/GridSearch1D-v0"
GRID_2D = "acl_gym/GridSearch2D-v0"
TWO_STATE = "acl_gym/TwoState-v0"

KINDS = {"crisp": Crisp, "fuzzy": Fuzzy}


@dataclass(frozen=True)
class Setting:
    """A colony on a system, all but the seed.

    Attributes:
        env_id: the system.
        ants: M.
        trials: K.
        colony: keyword arguments of `ACL`; the thesis's parameters.
        env: keyword arguments of the environment.
        kind: "crisp", "fuzzy", or "discrete" where the states are the cells.
        cells: of the pendulum N_theta and N_omega; of the navigation the name of its
            partition; None where the states are the cells.
        evaluation_steps: T of the evaluation after each trial; None takes that of the
            colony.
        order: the reading of the local update, a key of `orders.ORDERS`.
    """

    env_id: str
    ants: int
    trials: int
    colony: dict[str, Any] = field(default_factory=dict)
    env: dict[str, Any] = field(default_factory=dict)
    kind: str = "discrete"
    cells: Any = None
    evaluation_steps: int | None = None
    order: str = "two phases"

    @cached_property
    def key(self) -> str:
        """Names the setting by what is in it."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def system(self) -> str:
        """The short name of the system, for file names."""
        return self.env_id.split("/")[-1].split("-")[0].lower()

    def make_env(self, num_envs: int | None = None) -> Any:
        """The vector environment with a slot for each ant."""
        return gym.make_vec(self.env_id, num_envs=num_envs or self.ants, **self.env)

    def make_partition(self, fine: int = 1) -> Partition | None:
        """The partition; None where the states are the cells."""
        if self.env_id == PENDULUM:
            n_theta, n_omega = self.cells
            limit = self.env.get("omega_max", 9.0)
            return named.pendulum(
                n_theta, n_omega, kind=KINDS[self.kind], omega_max=limit
            )
        if self.env_id == NAVIGATION:
            return named.navigation(self.cells, kind=KINDS[self.kind])
        return None


@dataclass(frozen=True)
class Study:
    """A setting under the name that a panel of a figure gives it.

    Attributes:
        label: for instance "rho = 0.1".
        setting: what is run.
    """

    label: str
    setting: Setting


@dataclass(frozen=True)
class Experiment:
    """A figure of the thesis, or a trial beside them.

    Attributes:
        name: for instance "fig5.4".
        title: what the figure shows.
        section: of the thesis.
        studies: its panels, in order.
        drawing: how it is drawn, a key of `figures.DRAWINGS`.
        claims: which claims it decides.
        explains: for which claims it is tried why they do not hold.
        text: what the thesis says, what is decided here, in this project's words.
        options: more that the drawing needs.
    """

    name: str
    title: str
    section: str
    studies: tuple[Study, ...]
    drawing: str
    claims: tuple[str, ...] = ()
    text: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    explains: tuple[str, ...] = ()
