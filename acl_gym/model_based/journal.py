"""A folder in which every interaction is written down as soon as it was made.

A process may be killed at any moment: what the plant did until then is in the file, each
step once. A line that was not completed is cut off when the run goes on.
"""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from filelock import FileLock, Timeout
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.learned.description import described_by
from acl_gym.model_based.arguments import action_space_of
from acl_gym.utils import validation
from acl_gym.utils.files import write_atomically
from acl_gym.utils.typing import Row

DATA, SETTINGS = "transitions.csv", "run.json"
AGENT, BEST = "agent.npz", "best.npz"
LOCK = "running.lock"

_STATE, _VERSION = "state.json", 1


class State(NamedTuple):
    """How far a run has come.

    Attributes:
        interactions: after how many the colony has learned; -1: it has not.
        seconds: of computing.
        history: see `PlantLearning`.
    """

    interactions: int
    seconds: float
    history: list[Row]


class Journal:
    """The file of steps of one run, and its settings.

    Args:
        folder: made if it does not exist.
        settings: of the run, JSON types; a folder that is there must have the same.
        env: the plant, which tells what its numbers are.
        values: the inputs of each action where these are continuous, or where somebody
            has said what numbered ones set.

    Attributes:
        arrays: what the file held, arguments of `Transitions`; None if it is new.

    Raises:
        ValueError: the folder holds another run, or one that is running.
        OSError: it cannot be written.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        settings: dict[str, Any],
        env: Any,
        values: NDArray[np.float64] | None,
    ) -> None:
        self.folder = validation.path("folder", folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise NotADirectoryError(
                f"folder must be a folder or a new name, got the file {self.folder}."
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        # Released by the operating system when the process ends, however it does.
        self._lock = FileLock(self.folder / LOCK)
        try:
            self._lock.acquire(timeout=0)
        except Timeout as error:
            raise ValueError(
                f"{self.folder} must be used by one run at a time, got another one that "
                "writes there now; wait for its end, or give another folder."
            ) from error
        self._file: IO[str] | None = None  # opened with the first step
        try:
            self._open(settings, env, values)
        except BaseException:
            self.close()
            raise

    def _open(
        self,
        settings: dict[str, Any],
        env: Any,
        values: NDArray[np.float64] | None,
    ) -> None:
        """Compare the settings, and read what was written; see the class."""
        numbered = isinstance(action_space_of(env), spaces.Discrete)
        facts = described_by(env, values if numbered else None)
        self._size, self._n_inputs = facts.pop("size"), facts.pop("n_inputs")
        settings = {**settings, "plant": _plain(facts)}
        self._check(settings)
        self.arrays, self._runs = self._read()

    def close(self) -> None:
        """Close the file, and let others write in the folder."""
        if self._file is not None:
            self._file.close()
        self._lock.release()

    def path(self, name: str) -> Path:
        """A file of the run."""
        return self.folder / name

    def keep_state(self, state: State) -> None:
        """Write down how far the run has come."""
        content = json.dumps(state._asdict()).encode()
        write_atomically(self.folder / _STATE, content)

    def kept_state(self) -> State | None:
        """How far the run had come; None if nothing was learned.

        Raises:
            ValueError: the file is damaged.
        """
        path = self.folder / _STATE
        if not path.exists():
            return None
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            rows = [dict(row) for row in found["history"]]
            return State(int(found["interactions"]), float(found["seconds"]), rows)
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(
                f"{path} cannot be read: {error}; remove it to learn anew from what was "
                "recorded."
            ) from error

    def append(self, steps: dict[str, NDArray[Any]], runs: NDArray[np.int64]) -> None:
        """Write steps down; when this returns, they outlive the process.

        Args:
            steps: arguments of `Transitions`, `(n, ...)`.
            runs: the number of the run that each belongs to, `(n,)`.
        """
        table = np.column_stack(
            [steps["states"], steps["inputs"], steps["next_states"], steps["rewards"]]
        )
        if self._file is None:
            self._file = (self.folder / DATA).open("a", newline="", encoding="utf-8")
        writer = csv.writer(self._file)
        if self._file.tell() == 0:
            writer.writerow(self._columns())
        for run, row, ended in zip(runs, table, steps["terminated"], strict=True):
            # repr gives back the same number, to the bit.
            values = map(repr, row.tolist())
            writer.writerow([int(run) + self._runs, *values, int(ended)])
        self._file.flush()

    def _check(self, settings: dict[str, Any]) -> None:
        path = self.folder / SETTINGS
        wanted = {"version": _VERSION, **settings}
        if not path.exists():
            if (self.folder / DATA).exists():
                raise ValueError(
                    f"{self.folder} holds {DATA}, but no {SETTINGS}; give another folder."
                )
            write_atomically(path, (json.dumps(wanted, indent=1) + "\n").encode())
            return
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            changed = sorted(k for k in wanted if found.get(k) != wanted[k])
        except (ValueError, AttributeError, OSError) as error:
            raise ValueError(
                f"{path} cannot be read: {error}; give another folder."
            ) from error
        if changed:
            name = changed[0]
            raise ValueError(
                f"{self.folder} holds another run, with {name}={found.get(name)!r}, got "
                f"{name}={wanted[name]!r}; give another folder, or the same arguments "
                "to go on."
            )

    def _read(self) -> tuple[dict[str, NDArray[Any]] | None, int]:
        """What was written until now, without a line that was not completed."""
        path = self.folder / DATA
        if not path.exists():
            return None, 0
        content = path.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if len(whole) < len(content):
            write_atomically(path, whole)
        rows = list(csv.reader(io.StringIO(whole.decode(errors="replace"))))
        if not rows:
            return None, 0
        if rows[0] != self._columns():
            raise ValueError(
                f"{path} must have the columns {self._columns()}, got {rows[0]}; give "
                "another folder."
            )
        if len(rows) == 1:
            return None, 0
        table = self._table(path, rows)
        ends = np.cumsum([1, self._size, self._n_inputs, self._size, 1])
        run, states, inputs, after, rewards, ended = np.split(table, ends, axis=1)
        order = np.argsort(run[:, 0], kind="stable")
        found = {
            "states": states[order],
            "inputs": inputs[order],
            "next_states": after[order],
            "rewards": rewards[order, 0],
            "terminated": ended[order, 0],
            "episodes": run[order, 0].astype(np.int64),
        }
        return found, int(run.max()) + 1

    def _table(self, path: Path, rows: list[list[str]]) -> NDArray[np.float64]:
        """The numbers of all lines but the first.

        Raises:
            ValueError: a line does not hold as many.
        """
        for number, row in enumerate(rows[1:], start=2):
            try:
                good = len(row) == len(rows[0]) and bool(
                    np.isfinite([float(cell) for cell in row]).all()
                )
            except ValueError:
                good = False
            if not good:
                raise ValueError(
                    f"line {number} of {path} must hold {len(rows[0])} finite numbers, "
                    f"got {validation.shown(','.join(row))}; remove that line to go on."
                )
        return np.array(rows[1:], dtype=np.float64)

    def _columns(self) -> list[str]:
        states = [f"x{i}" for i in range(self._size)]
        inputs = [f"u{i}" for i in range(self._n_inputs)]
        after = [f"next_{name}" for name in states]
        return ["run", *states, *inputs, *after, "reward", "terminated"]


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    """What the environment tells of its numbers, as text, to tell plants apart."""
    return {name: repr(np.asarray(value).tolist()) for name, value in facts.items()}
