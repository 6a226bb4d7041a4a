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
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

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
    """How a method is drawn, in every figure alike; `short` is its name on an axis."""

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
    "planning": Look("0.55"),
}
"""By the name that an experiment gives to a method, or as `look` composes it."""

BOUND: dict[str, Any] = {"color": "0.2", "linewidth": 0.9, "zorder": 1.2}
"""Of a line that is a limit: the optimal cost, the goal."""


def look(study: Study) -> Look:
    """How a study is drawn beside others."""
    name = "q" if study.method == "q-learning" else study.method
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
    """

    label: str
    title: str
    study: Study
    policy: Predictor
    success_rate: float = 0.0


class Reference(NamedTuple):
    """What policies are held against: a study, its cost, and a symbol for that."""

    study: Study
    cost: float
    symbol: str


def reference(experiment: Experiment, results: Results) -> Reference:
    """The first reference, which is the optimum if it is called J* or an option says so."""
    label, study = next(iter(experiment.references.items()))
    optimum = experiment.options.get("optimum", label == "J*")
    cost = reference_cost(experiment, results)
    return Reference(study, cost, "J*" if optimum else "best known")


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, in inches, with a canvas; without pyplot, which keeps state."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def small_multiples(
    count: int, columns: int, height: float, width: float = WIDTH, **options: Any
) -> tuple[Figure, list[Axes]]:
    """So many panels, row by row; `height` is that of one, `options` are of `subplots`."""
    rows = math.ceil(count / columns)
    figure = new_figure(0.75 + height * rows, width)
    axes = figure.subplots(rows, columns, squeeze=False, **options).ravel()
    for ax in axes[count:]:
        ax.remove()
    return figure, list(axes[:count])


def label_outer(axes: Sequence[Axes], columns: int, x: str, y: str = "") -> None:
    """Name the axes of the lowest panel of each column, and of the first column."""
    for ax in axes[-columns:]:
        ax.set_xlabel(x)
        ax.tick_params(labelbottom=True)
    for ax in axes[::columns]:
        ax.set_ylabel(y)


def draw_band(
    ax: Axes,
    x: FloatArray,
    values: FloatArray,
    line: dict[str, Any],
    *,
    centre: Callable[..., Any] = np.median,
    step: bool = False,
    spans: Sequence[tuple[float, float]] = ((0.0, 1.0),),
    alpha: float = 0.15,
) -> None:
    """A line for the centre of some runs, and a band from the lowest to the highest.

    Args:
        ax: where.
        x: increasing, `(n,)`.
        values: of each run, `(runs, n)`.
        line: how the line is drawn; bands have its colour.
        centre: of values along an axis.
        step: whether each value holds until the next one.
        spans: from which to which quantile there are bands.
        alpha: opacity of a band, 0..1.
    """
    for span in spans:
        low, high = np.quantile(values, span, axis=0)
        style = {"color": line["color"], "alpha": alpha, "linewidth": 0}
        ax.fill_between(x, low, high, step="post" if step else None, **style)
    style = {"drawstyle": "steps-post" if step else "default", **line}
    ax.plot(x, centre(values, axis=0), **style)


def legend(parent: Axes | Figure, handles: Iterable[Any], **options: Any) -> None:
    """A legend; of a figure below it."""
    if isinstance(parent, Figure):
        options = {"loc": "outside lower center", "ncols": 4, **options}
    parent.legend(handles=list(handles), **options)


def cost_line(ax: Axes, known: Reference, *, vertical: bool = False) -> None:
    """A line at the cost of a reference, with its name."""
    (ax.axvline if vertical else ax.axhline)(known.cost, **BOUND)
    transform = ax.get_xaxis_transform() if vertical else ax.get_yaxis_transform()
    place = (known.cost, 1.0) if vertical else (0.01, known.cost / 1.005)
    text = f" {known.symbol} = {digits(known.cost)}"
    ax.text(*place, text, transform=transform, fontsize="small", va="top")


def plain_log(axis: Axis) -> None:
    """Plain numbers on a logarithmic axis that spans little: 40, 50, 60, 80, 100.

    Where it spans more there are fewer of them, and evenly spread ones where it spans
    next to nothing. The limits are set before.
    """
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high > 4 * low else (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    narrow = high < 1.5 * low
    axis.set_major_locator(MaxNLocator(4) if narrow else LogLocator(subs=subs))
    plain_numbers(axis)


def plain_numbers(axis: Axis) -> None:
    """Numbers without powers: 0.1, 1, 10."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def as_pi(value: float) -> str:
    """A multiple of pi / 2 as a fraction."""
    halves = round(2 * value / math.pi)
    if halves == 0:
        return "0"
    number, tail = (abs(halves), "/2") if halves % 2 else (abs(halves) // 2, "")
    sign = _MINUS if halves < 0 else ""
    return f"{sign}{number if number > 1 else ''}\N{GREEK SMALL LETTER PI}{tail}"


def signed(torque: float) -> str:
    """A torque with its sign and unit."""
    return f"{torque:+g} N m".replace("-", _MINUS) if torque else "0 N m"


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
