"""Learning curves: the cost of policies over interactions, or over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from acl_gym.plotting import style
from acl_gym.utils.steps import hold_last_value
from acl_gym.utils.typing import FloatArray

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
    """
    for rows, line in zip(logs.values(), lines, strict=True):
        at, values = steps_of(rows, x, best_so_far=best_so_far)
        style.draw_band(ax, at, values, line, step=True, spans=spans)
    ax.set(xscale="log", yscale="log", xlabel=AXES[x])
    if x == "seconds":
        style.plain_numbers(ax.xaxis)
    figure: Any = ax.figure
    if not figure.legends:
        handles = [
            Line2D([], [], **line, label=label)
            for label, line in zip(logs, lines, strict=True)
        ]
        columns = len(handles) if len(handles) <= 5 else math.ceil(len(handles) / 2)
        style.legend(figure, handles, ncols=columns)


def steps_of(
    rows: Sequence[pd.DataFrame], x: str, *, best_so_far: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Where a policy cost of some run changes, `(n,)`, and all of them, `(runs, n)`.

    A policy counts from its evaluation to the next one, the last one to the end. The
    curves begin where each run has a policy.
    """
    if best_so_far:
        rows = [each.assign(policy_cost=each["policy_cost"].cummin()) for each in rows]
    at = np.unique(np.concatenate([each[x] for each in rows]))
    at = at[(at >= max(each[x].iloc[0] for each in rows)) & (at > 0)]  # for a log axis
    return at, np.stack(
        [hold_last_value(each[x], each["policy_cost"], at) for each in rows]
    )
