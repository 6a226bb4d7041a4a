"""The base of the agents: a table over a partition, its policy, saving and loading."""

from __future__ import annotations

import inspect
import os
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, NamedTuple, Self, overload

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym.agents.notebook import name_of, page_of
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.greedy import greedy_actions
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.lookup import signals_of
from acl_gym.evaluation.rollout import Rollout
from acl_gym.export import Source
from acl_gym.partitions import (
    Partition,
    checked_partition,
    given_partition,
    locate_checked,
    partition_from_settings,
    partition_to_settings,
)
from acl_gym.partitions.automatic import automatic_partition
from acl_gym.policies import PartitionPolicy, TablePolicy, random_ranks
from acl_gym.utils import archives, validation
from acl_gym.utils.parameters import fixed
from acl_gym.utils.pictures import guarded
from acl_gym.utils.serialization import (
    Missing,
    from_json,
    missing_in,
    own_name,
    to_json,
    to_settings,
)
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

BYTES_PER_PAIR = 20
"""Memory of an entry of a table at least: value, probability and rank."""

DEFAULT_MAX_STEPS = 300
"""T of Table 5.2, used if neither agent nor environment sets a limit."""

_NOT_GIVEN = ("env", "heuristic", "n_actions", "seed")
"""Arguments of constructors that a file holds otherwise, or that `load` has itself."""

_COLUMNS = (
    "trial",
    "env_steps",
    "seconds",
    "ants_cost",
    "ants_success_rate",
    "policy_variation",
)

_DAMAGES = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    RecursionError,
    TypeError,
    ValueError,
)
"""What nonsense in a file can raise."""


class Snapshot(NamedTuple):
    """What `TabularAgent.snapshot` keeps, for `take_back`."""

    table: FloatArray
    arrays: dict[str, NDArray[Any]]
    generators: list[Any]
    counts: tuple[int, int, float, int]


