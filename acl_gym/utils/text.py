"""Numbers as text, and text on terminals that cannot show every letter."""

from __future__ import annotations

import sys


def count(number: float) -> str:
    """A count in short form: 950, 2.6k, 13M."""
    for size, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if number >= size:
            places = 0 if number >= 10 * size else 1
            return f"{number / size:.{places}f}{unit}"
    return f"{number:g}"


def short(text: str, length: int = 44) -> str:
    """A text on one line, cut where it is longer."""
    line = " ".join(text.split())
    return line if len(line) <= length else f"{line[: length - 3]}..."


def signed(value: float) -> str:
    """A number to three digits with its sign: +0.8, 0, and a proper minus sign."""
    text = f"{'+' if value > 0 else ''}{digits(value)}"
    return text.replace("-", "\N{MINUS SIGN}")


def digits(value: float) -> str:
    """A number to three digits, without powers of ten: 2590, 44.7."""
    return f"{float(f'{value:.3g}'):g}"


def replace_unprintable_letters() -> None:
    """Let stdout and stderr replace letters that their encoding lacks, not fail.

    For programs whose output may go to a terminal, a pipe or a file in ASCII or cp1252:
    a letter may be lost, but never the results behind it.
    """
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")


def first_line(error: Exception) -> str:
    """The first line of what an error of another library says, without a full stop."""
    return (str(error) or type(error).__name__).splitlines()[0].rstrip(".")


def percent(share: float) -> str:
    """A share in percent, rounded so that only all is 100% and only none is 0%."""
    text = f"{100.0 * share:.1f}"
    if share < 1.0 and text == "100.0":
        text = "99.9"
    if share > 0.0 and text == "0.0":
        text = "0.1"
    return f"{text.removesuffix('.0')}%"
