"""Learning curves: the cost of policies over interactions, or over time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter

from acl_gym.plotting import style
from acl_gym.utils import validation
from acl_gym.utils.pictures import COLOURS
from acl_gym.utils.steps import hold_last_value
from acl_gym.utils.typing import FloatArray

if TYPE_CHECKING:
    import pandas as pd

AXES = {"env_steps": "interactions", "seconds": "seconds of learning"}
"""What curves may be drawn over: a column of the logs, and its name."""


def draw_learning_curves(
    ax: Axes,
    logs: Mapping[str, Sequence[pd.DataFrame]],
    lines: Sequence[dict[str, Any]],
    x: str = "env_steps",
    *,
    best_so_far: bool = False,
    spans: Sequence[tuple[float, float]] = ((0.0, 1.0),),
    yscale: str = "log",
) -> None:
    """Draw the median policy cost of the runs of some methods, with bands.

    The first call on a figure adds a legend below it.

    Args:
        ax: where.
        logs: by the name of a method the log of each run, with a row for each
            evaluation: `env_steps`, `seconds`, `policy_cost`.
        lines: keyword arguments of the line of each method, with its color.
        x: a key of `AXES`.
        best_so_far: whether the best policy counts instead of the last one.
        spans: see `style.draw_band`.
        yscale: "linear" where values may be 0 or less, as returns may.
    """
    for rows, line in zip(logs.values(), lines, strict=True):
        at, values = steps_of(rows, x, best_so_far=best_so_far)
        style.draw_band(ax, at, values, line, step=True, spans=spans)
    ax.set(xscale="log", yscale=yscale, xlabel=AXES[x])
    if x == "seconds":
        style.plain_numbers(ax.xaxis)
    figure: Any = ax.figure
    if not figure.legends:
        handles = [
            Line2D([], [], **line, label=label)
            for label, line in zip(logs, lines, strict=True)
        ]
        columns = len(handles)
        if columns > 5:  # no wider than the figure
            columns = min(4, math.ceil(columns / 2))
        style.legend(figure, handles, ncols=columns)


def steps_of(
    rows: Sequence[pd.DataFrame],
    x: str,
    y: str = "policy_cost",
    *,
    best_so_far: bool = False,
    rising: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Where a policy cost of some run changes, `(n,)`, and all of them, `(runs, n)`.

    Or values of another column `y`, of which the best are the highest if `rising`.

    A policy counts from its evaluation to the next one, the last one to the end. The
    curves begin where each run has a policy.
    """
    if best_so_far:
        best = "cummax" if rising else "cummin"
        rows = [each.assign(**{y: getattr(each[y], best)()}) for each in rows]
    at = np.unique(np.concatenate([each[x] for each in rows]))
    at = at[(at >= max(each[x].iloc[0] for each in rows)) & (at > 0)]  # for a log axis
    return at, np.stack([hold_last_value(each[x], each[y], at) for each in rows])


X_AXES = {**AXES, "trial": "trials"}
"""What `plot_learning_curve` draws over: a column of the history, and its name."""

Y_AXES = {
    "policy_return": "return of the policy",
    "policy_cost": "cost of the policy",
    "ants_return": "mean return of the ants",
    "ants_cost": "mean cost of the ants",
}
"""What it draws if nothing is named: the first of these that each run has."""

_STEEP = 8.0
"""Times the lowest cost: where costs span more, their scale is logarithmic."""


