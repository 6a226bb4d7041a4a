"""What figures share: styles of agents, axes, legends, ticks.

Figures are made without pyplot, so that nothing global is left behind. Colours are
those of Okabe and Ito, and one of Tol's, which people who are colour-blind tell apart: a
warm hue is a colony, a blue one Q-learning, a purple one Q(lambda). A crisp partition
has a dashed line in the lighter shade.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import (
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    MultipleLocator,
    NullFormatter,
)

from acl_gym.experiments import wording

WIDTH = 7.2  # inches, the text width of a page
SMALL, TINY = 7.5, 6.5  # points

MINUS = "\N{MINUS SIGN}"


class Style(NamedTuple):
    """How an agent is drawn, in every figure alike."""

    color: str
    dashes: Any = "-"


STYLES = {
    "acl-fuzzy": Style("#D55E00"),
    "acl-crisp": Style("#E69F00", (0, (4, 1.2))),
    "q-fuzzy": Style("#0072B2"),
    "q-crisp": Style("#56B4E9", (0, (4, 1.2))),
    "q-lambda-fuzzy": Style("#882255"),
    "q-lambda-crisp": Style("#CC79A7", (0, (4, 1.2))),
    "dqn": Style("#009E73", (0, (6, 1, 1, 1))),
}
OTHER = Style("#666666", (0, (1, 1)))
"""Of an agent that is not in STYLES."""

BOUND: dict[str, Any] = {"color": "0.2", "linewidth": 0.9, "zorder": 1.2}
"""Of a line that is a limit: the optimal cost, the goal."""


def style(agent: str) -> Style:
    """The style of an agent."""
    return STYLES.get(agent, OTHER)


def line(agent: str) -> dict[str, Any]:
    """The style of an agent as keyword arguments of a line."""
    color, dashes = style(agent)
    return {"color": color, "linestyle": dashes, "linewidth": 1.3, "zorder": 2}


def marker(color: str, *, hollow: bool) -> dict[str, Any]:
    """Keyword arguments of a line that is markers only."""
    return {
        "color": color,
        "marker": "o",
        "linestyle": "",
        "markersize": 5,
        "markerfacecolor": "white" if hollow else color,
        "markeredgewidth": 1.2,
    }


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty white figure, in inches, with a canvas to draw it on."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def prepare(ax: Axes) -> None:
    """Small ticks, a light grid behind the data, no frame."""
    ax.tick_params(labelsize=TINY)
    ax.grid(visible=True, color="0.9", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def legend(parent: Axes | Figure, handles: list[Any], **kwargs: Any) -> None:
    """A legend of one size everywhere."""
    parent.legend(
        handles=handles,
        frameon=False,
        fontsize=TINY,
        columnspacing=1.4,
        **{"handlelength": 2.6, **kwargs},
    )


def optimal_cost_line(
    ax: Axes, optimal_cost: float, symbol: str = "J*", *, vertical: bool = False
) -> None:
    """J*, or what stands for it, with its name."""
    if vertical:
        ax.axvline(optimal_cost, **BOUND)
        place: dict[str, Any] = {
            "xy": (optimal_cost, 1.0),
            "xycoords": ("data", "axes fraction"),
            "xytext": (2.5, 0),
        }
    else:
        ax.axhline(optimal_cost, **BOUND)
        place = {
            "xy": (0.01, optimal_cost),
            "xycoords": ("axes fraction", "data"),
            "xytext": (0, -2),
        }
    ax.annotate(
        f"{symbol} = {wording.cost(optimal_cost)}",
        textcoords="offset points",
        fontsize=TINY,
        va="top",
        **place,
    )


def plain_log(axis: Axis, *, sparse: bool = False) -> None:
    """Ticks of a logarithmic axis that spans little: 40, 50, 60, 80, 100, ...

    Args:
        axis: its limits are set.
        sparse: for a short axis, with fewer of them where it spans more, and evenly
            spread ones where it spans next to nothing.
    """
    low, high = axis.get_view_interval()
    subs: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
    if sparse and high > 4 * low:
        subs = (1.0, 2.0, 5.0)
    if sparse and high < 1.5 * low:
        axis.set_major_locator(MaxNLocator(4))
    else:
        axis.set_major_locator(LogLocator(subs=subs))
    axis.set_minor_formatter(NullFormatter())
    plain_numbers(axis)


def plain_numbers(axis: Axis) -> None:
    """Numbers without powers: 0.1, 1, 10."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def multiples_of_pi(axis: Axis) -> None:
    """Ticks at multiples of pi / 2."""
    axis.set_major_locator(MultipleLocator(math.pi / 2))
    axis.set_major_formatter(FuncFormatter(lambda value, _: as_pi(value)))


def as_pi(value: float) -> str:
    """A multiple of pi / 2 as a fraction."""
    halves = round(2 * value / math.pi)
    if halves == 0:
        return "0"
    number, tail = (abs(halves), "/2") if halves % 2 else (abs(halves) // 2, "")
    sign = MINUS if halves < 0 else ""
    return f"{sign}{number if number > 1 else ''}\N{GREEK SMALL LETTER PI}{tail}"


def torque(value: float) -> str:
    """A torque with its sign and unit."""
    sign = MINUS if value < 0 else "+" if value > 0 else ""
    return f"{sign}{abs(value):g} N m"
