"""Recorded transitions of a plant: checked arrays, joined, saved and read again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.learned import data_sets, reading, saving, table_files
from acl_gym.envs.learned.arrays import (
    checked_column,
    checked_flags,
    checked_runs,
    checked_table,
    chosen_runs,
    runs_of,
)
from acl_gym.envs.learned.description import Description, described
from acl_gym.envs.learned.quality import doubts, unit_doubts
from acl_gym.envs.learned.recorder import Policy, Recorder
from acl_gym.utils import archives, validation
from acl_gym.utils.angles import find_angles
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class Transitions:
    """Recorded steps of a plant: a state, the input held for a sampling time, the next state.

    Read them from a run of an environment (`record`), from files of measurements
    (`from_csv`, `from_parquet`, `from_frame`), or from a Minari data set
    (`from_minari`); several recordings of one plant are added with `+`.

    >>> import gymnasium as gym
    >>> from acl_gym import Transitions
    >>> env = gym.make("acl_gym/Pendulum-v0")
    >>> data = Transitions.record(env, steps=300, seed=0)
    >>> len(data), data.states.shape, data.input_names
    (300, (300, 2), ('torque u, N m',))

    Args:
        states: x(t), `(n, state_size)`, or `(n,)` for one variable; up to 1e100 in size,
            as all numbers are.
        inputs: u(t), `(n, n_inputs)`, or `(n,)` for one input.
        next_states: x(t+1), in the shape of `states`.
        rewards: of the steps, `(n,)`; None if they are not known.
        terminated: whether an episode ended with the step, in its goal or in failure,
            `(n,)`; None if that is not known.
        episodes: the number of the run that each step belongs to, `(n,)`, in order, up to
            2^53 in size; None begins a new run wherever a state is not the next state of
            the step before.
        state_names: of the variables, with units.
        input_names: of the inputs.
        low: lower end of each variable, None where it is unknown.
        high: upper end of each.
        circular: names or numbers of the variables that wrap around from `high` to
            `low`, such as angles; without ends these are -pi and pi. Angles that were
            counted on beyond the ends are brought back.
        angles: pairs of variables that are cosine and sine of one angle; None looks for
            them.
        values: the inputs of each action, `(n_actions, n_inputs)`, where they are known.
        numbered: whether the inputs are numbers of actions, without order or size.
        sampling_time: s, > 0, where it is known.

    Raises:
        ValueError: the arrays do not belong together, or hold NaN or numbers that are too
            large; a name, bound or axis is not valid.
        TypeError: `circular` or `angles` are of the wrong kind.
    """

    def __init__(
        self,
        states: ArrayLike,
        inputs: ArrayLike,
        next_states: ArrayLike,
        rewards: ArrayLike | None = None,
        terminated: ArrayLike | None = None,
        *,
        episodes: ArrayLike | None = None,
        state_names: Sequence[str] | None = None,
        input_names: Sequence[str] | None = None,
        low: Any = None,
        high: Any = None,
        circular: Iterable[int | str] = (),
        angles: Any = None,
        values: Any = None,
        numbered: bool = False,
        sampling_time: float | None = None,
    ) -> None:
        x = checked_table("states", states)
        count = len(x)
        u = checked_table("inputs", inputs, rows=count)
        y = checked_table("next_states", next_states, rows=count, columns=x.shape[1])
        self.description = described(
            x.shape[1],
            u.shape[1],
            state_names=state_names,
            input_names=input_names,
            low=low,
            high=high,
            circular=circular,
            angles=find_angles(x) if angles is None else angles,
            values=values,
            numbered=numbered,
            sampling_time=sampling_time,
        )
        self.description.check_numbers(u)
        # Before angles are brought back between their ends, which hides the unit.
        self._unit_doubts = unit_doubts(x, y, self.description)
        x, y = self.description.settled(x), self.description.settled(y)
        self._arrays: dict[str, NDArray[Any]] = {
            "states": x,
            "inputs": u,
            "next_states": y,
        }
        if rewards is not None:
            self._arrays["rewards"] = checked_column("rewards", rewards, count)
        if terminated is not None:
            self._arrays["terminated"] = checked_flags("terminated", terminated, count)
        self._arrays["episodes"] = (
            runs_of(x, y) if episodes is None else checked_runs(episodes, count)
        )
        for array in self._arrays.values():
            array.setflags(write=False)

    @property
    def states(self) -> FloatArray:
        """x(t), `(n, state_size)`, read-only."""
        return self._arrays["states"]

    @property
    def inputs(self) -> FloatArray:
        """u(t), `(n, n_inputs)`, read-only."""
        return self._arrays["inputs"]

    @property
    def next_states(self) -> FloatArray:
        """x(t+1), `(n, state_size)`, read-only."""
        return self._arrays["next_states"]

    @property
    def rewards(self) -> FloatArray | None:
        """The rewards of the steps, `(n,)`, read-only; None if they are not known."""
        return self._arrays.get("rewards")

    @property
    def terminated(self) -> BoolArray | None:
        """Whether an episode ended, `(n,)`, read-only; None if that is not known."""
        return self._arrays.get("terminated")

    @property
    def episodes(self) -> IntArray:
        """The number of the run that each step belongs to, `(n,)`, read-only."""
        return self._arrays["episodes"]

    @property
    def starts(self) -> FloatArray:
        """The states in which runs began, `(n_runs, state_size)`, a new array."""
        first = np.ones(len(self), np.bool_)
        first[1:] = self.episodes[1:] != self.episodes[:-1]
        return self.states[first]

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return self.description.state_names

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.description.input_names

    @property
    def sampling_time(self) -> float | None:
        """Seconds between a state and the next; None if that is not known."""
        return self.description.sampling_time

    def __len__(self) -> int:
        """The number of steps."""
        return len(self.states)

    def __repr__(self) -> str:
        """How many steps and runs, and of what."""
        runs = len(self.starts)
        names = ", ".join(name.split(",")[0] for name in self.state_names)
        inputs = ", ".join(name.split(",")[0] for name in self.input_names)
        return (
            f"Transitions({len(self):,} steps in {runs:,} "
            f"{'run' if runs == 1 else 'runs'}, state {names}, input {inputs})"
        )

    def __getitem__(self, rows: Any) -> Self:
        """Some steps: a slice, or a mask `(n,)`.

        Where two that follow each other did not do so before, a new run begins.

        Raises:
            TypeError: `rows` is neither.
            ValueError: none are left, or the mask has another length.
        """
        if not isinstance(rows, slice):
            mask = validation.as_array(rows)
            if mask is None or mask.dtype != np.bool_:
                raise TypeError(
                    "steps must be chosen by a slice or a mask of booleans, got "
                    f"{validation.shown(rows)}; for step i use [i : i + 1]."
                )
            if mask.shape != (len(self),):
                raise ValueError(
                    f"the mask must have shape ({len(self)},), one for each step, got "
                    f"{mask.shape}."
                )
            rows = mask
        kept = {name: array[rows] for name, array in self._arrays.items()}
        if not len(kept["states"]):
            raise ValueError("at least one step must be left, got none.")
        kept["episodes"] = chosen_runs(self.episodes, np.arange(len(self))[rows])
        return self._made(self.description, kept, self._unit_doubts)

    def __add__(self, other: Any) -> Self:
        """Both recordings, one after the other.

        What only one of them knows, such as rewards, is left out. So are the inputs of
        the actions where they differ.

        Raises:
            ValueError: they are not of the same plant: names, angles, the numbers of
                actions or the sampling time differ.
        """
        if not isinstance(other, Transitions):
            return NotImplemented
        difference = self.description.difference(other.description)
        if difference is not None:
            raise ValueError(
                f"recordings must be of the same plant, got {difference}; give both the "
                "same description."
            )
        joined = {
            name: np.concatenate([array, other._arrays[name]])
            for name, array in self._arrays.items()
            if name in other._arrays
        }
        after = self.episodes[-1] + 1 - other.episodes[0]
        joined["episodes"][len(self) :] += after
        either = list(dict.fromkeys(self._unit_doubts + other._unit_doubts))
        return self._made(self.description.joined(other.description), joined, either)

    def doubts(self) -> list[str]:
        """What speaks against learning from this data, a sentence each; empty if nothing.

        Looked for are few steps, inputs and variables that never change, rows that are
        there twice, and units that do not fit together.
        """
        found = doubts(
            self.states, self.inputs, self.next_states, self.episodes, self.description
        )
        return found + self._unit_doubts

    def save(self, path: archives.Target) -> Any:
        """Write everything to one file, in one atomic step.

        Args:
            path: the file, to which `.npz` is added where it is missing.

        Returns:
            The path written; None for an open file.
        """
        return saving.save(path, self.description, self._arrays, self._unit_doubts)

    @classmethod
    def load(cls, path: archives.Target, *, max_bytes: int = saving.MOST_BYTES) -> Self:
        """Read what `save` wrote. A file from a stranger runs no code.

        Args:
            path: the file, with or without `.npz`.
            max_bytes: what it may hold unpacked.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is not a file of this package, or is damaged.
        """
        found, told = saving.load(
            path, max_bytes, lambda facts, told: (cls(**facts), told)
        )
        found._unit_doubts = list(dict.fromkeys(found._unit_doubts + told))
        return found

    @classmethod
    def record(
        cls,
        env: Any,
        steps: int,
        policy: Policy = None,
        *,
        hold: int = 1,
        inputs: Any = None,
        seed: int | None = None,
    ) -> Self:
        """Run an environment and keep what it did.

        Args:
            env: a single or a vector environment with a Box of one axis as observations,
                and `Discrete` actions or a Box of one axis. It is left in the middle of
                its episodes.
            steps: of all slots together, >= 1; a vector environment takes at most
                `num_envs` - 1 more.
            policy: something with `predict(observations)`, or a function of the
                observations `(n, ...)` that returns the actions of n slots. None draws
                them from the action space.
            hold: for how many steps a random action is kept, >= 1. An input that changes
                in each step hardly moves a sluggish plant.
            inputs: what each numbered action sets, `(n_actions,)` or
                `(n_actions, n_inputs)`, where you know it and the environment does not
                tell. These values are then recorded: a model learns from one action what
                another does, which from mere numbers it cannot.
            seed: of the environment and of random actions.
        """
        steps = validation.integer("steps", steps, at_least=1)
        recorder = Recorder(env, policy, hold=hold, inputs=inputs, seed=seed)
        while recorder.steps < steps:
            recorder.step()
        facts: dict[str, Any] = {**recorder.arrays(), **recorder.facts}
        return cls(**facts)

    @classmethod
    def from_frame(cls, frame: Any, **columns: Any) -> Self:
        """Read a pandas frame, a row for each moment; see `from_csv`."""
        return cls(**reading.arrays_of_frames([frame], **columns))

    @classmethod
    def from_csv(cls, path: Any, **columns: Any) -> Self:
        """Read measurements from a CSV file, a row for each moment.

        A step leads from each row to the next of the same run. A row with a gap in time
        before it begins a new run.

        Args:
            path: the file, or several files, each with runs of its own.
            **columns: which columns there are:

                - `state`: names of the columns of the state, required;
                - `input`: those of the inputs, which are held from their row to the
                  next, required;
                - `time`: the column of the time in seconds, or of dates in a frame or in
                  Parquet, for gaps and the sampling time;
                - `run`: the column whose value changes from one run to the next;
                - `reward`, `terminated`: columns of the step that begins in a row;
                - `next_state`: columns of the next state, for rows that are steps
                  already.

                And what `Transitions` takes: `state_names` and `input_names` in place of
                the names of the columns, `circular`, `low`, `high`, `sampling_time`,
                `values`, `angles`, `numbered`.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: a column is missing or holds what is no number, a row has no run,
                or time does not increase.
            TypeError: an argument has another name.
        """
        return cls(**table_files.arrays_of_files(path, "csv", **columns))

    @classmethod
    def from_parquet(cls, path: Any, **columns: Any) -> Self:
        """Read measurements from a Parquet file; see `from_csv`."""
        return cls(**table_files.arrays_of_files(path, "parquet", **columns))

    @classmethod
    def from_minari(cls, dataset: Any, **described: Any) -> Self:
        """Read a data set of Minari.

        Args:
            dataset: a `minari.MinariDataset`, or the id of one on this machine.
            **described: what `Transitions` takes beyond the arrays.

        Raises:
            ImportError: an id is given, and minari is not installed.
            FileNotFoundError: there is no data set of that id on this machine.
            ValueError: it is damaged, or holds no episode.
            TypeError: observations or actions are not arrays of one axis or numbers.
        """
        return cls(**{**data_sets.arrays_of_minari(dataset), **described})

    @classmethod
    def _made(
        cls, description: Description, arrays: dict[str, Any], unit_doubts: list[str]
    ) -> Self:
        """Make a recording of arrays that were checked before."""
        made = cls.__new__(cls)
        made.description, made._arrays = description, arrays
        made._unit_doubts = list(unit_doubts)
        for array in arrays.values():
            array.setflags(write=False)
        return made
