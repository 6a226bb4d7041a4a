"""What figures share: how methods look, small multiples, bands, axes, legends.

Colours are those of Okabe and Ito, and one of Tol's, which people who are colour-blind
can tell apart: a warm hue is a colony, a blue one Q-learning, a purple one Q(lambda). A
crisp partition has a dashed line in the lighter shade.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
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

from acl_gym.evaluation import Predictor
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import digits
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.tables import reference_cost
from acl_gym.utils.typing import FloatArray

WIDTH = 7.2
"""Inches, the text width of a page."""

BLACK, BLUE, ORANGE, GREEN = "black", "#0072B2", "#D55E00", "#009E73"
_DASHES = (0, (4, 1.2))
_MINUS = "\N{MINUS SIGN}"


class Look(NamedTuple):
    """How a method is drawn, in every figure alike.

    Attributes:
        color: of lines and markers.
        dashes: of lines.
        marker: of points.
        short: its name where there is little room.
    """

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
    "q": Look(BLUE, "-", "s", "Q"),
    "q-crisp": Look("#56B4E9", _DASHES, "s", "Q"),
    "q-lambda": Look("#882255", "-", "^", "Q(λ)"),
    "q-lambda-crisp": Look("#CC79A7", _DASHES, "^", "Q(λ)"),
    "dqn": Look(GREEN, (0, (6, 1, 1, 1)), "D", "DQN"),
}
"""By what `kind_of` says, or by the name that an experiment gives to a method."""

REFERENCE = Look("0.55")
"""Of a policy that dynamic programming has found."""

BOUND: dict[str, Any] = {"color": "0.2", "linewidth": 0.9, "zorder": 1.2}
"""Of a line that is a limit: the optimal cost, the goal."""


def look(study: Study) -> Look:
    """How a study is drawn beside others."""
    name = {"q-learning": "q"}.get(study.method, study.method)
    if study.settings.get("trace_decay", 0) > 0:
        name = "q-lambda"
    return LOOKS.get(f"{name}-{study.kind}", LOOKS[name])


@dataclass(frozen=True)
class Shown:
    """A policy that is drawn.

    Attributes:
        label: its study, and the seed of its run.
        title: the same with its cost, in two lines.
        study: says on which system.
        policy: for the system without perturbations.
        success_rate: of its evaluation.
        look: of its lines.
    """

    label: str
    title: str
    study: Study
    policy: Predictor
    success_rate: float
    look: Look


class Reference(NamedTuple):
    """What policies are held against.

    Attributes:
        label: of its study.
        study: found by dynamic programming.
        cost: of its policy.
        symbol: J*, or what stands for it.
    """

    label: str
    study: Study
    cost: float
    symbol: str


def reference(experiment: Experiment, results: Results) -> Reference:
    """The first reference, which is the optimum if its label is J*, or an option says so."""
    label, study = next(iter(experiment.references.items()))
    optimum = experiment.options.get("optimum", label == "J*")
    symbol = "J*" if optimum else "best known"
    return Reference(label, study, reference_cost(experiment, results), symbol)


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, in inches, with a canvas; without pyplot, which keeps state."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def small_multiples(
    count: int, columns: int, height: float, width: float = WIDTH, **options: Any
) -> tuple[Figure, list[Axes]]:
    """So many panels, row by row.

    Args:
        count: how many, >= 1.
        columns: how many there are side by side at most.
        height: of one, inches.
        width: of the figure with all columns, inches; with fewer it is narrower.
        options: of `Figure.subplots`.
    """
    shown = min(columns, count)
    rows = math.ceil(count / shown)
    figure = new_figure(0.75 + height * rows, 0.5 + (width - 0.5) * shown / columns)
    axes = figure.subplots(rows, shown, squeeze=False, **options).ravel()
    for place, ax in enumerate(axes):
        if place >= count:
            ax.remove()
        elif place >= count - shown:  # the lowest of its column
            ax.tick_params(labelbottom=True)
    return figure, list(axes[:count])


def label_outer(axes: Sequence[Axes], columns: int, x: str, y: str = "") -> None:
    """Name the axes of the lowest panels of each column, and of the first column."""
    for place, ax in enumerate(axes):
        if place >= len(axes) - columns:
            ax.set_xlabel(x)
        if place % columns == 0:
            ax.set_ylabel(y)


def draw_band(
    ax: Axes,
    x: FloatArray,
    values: FloatArray,
    line: dict[str, Any],
    *,
    centre: Callable[..., Any] = np.median,
    step: bool = False,
    halves: bool = False,
    alpha: float = 0.15,
) -> None:
    """A line for the centre of some runs, and a band from the lowest to the highest.

    Args:
        ax: where.
        x: increasing, `(n,)`.
        values: of each run, `(runs, n)`.
        line: how the line is drawn; its colour is that of the band.
        centre: of values along an axis.
        step: whether values hold until the next one.
        halves: whether the middle half of the runs has a band as well.
        alpha: how dark bands are.
    """
    spans = [(0.0, 1.0), (0.25, 0.75)] if halves else [(0.0, 1.0)]
    for span in spans:
        low, high = np.quantile(values, span, axis=0)
        area = {"color": line["color"], "alpha": alpha, "linewidth": 0}
        ax.fill_between(x, low, high, step="post" if step else None, **area)
    style = "steps-post" if step else "default"
    ax.plot(x, centre(values, axis=0), drawstyle=style, **line)


def legend(parent: Axes | Figure, handles: Iterable[Any], **options: Any) -> None:
    """A legend; of a figure below it."""
    if isinstance(parent, Figure):
        options = {"loc": "outside lower center", "ncols": 4, **options}
    parent.legend(handles=list(handles), **options)


def cost_line(ax: Axes, known: Reference, *, vertical: bool = False) -> None:
    """A line at the cost of a reference, with its name."""
    draw = ax.axvline if vertical else ax.axhline
    draw(known.cost, **BOUND)
    place: Any = (known.cost, 1.0) if vertical else (0.01, known.cost)
    ax.annotate(
        f"{known.symbol} = {digits(known.cost)}",
        place,
        xycoords=("data", "axes fraction") if vertical else ("axes fraction", "data"),
        xytext=(2.5, 0) if vertical else (0, -2),
        textcoords="offset points",
        fontsize="small",
        va="top",
    )


def plain_log(axis: Axis) -> None:
    """Plain numbers on a logarithmic axis that spans little: 40, 50, 60, 80, 100.

    Where it spans more there are fewer of them, and evenly spread ones where it spans
    next to nothing. The limits are set before.
    """
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high > 4 * low else (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    narrow = high < 1.5 * low
    axis.set_major_locator(MaxNLocator(4) if narrow else LogLocator(subs=subs))
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
    sign = _MINUS if halves < 0 else ""
    return f"{sign}{number if number > 1 else ''}\N{GREEK SMALL LETTER PI}{tail}"


def torque(value: float) -> str:
    """A torque with its sign and unit."""
    return f"{_MINUS if value < 0 else '+' if value > 0 else ''}{abs(value):g} N m"


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
