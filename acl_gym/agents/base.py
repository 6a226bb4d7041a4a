"""The base of the agents: a table over a partition, and its policy."""

from __future__ import annotations

import logging
from abc import abstractmethod
from typing import Any, ClassVar, Self

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym.agents.notebook import name_of, page_of
from acl_gym.agents.saving import SavedAgent
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.greedy import greedy_actions
from acl_gym.envs.control.lookup import signals_of
from acl_gym.envs.limits import usual_max_steps
from acl_gym.evaluation.rollout import Rollout
from acl_gym.evaluation.steps import Outcome
from acl_gym.export import Source
from acl_gym.partitions import Partition, checked_partition, locate_checked
from acl_gym.partitions.automatic import automatic_partition
from acl_gym.policies import InterpolatedPolicy, TablePolicy, random_ranks
from acl_gym.utils import validation
from acl_gym.utils.parameters import fixed
from acl_gym.utils.pictures import guarded
from acl_gym.utils.text import count, short
from acl_gym.utils.typing import (
    BoolArray,
    CellArray,
    FloatArray,
    IntArray,
    RankArray,
    Row,
)
from acl_gym.utils.vector_envs import require_vector_env

logger = logging.getLogger("acl_gym")

BYTES_PER_PAIR = 20
"""Memory of an entry of a table at least: value, probability and rank."""


