"""What all figures share: the style, small multiples, bands, axes, legends.

Colours are those of Okabe and Ito, which people who are colour-blind can tell apart.
Nothing here uses pyplot, which keeps state.
"""

from __future__ import annotations

import contextlib
import functools
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.resources import as_file, files
from typing import Any

import matplotlib as mpl
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

from acl_gym.utils import validation
from acl_gym.utils.pictures import inline_png
from acl_gym.utils.typing import FloatArray


def _style() -> Any:
    with as_file(files("acl_gym.plotting") / "acl_gym.mplstyle") as path:
        return mpl.rc_params_from_file(path, use_default_template=False)


in_style = functools.partial(mpl.rc_context, _style())
"""Makes a context in which figures have this style; it decorates functions as well."""

WIDTH = 7.2
"""Inches, the text width of a page."""

BLACK, BLUE, ORANGE, GREEN = "black", "#0072B2", "#D55E00", "#009E73"

BOUND: dict[str, Any] = {"color": "0.2", "linewidth": 0.9, "zorder": 1.2}
"""Of a line that is a limit: the optimal cost, the goal."""

SCREEN_DPI = 150
"""Dots an inch of a new figure."""

_MINUS = "\N{MINUS SIGN}"


def new_figure(height: float, width: float = WIDTH, dpi: float | None = None) -> Figure:
    """An empty figure, in inches, with a canvas."""
    figure = Figure(figsize=(width, height), dpi=dpi)
    FigureCanvasAgg(figure)
    return figure


class ShownAxes(Axes):
    """Axes that a notebook shows as the picture they are in, without pyplot."""

    def _repr_html_(self) -> str:
        buffer = io.BytesIO()
        figure: Any = self.figure
        figure.savefig(buffer, format="png")
        return inline_png(buffer.getvalue(), self.get_title(loc="left"))


@contextlib.contextmanager
def axes_or_new(ax: Any, width: float = 4.6, height: float = 3.5) -> Iterator[Axes]:
    """Axes to draw on: those given as they are, or new ones in our style.

    Args:
        ax: of the caller, or None.
        width: of a new figure, inches.
        height: of a new figure, inches.

    Raises:
        TypeError: `ax` are not axes.
    """
    if ax is not None:
        yield checked_axes(ax)
        return
    with in_style():
        figure = new_figure(height, width, SCREEN_DPI)
        yield figure.subplots(subplot_kw={"axes_class": ShownAxes})
        keep_style(figure)


def checked_axes(ax: Any) -> Axes:
    """Return `ax` if they are axes.

    Raises:
        TypeError: `ax` is something else.
    """
    if not isinstance(ax, Axes):
        raise TypeError(
            "ax must be Matplotlib axes or None, got "
            f"{validation.shown(ax)}; make some with "
            "figure, ax = plt.subplots()."
        )
    return ax


def keep_style(figure: Figure) -> None:
    """Make a tick of each axis now, in our style; others are copies of it."""
    for ax in figure.findobj(Axes):  # bars are inside others
        for axis, size in (
            (ax.xaxis, mpl.rcParams["xtick.labelsize"]),
            (ax.yaxis, mpl.rcParams["ytick.labelsize"]),
        ):
            axis.set_tick_params(which="both", labelsize=size)
            axis.get_major_ticks(1)
            axis.get_minor_ticks(1)


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


def multiples_of_pi(axis: Axis) -> None:
    """Ticks at multiples of pi / 2."""
    axis.set_major_locator(MultipleLocator(math.pi / 2))
    axis.set_major_formatter(FuncFormatter(lambda value, _: as_pi(value)))


GREEK = [
    "alpha",
    "beta",
    "gamma",
    "delta",
    "theta",
    "lambda",
    "mu",
    "omega",
    "phi",
    "psi",
    "rho",
    "sigma",
    "tau",
    "xi",
]


def symbol(name: str) -> str:
    """The name of a variable as it is printed: "omega (rad/s)" with a Greek letter."""
    word, bracket, unit = name.partition(" (")
    return " ".join(map(_printed, word.split(" "))) + bracket + unit


def _printed(word: str) -> str:
    if word in GREEK:
        return rf"$\{word}$"
    if re.fullmatch(r"[a-z]\d?", word):
        return f"${'_'.join(word)}$"
    return word.replace("$", r"\$")


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
