"""Files written while an agent learns: checkpoints and a CSV log."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.callbacks.base import Agent, Callback
from acl_gym.utils import files, validation
from acl_gym.utils.typing import Row

_CHECKPOINT = re.compile(r"trial_(\d{6,})\.npz")


class Checkpoint(Callback):
    """Saves the agent every few trials, so that an interrupted run can be resumed.

    `ACL.load(directory / "trial_000010.npz", env).learn(trials=10)` gives bit for bit
    the result of an uninterrupted run. Place it after the callbacks that add measures,
    so that the files contain those measures.

    Args:
        directory: receives `trial_000010.npz` and so on; made if missing. Use one
            directory per run: files of another run are replaced when a trial has the
            same number, and `keep` may delete those of earlier trials.
        every: trials between saves, >= 1; the last trial is always saved.
        keep: keep only this many of the newest files, >= 1; None keeps all.

    Raises:
        TypeError: a number is not an integer.
        ValueError: a number is below 1.
    """

    def __init__(
        self, directory: str | Path, every: int = 10, keep: int | None = None
    ) -> None:
        self.directory = validation.path("directory", directory)
        self.every = validation.integer("every", every, at_least=1)
        if keep is not None:
            keep = validation.integer("keep", keep, at_least=1)
        self.keep = keep

    def on_training_start(self, agent: Agent) -> None:
        """Make the directory."""
        self.directory.mkdir(parents=True, exist_ok=True)

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Save if a checkpoint is due."""
        if row["trial"] % self.every == 0:
            self._save(agent)
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Save the last trial if it is complete, with measures added to its row."""
        if not agent.in_trial and agent.trials:
            self._save(agent)

    def _save(self, agent: Agent) -> None:
        agent.save(self.directory / f"trial_{agent.trials:06d}.npz")
        if self.keep is None:
            return
        matches = (
            _CHECKPOINT.fullmatch(path.name) for path in self.directory.iterdir()
        )
        trials = sorted(int(match[1]) for match in matches if match)
        # Files of later trials belong to another run and are left alone.
        own = [trial for trial in trials if trial <= agent.trials]
        for trial in own[: -self.keep]:
            (self.directory / f"trial_{trial:06d}.npz").unlink(missing_ok=True)


class CSVLog(Callback):
    """Keeps a CSV file with the agent's complete `history`, one row per trial.

    A row is written as soon as its trial is over. The file starts with the rows in the
    history of a loaded agent, so that a resumed run with the same path continues the
    log without repeating trials. Measures that a trial lacks are empty cells. Numbers
    are written with full precision. Place it after the callbacks that add measures.

    Args:
        path: the file; an existing log is replaced by that of the agent.

    Raises:
        FileNotFoundError: its folder does not exist.
        ValueError: the file exists and is not a log of this class.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = files.checked_target(validation.file_path("path", path))
        if self.path.exists() and not _is_log(self.path):
            raise ValueError(
                f"{self.path} exists and is not a log of acl-gym, whose first column "
                "is 'trial'; choose another path or remove the file."
            )
        self._columns: list[str] = []
        self._last: Row = {}

    def on_training_start(self, agent: Agent) -> None:
        """Write the rows of the history, or an empty file."""
        self._columns = []
        self._write_all(agent.history)

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Append the row; a new column, which is rare, means rewriting the file."""
        if any(name not in self._columns for name in row):
            self._write_all(agent.history)
        else:
            with self.path.open("a", newline="", encoding="utf-8") as file:
                file.write(self._lines([row]))
            self._last = dict(row)
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Rewrite the file if a measure was added to the last row."""
        if agent.history and agent.history[-1] != self._last:
            self._write_all(agent.history)

    def _write_all(self, rows: list[Row]) -> None:
        """Replace the file in one atomic step."""
        self._columns = list(dict.fromkeys(name for row in rows for name in row))
        header = [dict(zip(self._columns, self._columns, strict=True))] if rows else []
        text = self._lines([*header, *rows])
        files.write_atomically(self.path, text.encode())
        self._last = dict(rows[-1]) if rows else {}

    def _lines(self, rows: Iterable[Mapping[str, Any]]) -> str:
        buffer = io.StringIO()
        writer = csv.DictWriter(buffer, self._columns, lineterminator="\n")
        writer.writerows(
            {name: _plain(value) for name, value in row.items()} for row in rows
        )
        return buffer.getvalue()


def _plain(value: Any) -> Any:
    """Turn a NumPy number, which a callback may have added, into a Python number."""
    return value.item() if isinstance(value, np.generic) else value


def _is_log(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open(encoding="utf-8", errors="replace") as file:
        first = file.readline()
    return first == "" or first.split(",")[0].strip() == "trial"
