"""Values of runs as points, and estimates with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike

from acl_gym.plotting import style


class Interval(NamedTuple):
    """An estimate and its interval; None is infinite, or not there.

    Attributes:
        value: the estimate.
        low: where the interval begins.
        high: where it ends; None beside a `low`: nowhere.
        note: what is written at the margin.
    """

    value: float | None
    low: float | None
    high: float | None
    note: str = ""

    @classmethod
    def of(cls, found: Mapping[str, Any], runs: int) -> Interval:
        """An entry with `median`, `low`, `high`, and how many runs `reached` it."""
        reached = found.get("reached", runs)
        note = f"{reached} of {runs}" if reached else "never"
        ends = found["low"], found["high"]
        return cls(found["median"], *ends, note if reached < runs else "")


def draw_points(
    ax: Axes, x: ArrayLike, y: ArrayLike, color: str, marker: str, **options: Any
) -> None:
    """Draw values of runs, faintly; `options` are of the line."""
    options = {"markersize": 2.5, "alpha": 0.45, **options}
    ax.plot(x, y, linestyle="", color=color, marker=marker, **options)


def draw_intervals(
    ax: Axes,
    x: ArrayLike,
    estimates: Sequence[tuple[float, float, float]],
    marker: str,
    **line: Any,
) -> None:
    """Draw estimates, each with its interval.

    Args:
        ax: where.
        x: a place for each.
        estimates: value, low and high; NaN where there is no interval.
        marker: of the values.
        line: what connects them, nothing by default; and their color.
    """
    value, low, high = np.array(estimates).T
    # Where all runs are equal, an end may lie a rounding error beyond the value.
    ends = np.maximum(np.nan_to_num([value - low, high - value]), 0.0)
    line = {"linestyle": "", "linewidth": 1.2, **line}
    ax.errorbar(x, value, ends, marker=marker, **line)


def draw_pairs(
    ax: Axes,
    rows: Sequence[Sequence[Interval]],
    colors: Sequence[str],
    names: Sequence[str],
) -> None:
    """Draw two estimates in each row, over a logarithmic axis, with a legend on top.

    Args:
        ax: where; row i is drawn at y = i.
        rows: the two, the first with a hollow marker.
        colors: of the rows.
        names: of the two.
    """
    ax.set_xscale("log")
    ax.xaxis.set_minor_formatter(NullFormatter())
    shown = [
        (row + shift, each, color, shift < 0)
        for row, (pair, color) in enumerate(zip(rows, colors, strict=True))
        for each, shift in zip(pair, (-0.16, 0.16), strict=True)
    ]
    for y, each, color, hollow in shown:
        if each.low is not None and each.high is not None:
            ax.plot([each.low, each.high], [y, y], color=color)
        if each.value is not None:
            ax.plot(each.value, y, **_marker(color, hollow=hollow))
        if each.note:
            place: Any = {"transform": ax.get_yaxis_transform(), "va": "center"}
            ax.text(1.02, y, each.note, fontsize="small", color="0.3", **place)
    start, end = ax.get_xlim()
    if end < 10 * start:  # there may be no power of ten to be labelled
        style.plain_log(ax.xaxis)
    for y, each, color, _ in shown:
        if each.low is not None and each.high is None:
            ax.plot([each.low, end], [y, y], color=color)
            ax.plot(end, y, color=color, marker=">", clip_on=False)
    ax.set_xlim(right=end)
    handles = [
        Line2D([], [], **_marker("0.3", hollow=hollow), label=name)
        for hollow, name in zip((True, False), names, strict=True)
    ]
    style.legend(
        *(ax, handles), ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.02),
        borderpad=0.0, borderaxespad=0.3, handlelength=1.0, handletextpad=0.4,
    )  # fmt: skip


def _marker(color: str, *, hollow: bool) -> dict[str, Any]:
    look = {"marker": "o", "linestyle": "", "markersize": 5, "markeredgewidth": 1.2}
    return {"color": color, "markerfacecolor": "white" if hollow else color, **look}
