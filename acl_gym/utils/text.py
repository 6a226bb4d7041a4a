"""Numbers as text."""

from __future__ import annotations


def digits(value: float) -> str:
    """A number to three digits, without powers of ten: 2590, 44.7."""
    return f"{float(f'{value:.3g}'):g}"
