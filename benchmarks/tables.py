"""What the scripts beside this one share: options of the command line, and tables."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def parser_of(text: str | None) -> argparse.ArgumentParser:
    """A parser that shows the docstring of a script as it is."""
    return argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def add_seeds(parser: argparse.ArgumentParser, default: int = 5) -> None:
    """The option `--seeds`."""
    parser.add_argument(
        "--seeds",
        type=at_least_one,
        default=default,
        help="runs of each, with successive seeds (default: %(default)s)",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """The option `--json`."""
    parser.add_argument("--json", action="store_true", help="print JSON, nothing else")


def add_results(parser: argparse.ArgumentParser, figure: str) -> None:
    """Options of what is made of the rows: `--from-json`, `--figure` and `--json`.

    Args:
        parser: gets them.
        figure: what `--figure` draws.
    """
    parser.add_argument(
        "--from-json",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="show what --json has printed, of several parts together",
    )
    parser.add_argument("--figure", type=Path, metavar="PNG", help=f"draw {figure}")
    add_json(parser)


def rows_of(paths: Iterable[Path], name: str = "rows") -> list[Row]:
    """What `--json` has printed to some files, one after the other."""
    return [row for path in paths for row in json.loads(path.read_text())[name]]


def at_least_one(text: str) -> int:
    """The type of an option that is a whole number >= 1."""
    if not (text.isdecimal() and int(text) >= 1):
        raise argparse.ArgumentTypeError(f"must be an integer >= 1, got {text!r}")
    return int(text)


def seed(text: str) -> int:
    """The type of an option that is a seed, a whole number >= 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be an integer >= 0, got {text!r}")
    return int(text)


def some_of(allowed: Iterable[Any], separator: str = ",") -> Callable[[str], list[Any]]:
    """The type of an option that is some of what is allowed, with separators."""
    known = {str(each): each for each in allowed}

    def chosen(text: str) -> list[Any]:
        names = [name.strip() for name in text.split(separator)]
        for name in names:
            if name not in known:
                raise argparse.ArgumentTypeError(
                    f"{name!r} is not one of {f'{separator} '.join(known)}"
                )
        return [known[name] for name in names]

    return chosen


def markdown(
    heads: Sequence[str], rows: Iterable[Sequence[str]], names: Collection[int] = (0,)
) -> str:
    """A table of names, and of numbers, which end at the right of their columns.

    Args:
        heads: of the columns.
        rows: of texts.
        names: which columns hold names.
    """
    ruler = ["---" if i in names else "---:" for i in range(len(heads))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, ruler, *rows))


def number(value: float | None, form: str) -> str:
    """A number in some form, "-" where there is none."""
    return "-" if value is None else format(value, form)
