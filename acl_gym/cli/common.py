"""Shared by the commands: options that all of them have, JSON, tables, suggestions."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from acl_gym.cli.errors import BadArgumentError, set_debug
from acl_gym.utils.validation import did_you_mean

if TYPE_CHECKING:
    from rich.console import Console

DebugOption = Annotated[
    bool,
    typer.Option(
        "--debug",
        callback=set_debug,
        is_eager=True,
        help="Show the full traceback of an error.",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the results as JSON and nothing else.")
]


def print_json(value: Any) -> None:
    """Print JSON, with numbers in full precision."""
    typer.echo(json.dumps(value, indent=1))


def console(stderr: bool = False) -> Console:
    """The console for tables; a file or a pipe gets 100 columns, or `COLUMNS`."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    known = stream.isatty() or os.environ.get("COLUMNS", "").isdecimal()
    return Console(file=stream, width=None if known else 100)


def check_name(option: str, name: str, known: Iterable[str]) -> str:
    """Return a name if it is known.

    Raises:
        BadArgumentError: it is not; the message lists the names, the most similar one
            at the end.
    """
    names = list(known)
    if name in names:
        return name
    choices = ", ".join(map(repr, names))
    raise BadArgumentError(
        f"{option} must be one of {choices}, got {name!r}.{did_you_mean(name, names)}"
    )
