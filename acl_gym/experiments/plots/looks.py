"""The line styles of methods, shared by all figures; references and symbols.

A red or orange hue is a colony, a blue one Q-learning, a purple one Q(lambda), a green one a
network. A crisp partition has a dashed line in the lighter shade.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from matplotlib.axes import Axes

from acl_gym.experiments.references import Reference
from acl_gym.experiments.study import Study
from acl_gym.plotting.style import BLUE, BOUND, GREEN, ORANGE
from acl_gym.utils.text import digits

_DASHES = (0, (4, 1.2))
_DOTS = (0, (1, 1))


class Look(NamedTuple):
    """How a method is drawn; `short` is its name on an axis."""

    color: str
    dashes: Any = "-"
    marker: str = "o"
    short: str = ""

    @property
    def line(self) -> dict[str, Any]:
        """Keyword arguments of a line."""
        return {"color": self.color, "linestyle": self.dashes}


LOOKS = {
    "acl": Look(ORANGE, "-", "o", "ACL"),
    "acl-crisp": Look("#E69F00", _DASHES, "o", "ACL"),
    "acl-long": Look("#E69F00", _DASHES, "P", "4 ACL"),
    "returning": Look("#AA0A0A", "-", "*", "R-ACL"),
    "returning-fuzzy": Look("#D8433B", _DOTS, "*", "R-ACL"),
    "returning-crisp": Look("#F0908A", _DASHES, "*", "R-ACL"),
    "q": Look(BLUE, "-", "s", "Q"),
    "q-crisp": Look("#56B4E9", _DASHES, "s", "Q"),
    "q-lambda": Look("#882255", "-", "^", "Q(λ)"),
    "q-lambda-crisp": Look("#CC79A7", _DASHES, "^", "Q(λ)"),
    "q-replay": Look("#1B2A6B", _DOTS, "v", "Q rep."),
    "dqn": Look(GREEN, (0, (6, 1, 1, 1)), "D", "DQN"),
    "ppo": Look("#7A9A01", (0, (6, 1, 1, 1)), "X", "PPO"),
    "a2c": Look("#35C9A5", (0, (6, 1, 1, 1)), "p", "A2C"),
    "planning": Look("0.55"),
}
"""By the name that an experiment gives to a method, or as `look_of` composes it."""


def look_of(study: Study) -> Look:
    """How a study is drawn beside others."""
    name = "q" if study.method == "q-learning" else study.method
    if study.settings.get("replay", 0) > 0:
        name = "q-replay"
    elif study.settings.get("trace_decay", 0) > 0:
        name = "q-lambda"
    return LOOKS.get(f"{name}-{study.kind}", LOOKS[name])


def cost_line(ax: Axes, known: Reference, *, vertical: bool = False) -> None:
    """A line at the cost of a reference, with its name."""
    (ax.axvline if vertical else ax.axhline)(known.cost, **BOUND)
    transform = ax.get_xaxis_transform() if vertical else ax.get_yaxis_transform()
    place = (known.cost, 1.0) if vertical else (0.01, known.cost / 1.005)
    text = f" {known.symbol} = {digits(known.cost)}"
    ax.text(*place, text, transform=transform, fontsize="small", va="top")


_SYMBOLS = {
    r"\b(alpha|gamma|epsilon|rho)\b": r"$\\\1$",
    r"\btau0\b": r"$\\tau_0$",
    r"\bomega_max\b": r"$\\omega_{\\max}$",
}


def in_symbols(label: str) -> str:
    """A label with its parameters as the thesis writes them."""
    for name, symbol in _SYMBOLS.items():
        label = re.sub(name, symbol, label)
    return label
