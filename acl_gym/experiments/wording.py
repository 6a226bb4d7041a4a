"""Numbers and names in words, the same in sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def steps(value: float | None, *, short: bool = False) -> str:
    """Environment steps to three figures: 1.91 million or 487,000; 1.91M or 487k."""
    if value is None:
        return "never"
    rounded = float(f"{value:.3g}")
    if rounded >= 1e6:
        return f"{rounded / 1e6:.3g}{'M' if short else ' million'}"
    if short and rounded >= 1e3:
        return f"{rounded / 1e3:.3g}k"
    return f"{rounded:,.0f}"


def seconds(value: float | None, *, unit: str = "") -> str:
    """Seconds to two figures or more: 0.33, 4.8, 12, 140."""
    if value is None:
        return "never"
    return (f"{value:.0f}" if value >= 9.95 else f"{value:#.2g}") + unit


def cost(value: float | None) -> str:
    """A policy cost to three figures or more: 9.99, 45.2, 1204.0."""
    if value is None:
        return "infinity"
    return f"{value:.2f}" if abs(value) < 19.995 else f"{value:.1f}"


def reference_cost(reference: Mapping[str, Any]) -> float:
    """What policies are held against: the optimal cost, or the best that is known."""
    cost = reference.get("optimal_cost", reference.get("best_known_cost"))
    if cost is None:
        raise ValueError("a reference must have an optimal_cost or a best_known_cost.")
    return float(cost)


def symbol(reference: Mapping[str, Any]) -> str:
    """Its name in tables and figures."""
    return "J*" if "optimal_cost" in reference else "best known"


def the_reference(reference: Mapping[str, Any]) -> str:
    """Its name in a sentence."""
    return "J*" if "optimal_cost" in reference else "the best known cost"


def share(value: float) -> str:
    """A share of 1 in percent to three figures: 100% is all, 99.6% is not."""
    return f"{100 * value:.3g}%"


def ratio(value: float) -> str:
    """How many times: 1.61 times, 1,240 times."""
    return f"{value:.3g} times" if value < 999.5 else f"{value:,.0f} times"


def percent_above(value: float) -> str:
    """Percent above, or of a negative value below; of none, equal to."""
    if abs(value) < 1e-9:
        return "equal to"
    return f"{abs(value):.1f}% {'above' if value >= 0 else 'below'}"


def in_a_sentence(label: str) -> str:
    """A label as a noun without commas: "ACL, fuzzy" becomes "fuzzy ACL"."""
    return " ".join(reversed(label.split(", ")))


def listed(words: Sequence[str]) -> str:
    """Words with commas and an `and`."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"


def sentence(text: str) -> str:
    """Text with a capital at its beginning and a full stop at its end."""
    return f"{text[:1].upper()}{text[1:]}."