class TabularAgent(PartitionPolicy):
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
            cumulated), `ants_cost` (mean J of the ants), `policy_variation` (§3.6.1),
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
            max_steps = time_limit(env) or DEFAULT_MAX_STEPS
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
            self._attach(Rollout(env, self.max_steps))
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

    _fixed = ("partition", "pheromone")

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
            parts += [f"{self.trials} trials", f"{count(self.num_timesteps)} steps"]
        except AttributeError:  # not made completely
            return f"{name}(not complete)"
        return f"{name}({', '.join(map(short, parts))})"

    @guarded
    def _repr_html_(self) -> str:
        """What a notebook shows: parameters, how far the agent is, its policy."""
        facts: list[tuple[str, Any]] = [("partition", self.partition)]
        if self.env is not None:
            slots = f"{self.num_envs} {self.slots_are}"
            facts = [("environment", f"{name_of(self.env)}, {slots}"), *facts]
        facts += [
            ("longest episode", f"{self.max_steps} steps"),
            ("learned", f"{self.trials} trials, {count(self.num_timesteps)} steps"),
            ("time", f"{self.seconds:.3g} s"),
        ]
        last = self.history[-1] if self.history else {}
        facts += [
            (name.replace("_", " "), f"{last[name]:.4g}")
            for name in ("ants_return", "ants_cost", "policy_return", "policy_cost")
            if last.get(name) is not None
        ]
        return page_of(self, self.policy.best_actions(), facts)

    @property
    @abstractmethod
    def _table(self) -> FloatArray:
        """The values the policy maximises, `(n_cells, n_actions)`."""

    @abstractmethod
    def set_table(self, table: ArrayLike) -> None:
        """Replace the table, for instance by a better one kept from an earlier trial.

        Raises:
            ValueError: the shape differs or an entry is not valid.
        """

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

    @abstractmethod
    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor, as saved in a file."""

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """More arrays to save, which `_restore` takes over again."""
        return {}

    def _set_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `_arrays` gave."""

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
        rollout = Rollout(env, self.max_steps)
        if rollout.first_action != self.first_action:
            raise ValueError(
                f"env's actions must begin at {self.first_action} as the table's do, "
                f"got {rollout.first_action}."
            )
        self._attach(rollout)

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
        self._rollout = rollout
        slots, k = rollout.num_envs, self.partition.cells_per_state
        validation.check_memory(
            f"the cells of {slots} slots",
            12 * slots * k,
            "use fewer slots or variables",
        )
        self._index: CellArray = np.zeros((slots, k), dtype=np.int32)
        self._degree: FloatArray = np.zeros((slots, k))

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
        self.seed = seed = validation.seed(seed)
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
            None if self.env is None else signals_of(self.env),
        )

    def _source(self, inputs: ArrayLike | None = None) -> Source:
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
        index, degree = self._index[: ants.size], self._degree[: ants.size]
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

    def snapshot(self) -> Snapshot:
        """All that learning changes, as it is now, for `take_back`.

        Take it between two trials; the table and the arrays are copied.
        """
        return Snapshot(
            self._table.copy(),
            {name: array.copy() for name, array in self._arrays().items()},
            [rng.bit_generator.state for rng in (self.rng, self._predict_rng)],
            (self.num_timesteps, self.trials, self.seconds, len(self.history)),
        )

    def take_back(self, snapshot: Snapshot) -> None:
        """Forget what was learned since a snapshot, such as an interrupted trial.

        Args:
            snapshot: of this agent. Learning then goes on, bit for bit, as it did
                after it.
        """
        self.set_table(snapshot.table)
        self._set_arrays(snapshot.arrays)
        for rng, state in zip(
            (self.rng, self._predict_rng), snapshot.generators, strict=True
        ):
            rng.bit_generator.state = state
        self.num_timesteps, self.trials, self.seconds, rows = snapshot.counts
        del self.history[rows:]
        self.in_trial = False

    @overload
    def save(self, path: str | os.PathLike[str]) -> Path: ...

    @overload
    def save(self, path: BinaryIO) -> None: ...

    def save(self, path: archives.Target) -> Path | None:
        """Write the agent to one `.npz` file, atomically and without pickle.

        A user's own cost, deposit, schedule, update rule or partition is saved by its
        name only; `load` says what is to be given again. So are the keywords of a
        subclass's constructor that its `parameters` do not return.

        Args:
            path: where, with or without `.npz`; or a file open for writing in binary
                mode, such as `io.BytesIO()`.

        Returns:
            The path written, with `.npz` added where it was missing; None for a file.

        Raises:
            FileNotFoundError: the folder of the file does not exist.
            TypeError: `metadata` or `history` hold what a file cannot hold.
        """
        parameters = self.parameters()
        header = {
            "agent": type(self).__name__,
            "parameters": {n: _parameter(v) for n, v in parameters.items()},
            "unsaved": sorted(_keywords(type(self)) - parameters.keys()),
            "partition": partition_to_settings(self.partition),
            "n_actions": self.n_actions,
            "first_action": self.first_action,
            "num_timesteps": self.num_timesteps,
            "trials": self.trials,
            "seconds": self.seconds,
            "history": [
                to_json(row, f"history[{i}]") for i, row in enumerate(self.history)
            ],
            "metadata": self.checked_metadata(),
            "generators": [
                rng.bit_generator.state for rng in (self.rng, self._predict_rng)
            ],
        }
        arrays: dict[str, NDArray[Any]] = {"table": self._table, "ranks": self._ranks}
        arrays |= self._arrays()
        written: Path | None = archives.save(path, header, arrays)
        return written

    def checked_metadata(self) -> dict[str, Any]:
        """The notes as a file holds them.

        Raises:
            TypeError: they are no dict, or hold what a file cannot hold.
        """
        if not isinstance(self.metadata, dict):
            raise TypeError(
                f"metadata must be a dict, got {self.metadata!r:.80}; put it under a "
                "key."
            )
        notes: dict[str, Any] = to_json(self.metadata, "metadata")
        return notes

    def require_all_given(self) -> None:
        """Check that nothing is missing that the file of the agent could not hold.

        Raises:
            TypeError: the parameters could not be saved.
            ValueError: something is missing; the message says what is to be given.
        """
        try:
            names = self.parameters()
        except RecursionError as error:
            raise TypeError(
                "cost must lie at most some hundred costs deep, or it cannot be saved; "
                "multiply the factors first."
            ) from error
        parts = (getattr(self, name, None) for name in names)
        for part in (self.partition, *parts):
            if (missing := missing_in(part)) is not None:
                raise missing.error()

    @classmethod
    def load(
        cls,
        path: archives.Target,
        env: VectorEnv[Any, Any, Any] | None = None,
        *,
        max_bytes: int = archives.MOST_BYTES,
        **given: Any,
    ) -> Self:
        """Read an agent that `save` wrote; learning continues where it stopped.

        Args:
            path: the file, with or without `.npz`; or a file open for reading in
                binary mode.
            env: the environment to learn on; not needed to predict.
            max_bytes: the most that the file may hold unpacked. A damaged or malicious
                file cannot take more than a few times as much memory.
            **given: arguments of the constructor that replace those in the file, above
                all a `cost`, `deposit`, `update`, schedule or `partition` of your own,
                of which a file holds the names only.

        Raises:
            FileNotFoundError: there is no such file.
            TypeError: the constructor has no such argument as in `given`.
            ValueError: the file is not one of ours, is damaged, too large, holds
                another kind of agent, or lacks what must be given.
        """
        archive = archives.Archive(path, max_bytes)
        header, arrays, name = archive.header, archive.arrays, archive.name
        if header.get("agent") != cls.__name__:
            raise ValueError(
                f"{name} must hold a {cls.__name__}, got {header.get('agent')!r:.80}; "
                "load it with that class."
            )
        if unknown := given.keys() - _keywords(cls) - {"partition"}:
            raise TypeError(
                f"{cls.__name__}.load takes the arguments of {cls.__name__} except "
                f"{', '.join(_NOT_GIVEN)}, got {', '.join(sorted(unknown))}; one of "
                f"{', '.join(sorted(_keywords(cls)))} may be given."
            )
        try:
            partition = partition_from_settings(header["partition"])
            n_actions = validation.integer("n_actions", header["n_actions"], at_least=1)
            shape = partition.n_cells, n_actions
            # Read before an agent of that size is made.
            if arrays["table"].shape != shape or arrays["ranks"].shape != shape:
                raise ValueError(f"its arrays must have shape {shape}")
            saved = from_json(header["parameters"])
            lacking = _lacking(saved, header.get("unsaved", []), cls) - given.keys()
        except _DAMAGES as error:
            raise _damaged(name, error) from error
        if lacking:
            raise ValueError(
                f"{name} needs {', '.join(sorted(lacking))}, which it does not hold; "
                f"pass {cls.__name__}.load(path, env, {min(lacking)}=...), or let "
                "`parameters` return what is numbers and text."
            )
        if "partition" in given:
            partition = given_partition(given.pop("partition"), partition)
        try:
            parameters = cls._restored_parameters(saved) | given
            agent = cls(None, partition, n_actions=n_actions, **parameters)
            agent._restore(header, arrays)
        except _DAMAGES as error:
            if given:
                raise
            raise _damaged(name, error) from error
        if env is not None:
            agent.set_env(env)
        return agent

    @classmethod
    def _restored_parameters(cls, saved: dict[str, Any]) -> dict[str, Any]:
        """Keyword arguments of the constructor from what `parameters` gave."""
        return dict(saved)

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        """Restore what a file holds in addition to the constructor's arguments.

        `arrays` are read from the file when they are taken.
        """
        self.set_table(arrays["table"])
        ranks = arrays["ranks"]
        if (np.sort(ranks, axis=1) != np.arange(self.n_actions)).any():
            raise ValueError("ranks must be permutations of the actions")
        self._ranks = ranks.astype(np.int32)
        first_action = header["first_action"]
        if not isinstance(first_action, int):
            raise TypeError(f"first_action must be an integer, got {first_action!r}")
        self.first_action = first_action
        for name in ("num_timesteps", "trials"):
            count = validation.integer(name, header[name], at_least=0, at_most=2**62)
            setattr(self, name, count)
        self.seconds = validation.number("seconds", header["seconds"], at_least=0)
        history = from_json(header["history"])
        if not isinstance(history, list) or not all(map(_is_row, history)):
            raise TypeError("history must be a list of rows of measures")
        self.history = history
        metadata = from_json(header.get("metadata", {}))  # older files have none
        if not isinstance(metadata, dict):
            raise TypeError(f"metadata must be a dict, got {metadata!r:.80}")
        self.metadata = metadata
        generators = (self.rng, self._predict_rng)
        for rng, state in zip(generators, header["generators"], strict=True):
            rng.bit_generator.state = state


