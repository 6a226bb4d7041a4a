"""What is left on disk while an agent learns: agents to go on from, and its log."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from acl_gym.callbacks.base import Agent, Callback
from acl_gym.utils import files, validation
from acl_gym.utils.typing import Row

_CHECKPOINT = re.compile(r"trial_(\d{6,})\.npz")


class Checkpoint(Callback):
    """Saves the agent every few trials, to go on from if the run is cut short.

    `ACL.load(directory / "trial_000010.npz", env).learn(trials=10)` is then what
    learning on would have been, bit for bit. Put it after the callbacks that add
    measures, so that these are in the file.

    Args:
        directory: receives `trial_000010.npz` and so on; made if it is not there. One
            run, one directory: of another run in it, files of the same trials are
            replaced, and those of earlier trials count as old.
        every: save after each so many trials, and after the last, >= 1.
        keep: leave only so many of the newest, >= 1; None leaves all.

    Raises:
        TypeError: a number is not an integer.
        ValueError: a number is below 1.
    """

    def __init__(
        self, directory: str | Path, every: int = 10, keep: int | None = None
    ) -> None:
        self.directory = Path(directory)
        self.every = validation.integer("every", every, at_least=1)
        if keep is not None:
            keep = validation.integer("keep", keep, at_least=1)
        self.keep = keep

    def on_training_start(self, agent: Agent) -> None:
        """Make the directory."""
        self.directory.mkdir(parents=True, exist_ok=True)

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Save if it is time to."""
        if row["trial"] % self.every == 0:
            self._save(agent)
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Save the last trial if it is whole, with what its row has gained since."""
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
        # Later trials are those of another run, and none of our business.
        ours = [trial for trial in trials if trial <= agent.trials]
        for trial in ours[: -self.keep]:
            (self.directory / f"trial_{trial:06d}.npz").unlink(missing_ok=True)


class CSVLog(Callback):
    """Keeps a CSV file that holds the agent's whole `history`, one row a trial.

    A row is in the file as soon as its trial is over. The file begins with the rows
    that a loaded agent brings with it, so that going on with the same path continues
    it and repeats no trial. Cells of measures that a trial lacks are empty; numbers are
    written so that reading gives the same ones. Put it after the callbacks that add
    measures.

    Args:
        path: the file; a log that is there is replaced by that of the agent.

    Raises:
        FileNotFoundError: there is no such folder.
        ValueError: the file is there and is no such log.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = files.checked_target(Path(path))
        if self.path.exists() and not _is_log(self.path):
            raise ValueError(
                f"{self.path} is there already and is not a log of acl-gym, whose "
                "first column is 'trial'; choose another path or remove it."
            )
        self._columns: list[str] = []
        self._last: Row = {}

    def on_training_start(self, agent: Agent) -> None:
        """Write the rows that are there already, or an empty file."""
        self._columns = []
        self._write_all(agent.history)

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Append the row; a new column, which is rare, means writing all anew."""
        if any(name not in self._columns for name in row):
            self._write_all(agent.history)
        else:
            with self.path.open("a", newline="", encoding="utf-8") as file:
                file.write(self._lines([row]))
            self._last = dict(row)
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Write the last row again if it has gained a measure since."""
        if agent.history and agent.history[-1] != self._last:
            self._write_all(agent.history)

    def _write_all(self, rows: list[Row]) -> None:
        """Write the file anew, whole or not at all."""
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
    """A NumPy number, which a callback may have left, as Python's; csv writes `repr`."""
    return value.item() if hasattr(value, "item") else value


def _is_log(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open(encoding="utf-8", errors="replace") as file:
        first = file.readline()
    return first == "" or first.split(",")[0].strip() == "trial"
