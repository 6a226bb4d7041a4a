"""Numbers as text, and text on terminals that cannot show every letter."""

from __future__ import annotations

import sys


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
