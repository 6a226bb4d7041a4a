"""What is run: a setting is a colony on a system, a study the same with a name.

All of a setting is JSON, so that it can be kept beside its results and compared. Other
kinds of learners have settings of their own; a `Runnable` is what all of them can do.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from acl_gym.partitions import Crisp, Fuzzy, Partition
from acl_gym.partitions.automatic import thesis_partition

PENDULUM = "acl_gym/Pendulum-v0"
NAVIGATION = "acl_gym/Navigation-v0"
GRID_1D = "acl_gym/GridSearch1D-v0"
GRID_2D = "acl_gym/GridSearch2D-v0"
TWO_STATE = "acl_gym/TwoState-v0"

KINDS = {"crisp": Crisp, "fuzzy": Fuzzy}

Result = dict[str, Any]
"""Of a run: `rows`, `levels`, `seconds`; see `training.learn`."""

Learner = Callable[[Any, int, Callable[[float], None]], Result]
"""Runs a setting with a seed; is told whom to tell the fraction that is done."""


class Runnable(Protocol):
    """What can be run with one seed after another: a frozen dataclass."""

    @property
    def key(self) -> str:
        """Names it by what its results depend on."""

    @property
    def about(self) -> dict[str, Any]:
        """What its results depend on but the seed, JSON types."""

    @property
    def system(self) -> str:
        """A short name for its files."""

    @property
    def text(self) -> str:
        """All of it in one line."""

    @property
    def kernels(self) -> tuple[Any, ...]:
        """What must be compiled for it: the same for two that need the same."""

    @property
    def most_runs(self) -> int | None:
        """How many runs are made at most; None: as many as are asked for."""

    def brief(self) -> Runnable:
        """The same in a moment, to compile its kernels."""

    @property
    def learner(self) -> Learner:
        """What runs it once: a function of a module, which travels to other processes."""

    def along(self, runs: Sequence[Result], measure: str) -> NDArray[np.float64]:
        """A measure of each run as it goes on, `(runs, points)`."""

    def positions(self) -> list[int] | None:
        """The interactions at the points of `along`; None: they are trials 1, 2, ..."""


@dataclass(frozen=True)
class Named:
    """A dataclass that is named by its fields, but for `most_runs`."""

    @property
    def about(self) -> dict[str, Any]:
        """All that a result depends on but the seed, JSON types."""
        about = asdict(self)
        del about["most_runs"]
        return about

    @cached_property
    def key(self) -> str:
        """A short name for what is in it."""
        text = json.dumps(self.about, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Setting(Named):
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
        most_runs: how many runs are made at most; not part of what results depend on.
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
    most_runs: int | None = None

    @property
    def system(self) -> str:
        """The short name of the system, for file names."""
        return self.env_id.split("/")[-1].split("-")[0].lower()

    @property
    def text(self) -> str:
        """All of it in one line."""
        parts = [f"{self.ants} ants", f"{self.trials} trials", self.kind]
        if self.cells is not None:
            cells = self.cells
            parts.append(
                cells if isinstance(cells, str) else " x ".join(map(str, cells))
            )
        if self.order != "two phases":
            parts.append(self.order)
        values = {**self.colony, **self.env}
        return ", ".join(parts + [f"{name} = {values[name]}" for name in values])

    @property
    def kernels(self) -> tuple[Any, ...]:
        """See `Runnable`."""
        return self.env_id, self.kind, len(self.env), self.order

    def brief(self) -> Setting:
        """A short trial of two ants."""
        short = {**self.colony, "max_steps": 2}
        return replace(self, ants=2, trials=1, colony=short)

    @property
    def learner(self) -> Learner:
        """See `training.learn`."""
        from acl_gym.reproduction.training import learn

        return learn

    def along(self, runs: Sequence[Result], measure: str) -> NDArray[np.float64]:
        """A measure after each trial of each run."""
        return np.array([run["rows"][measure] for run in runs])

    def positions(self) -> None:
        """Points are trials."""

    def make_env(self, num_envs: int | None = None) -> Any:
        """The vector environment with a slot for each ant."""
        return gym.make_vec(self.env_id, num_envs=num_envs or self.ants, **self.env)

    def make_partition(self, fine: int = 1) -> Partition | None:
        """The partition; None where the states are the cells."""
        if self.env_id in (PENDULUM, NAVIGATION):
            return thesis_partition(self.make_env(1), self.cells, kind=KINDS[self.kind])
        return None


@dataclass(frozen=True)
class Study:
    """A setting under the name that a panel of a figure gives it.

    Attributes:
        label: for instance "rho = 0.1".
        setting: what is run, a `Runnable`; of which kind, the drawing knows.
    """

    label: str
    setting: Any


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
        findings: how a table and sentences are made of its runs, a key of
            `versus.findings.FINDINGS`; "" where claims say all.
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
    findings: str = ""
