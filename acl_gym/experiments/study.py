"""What is run, as data: a study is a method with its settings on a task, and a budget.

A study contains only JSON types, so that it can be kept beside its results, compared,
and sent to other processes. An experiment is a few studies and how they are shown.

`AnyStudy` is what the engine needs of a study. `Study` is one of a method that learns a
policy; `swarms.study.SwarmStudy` is one of a swarm of moving agents.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, Generic

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from typing_extensions import TypeVar

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.perturbations import perturbed
from acl_gym.evaluation import control_env
from acl_gym.experiments.episode_costs import EPISODE_COSTS
from acl_gym.experiments.names import GROWING, NETWORKS
from acl_gym.partitions import KINDS, Partition
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.partitions.growing import initial_partition
from acl_gym.utils.hashing import hashed
from acl_gym.utils.typing import FloatArray

PENDULUM = "acl_gym/Pendulum-v0"
NAVIGATION = "acl_gym/Navigation-v0"
GRID_1D = "acl_gym/GridSearch1D-v0"
GRID_2D = "acl_gym/GridSearch2D-v0"
TWO_STATE = "acl_gym/TwoState-v0"

CURVE_POINTS = 120
"""Points of a curve whose policies are evaluated at growing intervals."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A system as a learner meets it, and how its policies are judged.

    Attributes:
        env_id: the environment.
        env: its keyword arguments.
        perturbations: what lies between system and learner, see
            `envs.wrappers.perturbations.perturbed`.
        cost: a key of `EPISODE_COSTS`; None takes the sum of the stage costs.
        evaluation_steps: T of an evaluation; None takes that of the system.
        repeats: how often an evaluation starts from each state, where the system is
            random.
    """

    env_id: str
    env: dict[str, Any] = field(default_factory=dict)
    perturbations: dict[str, Any] = field(default_factory=dict)
    cost: str | None = None
    evaluation_steps: int | None = None
    repeats: int = 1

    @property
    def short_name(self) -> str:
        """The name in files: Pendulum of acl_gym/Pendulum-v0."""
        return self.env_id.rpartition("/")[2].rpartition("-")[0]

    def make_system_env(self, slots: int) -> ControlVectorEnv:
        """The environment itself, without perturbations."""
        return control_env(gym.make_vec(self.env_id, num_envs=slots, **self.env))

    def make_env(self, slots: int) -> VectorEnv[Any, Any, Any]:
        """The environment that learners see."""
        return perturbed(self.make_system_env(slots), self.perturbations)

    def make_partition(self, kind: str, cells: Any = None) -> Partition:
        """A partition of what learners see, with the centres of the thesis.

        Args:
            kind: "crisp" or "fuzzy"; not used where a state is a cell.
            cells: see `partitions.automatic.thesis_partition`.
        """
        return thesis_partition(self.make_env(1), cells, kind=KINDS[kind])

    def evaluation_states(self) -> FloatArray:
        """The initial states of an evaluation, `(n, state_size)`."""
        states = self.make_system_env(1).system.evaluation_states()
        return np.repeat(states, self.repeats, axis=0)

    def evaluation_env(self) -> tuple[VectorEnv[Any, Any, Any], FloatArray | None]:
        """The environment of an evaluation, a slot for each episode, and its states.

        The states are None where an evaluation starts from random ones.
        """
        states = self.evaluation_states()
        return self.make_env(len(states)), states

    def network_evaluation(
        self,
    ) -> tuple[VectorEnv[Any, Any, Any], FloatArray | None, int | None]:
        """As `evaluation_env` for networks, whose observations are scaled; and T."""
        from acl_gym.sb3.dqn import scaled_env  # which imports torch

        return scaled_env(self.env_id, **self.env), None, None

    def make_network(self, method: str, settings: dict[str, Any], seed: int) -> Any:
        """The model of Stable-Baselines3 that learns here; see `names.NETWORKS`."""
        from acl_gym.sb3.models import MODELS

        kind = MODELS[method]
        return kind.make(self.env_id, kind.settings(**settings), seed, **self.env)

    @cached_property
    def longest_evaluation(self) -> int:
        """T of an evaluation."""
        if self.evaluation_steps is not None:
            return self.evaluation_steps
        return int(self.make_system_env(1).system.evaluation_steps)

    @property
    def highest_cost(self) -> float:
        """An upper bound on the cost of any policy; a run that breaks down has this cost."""
        if self.cost is not None:
            return EPISODE_COSTS[self.cost].ceiling
        system = self.make_system_env(1).system
        return float(self.longest_evaluation * system.max_stage_cost)


@dataclass(frozen=True, kw_only=True)
class AnyStudy(ABC):
    """All that a run depends on but its seed, and what the engine needs to know of it.

    Attributes:
        method: a key of `methods.METHODS`, which makes the runs.
        settings: of the method, JSON types.
        most_runs: how many runs are made at most. No result depends on it.
    """

    method: str
    settings: dict[str, Any] = field(default_factory=dict)
    most_runs: int | None = None

    @property
    def inputs(self) -> dict[str, Any]:
        """All that a result depends on but the seed, JSON types."""
        inputs = asdict(self)
        del inputs["most_runs"]
        return inputs

    @cached_property
    def key(self) -> str:
        """A short name that is a function of `inputs`."""
        return hashed(self.inputs)[:12]

    @property
    @abstractmethod
    def subject(self) -> str:
        """What the method is applied to, as the names of files have it."""

    @property
    @abstractmethod
    def measure(self) -> str:
        """The column of `Run.rows` by which runs are summed up."""

    @property
    @abstractmethod
    def unit(self) -> str:
        """What curves are drawn over: "trial", "interaction", "step", "evaluation"."""

    @property
    @abstractmethod
    def kernels(self) -> tuple[Any, ...]:
        """Two studies for which this is the same need the same compiled kernels."""

    @abstractmethod
    def brief(self) -> AnyStudy:
        """The same for a few steps: to compile its kernels, or to try it out."""

    @abstractmethod
    def curve_points(self) -> list[int] | None:
        """The values of `env_steps` at which curves have points; None: those of rows."""


@dataclass(frozen=True, kw_only=True)
class Study(AnyStudy):
    """A method that learns a policy, with its settings, on a task.

    Attributes:
        task: what is learned.
        method: a key of `methods.METHODS`.
        settings: keyword arguments of the agent; for networks, of their class of settings
            in `acl_gym.sb3.models`; for planning, of `fuzzy_q_iteration`. Of methods that
            learn from rewards, "reward" is "stage", the stage costs, or "steps", 1 a
            step.
        slots: slots of the environment; of a colony M, the number of ants.
        kind: "crisp" or "fuzzy", where a state is no cell; or "growing": the agent
            chooses a partition, which becomes finer.
        cells: see `Task.make_partition`.
        trials: K, how many trials are made; None: `steps` decides.
        steps: how many interactions of all slots together; None: `trials` decides.
        evaluate_every: interactions between two evaluations of a network.
        spacing: the factor by which interactions grow from one evaluation to the next;
            1 evaluates the policy after each trial.
        watched: names of columns, and the (cell, action) whose level they hold after
            each evaluation.
        reversed_slots: whether the slots are in reverse order, each with the random
            numbers that it has otherwise.
    """

    task: Task
    slots: int = 1
    kind: str = "fuzzy"
    cells: Any = None
    trials: int | None = None
    steps: int | None = None
    evaluate_every: int | None = None
    spacing: float = 1.0
    watched: dict[str, tuple[int, int]] = field(default_factory=dict)
    reversed_slots: bool = False

    @property
    def subject(self) -> str:
        """See `AnyStudy.subject`."""
        return self.task.short_name.lower()

    @property
    def measure(self) -> str:
        """The cost of the policy."""
        return "policy_cost"

    @property
    def unit(self) -> str:
        """See `AnyStudy.unit`."""
        return "trial" if self.curve_points() is None else "interaction"

    @property
    def kernels(self) -> tuple[Any, ...]:
        """See `AnyStudy.kernels`."""
        task, settings = self.task, self.settings
        return (
            *(task.env_id, len(task.env), bool(task.perturbations), task.cost),
            *(self.method, self.kind, str(settings.get("update"))),
            *(settings.get("trace_decay", 0) > 0, settings.get("tabu")),
            settings.get("replay", 0) > 0,
            *(settings.get("selection"), self.reversed_slots),
        )

    def brief(self) -> Study:
        """See `AnyStudy.brief`."""
        if self.method == "planning":
            return replace(self, settings={**self.settings, "max_iterations": 1})
        if self.method in NETWORKS:
            few = {"learning_starts": 16} if self.method == "dqn" else {"n_steps": 8}
            settings = {**self.settings, **few}
            return replace(self, settings=settings, steps=64, evaluate_every=32)
        # Episodes of full length: some kernels are needed only where ants have arrived.
        task = replace(self.task, evaluation_steps=2)
        return replace(self, task=task, slots=4, trials=1, steps=None)

    def with_settings(self, **settings: Any) -> Study:
        """The same with some settings of the agent changed."""
        return replace(self, settings={**self.settings, **settings})

    def make_partition(self) -> Partition:
        """The partition of a method that keeps a table; that it begins with."""
        if self.kind == GROWING:
            return initial_partition(self.task.make_env(1))
        return self.task.make_partition(self.kind, self.cells)

    def curve_points(self) -> list[int] | None:
        """The interactions at which curves have their points; None: after each trial."""
        if self.method == "planning":
            return [0]
        if self.spacing == 1.0 and self.evaluate_every is None:
            return None
        steps = self.steps or 1
        at = np.geomspace(max(1.0, steps / 1_000), steps, CURVE_POINTS)
        return [int(each) for each in np.unique(np.rint(at))]

    def __str__(self) -> str:
        """All of it in one line."""
        parts = [self.method, f"{self.slots} slots"]
        if self.steps is not None:
            parts.append(f"{self.steps:,} steps")
        elif self.trials is not None:
            parts.append(f"{self.trials} trials")
        parts.append(self.kind)
        if isinstance(self.cells, str):
            parts.append(self.cells)
        elif self.cells is not None and np.ndim(self.cells[0]) == 0:
            parts.append(" x ".join(map(str, self.cells)))
        values = {**self.settings, **self.task.env, **self.task.perturbations}
        if self.task.cost is not None:
            values["cost"] = self.task.cost
        parts += [f"{name} = {_short(value)}" for name, value in values.items()]
        return ", ".join(parts + ["slots in reverse order"] * self.reversed_slots)


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


S = TypeVar("S", bound=AnyStudy, default=Study)


@dataclass(frozen=True, kw_only=True)
class Experiment(Generic[S]):
    """A figure of the thesis, a trial beside it, or a comparison of methods.

    Its studies are of one kind, by default `Study`.

    Attributes:
        name: for instance "fig5.4".
        title: what it shows.
        section: of the thesis.
        studies: what is run, under the label that figures and tables give it.
        references: what these are compared with, such as dynamic programming.
        plots: the figures, keys of `plots.PLOTS`.
        table: the table beside the figures, a key of `tables.TABLES`; "" for none.
        claims: the claims of the thesis that it decides.
        explains: the claims that it was tried for, because they do not hold.
        text: what the thesis says and what is decided here, in this project's words.
        options: more that figures and table need.
    """

    name: str
    title: str
    section: str
    studies: Mapping[str, S]
    references: Mapping[str, S] = field(default_factory=dict)
    plots: tuple[str, ...] = ()
    table: str = ""
    claims: tuple[str, ...] = ()
    explains: tuple[str, ...] = ()
    text: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def everything(self) -> list[S]:
        """All that is run."""
        return [*self.studies.values(), *self.references.values()]