def _is_row(row: Any) -> bool:
    """Whether it can be a row of `history`; our own columns are numbers."""
    return isinstance(row, dict) and all(
        isinstance(row[name], (int, float)) for name in _COLUMNS if name in row
    )


def _keywords(kind: type) -> set[str]:
    """The arguments of an agent's constructor that a file holds or `load` is given."""
    return {
        name
        for name, parameter in inspect.signature(kind).parameters.items()
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        and name not in _NOT_GIVEN
    } - {"partition"}


def _parameter(value: Any) -> Any:
    """The saved form of a parameter: the value itself, or the name of its class."""
    try:
        return to_json(value, "a parameter")
    except TypeError:
        return to_settings(Missing("", own_name(value)))


def _lacking(saved: Any, unsaved: Any, kind: type) -> set[str]:
    """The arguments of the constructor that the file does not hold."""
    known = {"cost", "deposit", "update", "alpha", "beta", "epsilon"}
    by_name = {
        name
        for name, value in saved.items()
        if isinstance(value, dict) and value.get("type") == "function"
    }
    return (by_name - known) | (set(unsaved) & _keywords(kind))


def _damaged(name: str, error: Exception) -> ValueError:
    if isinstance(error, archives.TooLargeError):
        return ValueError(f"{name} {error}")
    return ValueError(f"{name} is damaged: {str(error).rstrip('.')}.")


def time_limit(env: Any) -> int | None:
    """The time limit that an environment was made or registered with, or None."""
    base = getattr(env, "unwrapped", None)
    limit = getattr(base, "max_episode_steps", None)
    if limit is None and isinstance(base, ControlVectorEnv):
        return None  # it was made without the limit that its id has
    # A vector of single environments may know its limit by those only.
    for each in (env, *getattr(base, "envs", ())[:1]):
        limit = limit or getattr(getattr(each, "spec", None), "max_episode_steps", None)
    return int(limit) if limit and limit > 0 else None
