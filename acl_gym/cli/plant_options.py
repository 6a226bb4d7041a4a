"""Options of `acl-gym train` for few steps of a plant, and for none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from acl_gym.cli.errors import BadArgumentError
from acl_gym.cli.recorded import split_names

if TYPE_CHECKING:  # slow to import
    from acl_gym.envs.learned import Transitions

TABLES = {".csv": "csv", ".parquet": "parquet"}
"""The endings of files with a row for each moment."""


class PlantOptions(NamedTuple):
    """What was asked for, as it was typed.

    Attributes:
        interactions: steps to be made; None: those of `from_data` only.
        restart_after: steps after which the environment is reset.
        from_data: a file of recorded steps.
        state: columns of a table, with commas.
        input: the same.
        time: a column.
        run: a column whose value changes from one run to the next.
        reward: a column of the reward of the step that begins in a row.
        terminated: a column that says whether an episode ended with that step.
        circular: names or numbers of variables that wrap around, with commas.
    """

    interactions: int | None
    restart_after: int | None
    from_data: Path | None
    state: str | None
    input: str | None
    time: str | None
    run: str | None
    reward: str | None
    terminated: str | None
    circular: str | None

    @property
    def wanted(self) -> bool:
        """Whether to learn in a model."""
        return self.interactions is not None or self.from_data is not None

    @property
    def columns(self) -> dict[str, Any]:
        """Arguments of `Transitions.from_csv`."""
        named: dict[str, Any] = {
            "state": _names("--state", self.state),
            "input": _names("--input", self.input),
        }
        for name in ("time", "run", "reward", "terminated"):
            column = getattr(self, name)
            if column is not None:
                named[name] = column
        return named

    def circular_variables(self, data: Transitions | None) -> list[str | int] | None:
        """What `learn_from_plant` takes for `circular`.

        Args:
            data: whose names are known; others are numbers, counted from 0.
        """
        if self.circular is None:
            return None
        known = () if data is None else data.state_names
        return [
            int(each) if each.isdecimal() and each not in known else each
            for each in _names("--circular", self.circular, "variables")
        ]

    @property
    def kind_of_table(self) -> str | None:
        """Either "csv" or "parquet"; None for a file of `Transitions`."""
        return (
            None
            if self.from_data is None
            else TABLES.get(self.from_data.suffix.lower())
        )

    def refuse_options(self, given: dict[str, Any]) -> None:
        """Refuse options that have no meaning here.

        Args:
            given: what was typed, by option; None where nothing was.

        Raises:
            BadArgumentError: one was typed.
        """
        own = "--from-data" if self.interactions is None else "--interactions"
        for option, value in given.items():
            if value is not None:
                raise BadArgumentError(
                    f"{option} does not go with {own}, which learns in a model, round "
                    "after round; leave it out."
                )

    def check(self) -> None:
        """Check that the options go together.

        Raises:
            BadArgumentError: one option needs another, or excludes it.
        """
        if self.restart_after is not None and self.interactions is None:
            raise BadArgumentError(
                "--restart-after belongs to --interactions, which makes steps; leave it "
                "out or add --interactions N."
            )
        if self.circular is not None and not self.wanted:
            raise BadArgumentError(
                "--circular belongs to --interactions and --from-data, which learn in a "
                "model; leave it out or add one of them."
            )
        columns = {
            "--state": self.state,
            "--input": self.input,
            "--time": self.time,
            "--run": self.run,
            "--reward": self.reward,
            "--terminated": self.terminated,
        }
        typed = [option for option, names in columns.items() if names is not None]
        if self.kind_of_table is None:
            if typed:
                raise BadArgumentError(
                    f"{typed[0]} names columns of --from-data FILE.csv or FILE.parquet, "
                    f"got {'no such file' if self.from_data is None else self.from_data}"
                    "; leave it out or name such a file."
                )
            return
        for option in ("--state", "--input"):
            if columns[option] is None:
                raise BadArgumentError(
                    f"--from-data {self.from_data} needs {option} with the names of "
                    "columns, such as --state theta,omega --input u."
                )
        if self.terminated is not None and self.run is None:
            raise BadArgumentError(
                "--terminated needs --run with the column that changes from one run to "
                "the next: without it the row after an end may be its last state or the "
                "first of the next run."
            )


def _names(option: str, text: str | None, what: str = "columns") -> list[str]:
    names = split_names(text or "")
    if not all(names):
        raise BadArgumentError(
            f"{option} must be names of {what} such as theta,omega, got {text!r}."
        )
    return names
