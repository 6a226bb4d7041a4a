"""What the files of agents hold, and agents made of them again."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, NamedTuple, Self, overload

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym.agents.constructors import (
    NOT_GIVEN,
    check_constructor,
    keywords_of,
    lacking_in,
    saved_parameter,
)
from acl_gym.envs.control.signals import Signals
from acl_gym.partitions import (
    given_partition,
    partition_from_settings,
    partition_to_settings,
)
from acl_gym.policies import PartitionPolicy
from acl_gym.utils import archives, validation
from acl_gym.utils.serialization import (
    from_json,
    missing_in,
    to_json,
)
from acl_gym.utils.typing import FloatArray, RankArray, Row

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
    """What `SavedAgent.snapshot` keeps, for `take_back`."""

    table: FloatArray
    state: Any
    generators: list[Any]
    counts: tuple[int, int, float, int]


class SavedAgent(PartitionPolicy):
    """An agent that files can hold; `TabularAgent` documents its attributes."""

    num_timesteps: int
    trials: int
    seconds: float
    history: list[Row]
    metadata: dict[str, Any]
    in_trial: bool
    _signals: Signals | None = None
    """What observations and actions mean, if known."""
    rng: np.random.Generator
    _predict_rng: np.random.Generator
    _ranks: RankArray

    _given_again: ClassVar[tuple[str, ...]] = ()
    """Of `NOT_GIVEN` what `load` takes nevertheless, because it may be a function."""

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
    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """Learn on another environment from now on."""

    @abstractmethod
    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor, as saved in a file."""

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """More arrays to save, which `_restore` takes over again."""
        return {}

    def _set_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `_arrays` gave."""

    def _state(self) -> Any:
        """What learning changes beside the table, for `_take_over`; copied."""
        return {name: array.copy() for name, array in self._arrays().items()}

    def _take_over(self, table: FloatArray, state: Any) -> None:
        """Take over a table, and what `_state` gave with it."""
        self.set_table(table)
        self._set_arrays(state)

    def snapshot(self) -> Snapshot:
        """All that learning changes, as it is now, for `take_back`.

        Take it between two trials; the table and the arrays are copied.
        """
        return Snapshot(
            self._table.copy(),
            self._state(),
            [rng.bit_generator.state for rng in (self.rng, self._predict_rng)],
            (self.num_timesteps, self.trials, self.seconds, len(self.history)),
        )

    def take_back(self, snapshot: Snapshot) -> None:
        """Forget what was learned since a snapshot, such as an interrupted trial.

        Args:
            snapshot: of this agent. Learning then goes on, bit for bit, as it did
                after it.
        """
        self._take_over(snapshot.table, snapshot.state)
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
            TypeError: `metadata` or `history` hold what a file cannot hold, or the
                constructor of a subclass does not take what `load` would pass.
        """
        parameters = self.parameters()
        check_constructor(type(self), parameters)
        header = {
            "agent": type(self).__name__,
            "parameters": {n: saved_parameter(v) for n, v in parameters.items()},
            "unsaved": sorted(keywords_of(type(self)) - parameters.keys()),
            "partition": partition_to_settings(self.partition),
            "n_actions": self.n_actions,
            "first_action": self.first_action,
            "signals": None if self._signals is None else asdict(self._signals),
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
                "metadata must be a dict, got "
                f"{validation.shown(self.metadata)}; put it under a "
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
            parts = [getattr(self, name, None) for name in self.parameters()]
            missing = [missing_in(part) for part in (self.partition, *parts)]
        except RecursionError as error:
            raise TypeError(
                "cost must lie at most some hundred costs deep, or it cannot be saved; "
                "multiply the factors first."
            ) from error
        for each in missing:
            if each is not None:
                raise each.error()

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
                f"{name} must hold an agent of class {cls.__name__}, got "
                f"{header.get('agent')!r:.80}; "
                "load it with that class."
            )
        takes = keywords_of(cls) | set(cls._given_again)
        if unknown := given.keys() - takes - {"partition"}:
            raise TypeError(
                f"{cls.__name__}.load takes the arguments of {cls.__name__} except "
                f"{', '.join(sorted(set(NOT_GIVEN) - takes))}, got "
                f"{', '.join(sorted(unknown))}; one of {', '.join(sorted(takes))} may be "
                "given."
            )
        try:
            partition = partition_from_settings(header["partition"])
            n_actions = validation.integer("n_actions", header["n_actions"], at_least=1)
            shape = partition.n_cells, n_actions
            # Read before an agent of that size is made.
            if arrays["table"].shape != shape or arrays["ranks"].shape != shape:
                raise ValueError(f"its arrays must have shape {shape}")
            saved = from_json(header["parameters"])
            lacking = (
                lacking_in(saved, header.get("unsaved", []), cls, cls._given_again)
                - given.keys()
            )
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
            make: Callable[..., Self] = cls
            agent = make(None, partition, n_actions=n_actions, **parameters)
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
            raise TypeError(
                f"first_action must be an integer, got {validation.shown(first_action)}"
            )
        self.first_action = first_action
        signals = header.get("signals")  # older files have none
        if signals is not None:
            self._signals = Signals(**signals)
            if len(self._signals.values) != self.n_actions:
                raise ValueError("signals must have values for each action")
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
            raise TypeError(
                f"metadata must be a dict, got {validation.shown(metadata)}"
            )
        self.metadata = metadata
        generators = (self.rng, self._predict_rng)
        for rng, state in zip(generators, header["generators"], strict=True):
            rng.bit_generator.state = state


def with_prefix(
    prefix: str, arrays: Mapping[str, NDArray[Any]]
) -> dict[str, NDArray[Any]]:
    """The arrays whose names begin so, without the prefix."""
    return {
        name.removeprefix(prefix): arrays[name]
        for name in arrays
        if name.startswith(prefix)
    }


def _is_row(row: Any) -> bool:
    """Whether it can be a row of `history`; our own columns are numbers."""
    return isinstance(row, dict) and all(
        isinstance(row[name], (int, float)) for name in _COLUMNS if name in row
    )


def _damaged(name: str, error: Exception) -> ValueError:
    if isinstance(error, archives.TooLargeError):
        return ValueError(f"{name} {error}")
    return ValueError(f"{name} is damaged: {str(error).rstrip('.')}.")