class TabularAgent(SavedAgent):
    """An agent whose policy is the best entry of a (cell, action) table.

    Args:
        env: a vector environment with `Discrete` actions; each slot is one ant.
        partition: turns observations into cells and degrees; None takes
            `automatic_partition(env)`.
        max_steps: T, the longest an episode may last, >= 1. None takes the time limit of
            the environment, or 300 if it has none. A given T may exceed the limit that is
            registered with an id of this package, but no limit of another environment.
        seed: the same seed gives the same run; None draws one from the system.

    Attributes:
        num_timesteps: steps that all slots have taken together.
        trials: trials finished, k.
        seconds: wall-clock time spent learning, without callbacks.
        history: one row per trial: `trial`, `env_steps`, `seconds` (all three
            cumulated), `ants_cost` (mean J of the episodes), `policy_variation` (§3.6.1),
            what the agent adds in `measures`, and, where a `PolicyEvaluation` ran,
            `policy_cost` (3.47). In environments of other packages also the undiscounted
            `ants_return` and `policy_return`. Where success is known, in environments
            of this package and where infos contain `is_success`, also
            `ants_success_rate` and `success_rate`.
        in_trial: whether a trial is under way, or was interrupted by an exception; the
            table is then not that after a complete trial.
        busy: whether a trial is under way now, so that `set_env` and `learn` are refused.
        metadata: your own notes under string keys, empty at first: numbers, text,
            None, and lists, tuples, dicts and arrays of those; saved and loaded with
            the agent.
    """

    slots_are: ClassVar[str] = "slots"
    """What the slots are called where the agent is described."""

    measures_policy: ClassVar[bool] = True
    """Whether the whole policy is looked at after each trial, which takes a while in a
    large table; else rows have no `policy_variation`, and `measures` is given nothing."""

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        max_steps: int | None,
        seed: int | None,
        n_actions: int | None = None,
    ) -> None:
        if env is not None:
            require_vector_env(env)
        if partition is None:
            if env is None:
                raise ValueError(
                    "an agent needs a partition, or env to choose one for; got neither."
                )
            partition = automatic_partition(env)
        self.partition = checked_partition(partition)
        if max_steps is None:
            max_steps = usual_max_steps(env)
        self._max_steps = validation.integer("max_steps", max_steps, at_least=1)
        self.env: VectorEnv[Any, Any, Any] | None = None
        self._rollout: Rollout | None = None
        self.first_action = 0
        if n_actions is not None:
            n_actions = validation.integer("n_actions", n_actions, at_least=1)
        elif env is None:
            raise ValueError(
                "an agent needs env, or n_actions if it is only to predict; got neither."
            )
        self._n_actions = n_actions
        if env is not None:
            self._attach(self._new_rollout(env))
        n_cells = self.partition.n_cells
        validation.check_memory(
            f"the tables of {n_cells} cells and {self.n_actions} actions",
            BYTES_PER_PAIR * n_cells * self.n_actions,
            "use fewer cells or actions",
        )
        self.num_timesteps = 0
        self.trials = 0
        self.seconds = 0.0
        self.history: list[Row] = []
        self.in_trial = False
        self.busy = False
        self.metadata: dict[str, Any] = {}
        self.set_random_seed(seed)

    _fixed: ClassVar[tuple[str, ...]] = ("partition", "pheromone")

    @property
    def _n_cells(self) -> int:
        return len(self._table)

    def __repr__(self) -> str:
        """Environment, slots, partition, and how much has been learned, in a line."""
        name, parts = type(self).__name__, []
        try:
            if self.env is not None:
                parts += [name_of(self.env), f"{self.num_envs} {self.slots_are}"]
            parts.append(repr(self.partition))
            parts.append(self._learned())
        except AttributeError:  # not made completely
            return f"{name}(not complete)"
        return f"{name}({', '.join(map(short, parts))})"

    def _learned(self) -> str:
        trials = "1 trial" if self.trials == 1 else f"{self.trials} trials"
        return f"{trials}, {count(self.num_timesteps)} steps"

    @guarded
    def _repr_html_(self) -> str:
        """What a notebook shows: parameters, how far the agent is, its policy."""
        facts: list[tuple[str, Any]] = [("partition", self.partition)]
        if self.env is not None:
            slots = f"{self.num_envs} {self.slots_are}"
            facts = [("environment", f"{name_of(self.env)}, {slots}"), *facts]
        facts += [
            ("longest episode", f"{self.max_steps} steps"),
            ("learned", self._learned()),
            ("time", f"{self.seconds:.3g} s"),
        ]
        last = self.history[-1] if self.history else {}
        facts += [
            (name.replace("_", " "), f"{last[name]:.4g}")
            for name in ("ants_return", "ants_cost", "policy_return", "policy_cost")
            if last.get(name) is not None
        ]
        return page_of(self, self.policy.best_actions(), facts)

    @abstractmethod
    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Learn; see the agent's own docstring."""

    def outcome(self) -> Outcome:
        """What the episodes of the trial that has just ended came to."""
        return self.rollout.outcome()

    def measures(self, policy: IntArray) -> Row:
        """More columns for the row of a trial, given the policy `(n_cells,)`."""
        return {}

    @abstractmethod
    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        """Choose actions as in learning, with `self._predict_rng`."""

    @property
    def table(self) -> FloatArray:
        """The table as it is now, `(n_cells, n_actions)`.

        It follows learning and is read-only; change it with `set_table`.
        """
        view = self._table.view()
        view.flags.writeable = False
        return view

    @property
    def max_steps(self) -> int:
        """T, the longest an episode may last; fixed once the agent is made."""
        return self._max_steps

    @max_steps.setter
    def max_steps(self, value: int) -> None:
        raise fixed("max_steps", value)

    @property
    def n_actions(self) -> int:
        """The number of actions, the columns of the table."""
        if self._n_actions is None:  # pragma: no cover - the constructor sees to it
            raise ValueError("the agent has no environment; call set_env(env) first.")
        return self._n_actions

    @n_actions.setter
    def n_actions(self, value: int) -> None:
        raise fixed("n_actions", value)

    @property
    def seed(self) -> int | None:
        """What the random numbers began with; `set_random_seed` begins anew."""
        return self._seed

    @seed.setter
    def seed(self, value: int | None) -> None:
        raise AttributeError(
            f"seed is what the random numbers began with, got {validation.shown(value)}; "
            f"call set_random_seed({validation.shown(value)}) to begin anew."
        )

    @property
    def rollout(self) -> Rollout:
        """The rollout over the environment's slots."""
        if self._rollout is None:
            raise ValueError("the agent has no environment; call set_env(env) first.")
        return self._rollout

    @property
    def num_envs(self) -> int:
        """The number of slots: M, the number of ants."""
        return self.rollout.num_envs

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """Learn on another environment from now on; its number of slots may differ.

        Raises:
            TypeError: `env` is not a vector environment.
            ValueError: its actions are not those of the table, or its observations
                not those of the partition.
            RuntimeError: a trial is under way.
        """
        if self.busy:
            raise RuntimeError(
                "set_env must not be called while a trial is under way; call it between "
                "trials, such as in a callback's on_trial_end, or after learn."
            )
        rollout = self._new_rollout(env)
        if rollout.first_action != self.first_action:
            raise ValueError(
                f"env's actions must begin at {self.first_action} as the table's do, "
                f"got {rollout.first_action}."
            )
        self._attach(rollout)

    def _new_rollout(self, env: VectorEnv[Any, Any, Any]) -> Rollout:
        """How the slots of an environment walk."""
        return Rollout(env, self.max_steps)

    def _attach(self, rollout: Rollout) -> None:
        if self._n_actions not in (None, rollout.n_actions):
            raise ValueError(
                f"env must have {self._n_actions} actions as the table has, got "
                f"{rollout.n_actions}."
            )
        space = rollout.env.single_observation_space
        if isinstance(space, (spaces.Dict, spaces.Tuple)):
            raise ValueError(
                "observations must be arrays for an agent with a table, got "
                f"{validation.shown(space)}; flatten them with "
                "gymnasium.wrappers.vector.FlattenObservation, or choose a few "
                "variables with TransformObservation."
            )
        self.partition.check_space(space)
        self._n_actions = rollout.n_actions
        self.first_action = rollout.first_action
        self.env = rollout.env
        self._signals = signals_of(rollout.env)
        self._rollout = rollout
        self._make_room(rollout.num_envs, self.partition.cells_per_state)

    def _make_room(self, slots: int, k: int) -> None:
        """Make memory for the cells of the walking slots."""
        validation.check_memory(
            f"the cells of {slots} slots",
            12 * slots * k,
            "use fewer slots or variables",
        )
        self._located = _Located(slots, k)

    def _replace_partition(self, partition: Partition) -> None:
        """Take over a partition that has grown; the table is to be replaced as well."""
        self.__dict__["partition"] = partition  # fixed for everyone else
        # A function of the size, so that a run that is resumed breaks ties alike.
        ties = np.random.default_rng(partition.n_cells)
        self._ranks = random_ranks(partition.n_cells, self.n_actions, ties)
        if self._rollout is not None:
            self._make_room(self.num_envs, partition.cells_per_state)

    def set_random_seed(self, seed: int | None) -> None:
        """Restart the agent's random numbers.

        There are three independent streams, for learning, for exploring predictions and
        for the order in which ties of the policy are broken, so predictions never
        change what is learned.

        Args:
            seed: >= 0; None draws one from the system.

        Raises:
            TypeError: `seed` is not an integer.
            ValueError: it is negative.
        """
        self._seed = seed = validation.seed(seed)
        learning, predicting, ties = np.random.SeedSequence(seed).spawn(3)
        self.rng = np.random.default_rng(learning)
        self._predict_rng = np.random.default_rng(predicting)
        self._ranks: RankArray = random_ranks(
            self.partition.n_cells, self.n_actions, np.random.default_rng(ties)
        )

    @property
    def policy(self) -> TablePolicy:
        """The policy as it is now; it follows the table until you `copy()` it."""
        return TablePolicy(
            self.partition,
            self._table,
            self._ranks,
            self.first_action,
            self._signals,
        )

    def interpolated_policy(
        self, inputs: ArrayLike | None = None
    ) -> InterpolatedPolicy:
        """A policy of real inputs, between the best action and its neighbours.

        For an environment whose actions are a Box, where this agent has learned in an
        `ActionGrid` around it: `predict` returns floats.

        Args:
            inputs: of each action, `(n_actions,)` or `(n_actions, n_inputs)`; None takes
                what the environment tells, also of a file that was trained there.

        Returns:
            A policy over a copy of the table as it is now.

        Raises:
            ValueError: the inputs are not known, or do not form a grid.
        """
        return InterpolatedPolicy(self.policy.copy(), inputs)

    def _source(self, inputs: ArrayLike | None = None) -> Source:
        if self._rollout is not None and self._rollout.action_mask is not None:
            logger.warning(
                "The environment does not allow every action in every state. What is "
                "exported knows nothing of that and may choose an action that is not "
                "allowed; check what it returns before you apply it."
            )
        return self.policy._source(inputs)

    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        if deterministic:
            return greedy_actions(self._table, self._ranks, index, degree, allowed)
        return self._explore(index, degree, allowed)

    def _locate(
        self, observation: NDArray[Any], ants: IntArray
    ) -> tuple[CellArray, FloatArray]:
        """`(index, degree)` of the walking ants, valid until the next call."""
        index, degree = self._located.rows(ants.size)
        rows = len(self._table)
        locate_checked(self.partition, observation, ants, index, degree, rows)
        return index, degree

    def _next_seed(self) -> int:
        """The seed of the next trial: environments follow the agent's own stream."""
        return int(self.rng.integers(2**31))

    def _checked_table(self, table: ArrayLike) -> FloatArray:
        values = validation.real_array("table", table, ndim=2)
        if values.shape != self._table.shape:
            raise ValueError(
                f"table must have shape {self._table.shape}, got {values.shape}."
            )
        return values


class _Located:
    """Memory for the cells and degrees of the walking slots.

    Args:
        slots: how many slots there are.
        cells_per_state: k.
    """

    def __init__(self, slots: int, cells_per_state: int) -> None:
        self._index: CellArray = np.zeros((slots, cells_per_state), dtype=np.int32)
        self._degree: FloatArray = np.zeros((slots, cells_per_state))
        self._rows = self._index, self._degree

    def rows(self, count: int) -> tuple[CellArray, FloatArray]:
        """The first rows of both; the same views until the count changes."""
        if len(self._rows[0]) != count:
            self._rows = self._index[:count], self._degree[:count]
        return self._rows