def plot_learning_curve(
    runs: Any,
    ax: Axes | None = None,
    *,
    x: str = "env_steps",
    y: str | None = None,
    best_so_far: bool = False,
) -> Axes:
    """Draw how agents become better.

    A curve is the median of its runs, with a band from the lowest to the highest; a
    value holds until the next one.

    Args:
        runs: an agent that has learned, or its `history`; a list of those, the runs of
            one curve, which differ in their seeds; or a dict from names to any of
            these, a curve each.
        ax: where to draw; None makes a figure, see `plot_policy`.
        x: `"env_steps"`, `"seconds"` or `"trial"`.
        y: a column of the history, such as `"policy_variation"`. None takes the first
            that each run has of `policy_return`, `policy_cost`, `ants_return` and
            `ants_cost`; those of policies need a `PolicyEvaluation` in `learn`.
        best_so_far: whether each value is the best until then: the lowest, of returns
            and rates of success the highest.

    Returns:
        The axes.

    Raises:
        TypeError: `runs` or `ax` is of the wrong kind.
        ValueError: a run is empty, lacks the column or holds no numbers there, or no value
            is known after the first interaction.
    """
    validation.one_of("x", x, tuple(X_AXES))
    named = isinstance(runs, Mapping)
    curves = {
        str(name): _histories(value)
        for name, value in (runs.items() if named else [("", runs)])
    }
    if not curves:
        raise ValueError("runs must hold one curve or more, got an empty dict.")
    everything = [rows for histories in curves.values() for rows in histories]
    y = _column(everything, y)
    for rows in everything:
        if x not in rows:
            raise ValueError(f"each run must have the column {x!r}, got {list(rows)}.")
        _check_numbers(rows, x)
        _check_numbers(rows, y)
    rising = _rises(y)
    lines = [
        {"color": colour, "linestyle": ("-", "--", ":")[i // len(COLOURS) % 3]}
        for i, colour in zip(range(len(curves)), itertools.cycle(COLOURS), strict=False)
    ]
    with style.axes_or_new(ax, 5.0, 3.1) as ax:
        lowest, highest = math.inf, -math.inf
        for (name, histories), line in zip(curves.items(), lines, strict=True):
            kept = [rows.dropna(subset=[y]) for rows in histories]
            at, values = steps_of(kept, x, y, best_so_far=best_so_far, rising=rising)
            if not at.size:
                raise ValueError(
                    f"{x} must be greater than 0 where {y} is known, in each run of a "
                    f"curve, got {[rows[x].tolist() for rows in kept][:3]}."
                )
            style.draw_band(ax, at, values, {**line, "label": name}, step=True)
            lowest, highest = min(lowest, values.min()), max(highest, values.max())
        if y.endswith("cost") and 0.0 < lowest * _STEEP < highest:
            ax.set_yscale("log")
            style.plain_log(ax.yaxis)
        ax.set_xlabel(X_AXES[x])
        words = Y_AXES.get(y, y.replace("_", " "))
        ax.set_ylabel(f"best {words} so far" if best_so_far else words)
        ax.set_xlim(left=0.0)
        if x == "env_steps":
            ax.xaxis.set_major_formatter(EngFormatter(sep=""))
        if named:
            ax.legend()
        most = max(map(len, curves.values()))
        if most > 1:
            ax.set_title(f"median of {most} runs, band from lowest to highest")
    return ax


def _check_numbers(rows: pd.DataFrame, column: str) -> None:
    """Check that a column of a history holds real numbers.

    Raises:
        ValueError: it holds something else.
    """
    if rows[column].dtype.kind not in "biuf":
        raise ValueError(
            f"each run must hold numbers in the column {column!r}, got "
            f"{validation.shown(rows[column].tolist())}."
        )


def _rises(column: str) -> bool:
    """Whether more of it is better."""
    return column.endswith(("return", "success_rate"))


def _histories(value: Any) -> list[pd.DataFrame]:
    """The rows of each run."""
    import pandas as pd  # takes half a second, which other pictures need not cost

    several = isinstance(value, (list, tuple)) and not all(
        isinstance(row, Mapping) for row in value
    )
    histories = []
    for run in value if several else [value]:
        rows = getattr(run, "history", run)
        if not isinstance(rows, pd.DataFrame):
            listed = isinstance(rows, (list, tuple))
            if not listed or not all(isinstance(row, Mapping) for row in rows):
                raise TypeError(
                    "runs must be agents or their histories, a list of those, or a "
                    f"dict from names to those, got {validation.shown(run)}."
                )
            rows = pd.DataFrame(list(rows))
        if not len(rows):
            raise ValueError(
                "each run must have one trial or more, got an empty history; call "
                "learn first."
            )
        histories.append(rows)
    return histories


def _column(histories: Sequence[pd.DataFrame], y: str | None) -> str:
    """The column to draw, which every run has."""
    common = [
        str(name)
        for name in histories[0]
        if all(name in rows and rows[name].notna().any() for rows in histories)
    ]
    if y is None:
        for name in Y_AXES:
            if name in common:
                return name
    elif y in common:
        return y
    hint = "; pass a PolicyEvaluation to learn" if str(y).startswith("policy_") else ""
    raise ValueError(
        f"y must be a column that every run has, one of {', '.join(common)}, got "
        f"{y!r}{hint}."
    )
