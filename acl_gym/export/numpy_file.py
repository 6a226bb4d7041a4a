"""A greedy policy as arrays, and the lines of NumPy that evaluate them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.export.source import Source
from acl_gym.utils import files

NUMPY_CODE = """\
import numpy as np

p = dict(np.load("policy.npz"))
lines = [p[f"centres_{axis}"] for axis in range(p["periods"].size)]
axes = list(zip(p["columns"], p["sines"], lines, p["periods"]))


def act(observation):
    seen = np.ravel(observation).astype(float)
    corners = [((), 1.0)]  # the cells around the observation, and their degrees
    for column, sine, line, period in axes:
        x = np.arctan2(seen[sine], seen[column]) if sine >= 0 else seen[column]
        x = x - period * np.floor((x - line[0]) / period) if period else x
        low = np.searchsorted(line[1:-1], x, "right")
        up = np.clip((x - line[low]) / (line[low + 1] - line[low]), 0, 1)
        up = up if p["fuzzy"] else float(up >= 0.5)
        sides = [(low, 1 - up), (low + 1, up)]
        corners = [((*c, s), d * w) for c, d in corners for s, w in sides if w]
    values = sum(d * p["table"][c] for c, d in corners)
    ranks = p["ranks"][max(corners, key=lambda corner: corner[1])[0]]
    return int(p["first_action"] + np.lexsort((ranks, -values))[0])
"""
"""Evaluates the arrays of `numpy_arrays` for one observation, without this package.

It gives what `predict` gives, for all finite observations.
"""

NUMPY_INPUT_CODE = (
    NUMPY_CODE.rpartition("\n    return")[0]
    + """
    u = np.lexsort((ranks, -values))[0]
    lower, upper, given = p["below"][u], p["above"][u], p["input_values"]
    inputs = given[u].copy()
    for i in np.flatnonzero((lower >= 0) & (upper >= 0)):
        fall_below, fall_above = values[u] - values[[lower[i], upper[i]]]
        down, up = inputs[i] - given[lower[i], i], given[upper[i], i] - inputs[i]
        total = fall_below * up + fall_above * down
        if total > 0:
            inputs[i] += (fall_below * up**2 - fall_above * down**2) / (2 * total)
    return inputs
"""
)
"""The same for a policy of real inputs, to rounding; see `InterpolatedPolicy.to_numpy`."""


def numpy_arrays(source: Source) -> dict[str, NDArray[Any]]:
    """The arrays of a policy that `NUMPY_CODE` evaluates.

    Returns:
        - `centres_0`, `centres_1`, ...: of each variable, increasing; a circular one
          repeats its first centre one period on, and a lone centre is followed by
          infinity, so that each has an interval;
        - `periods`: of each variable, 0 where it is not circular;
        - `columns`: of each variable its number in an observation; `sines`: that of
          its sine where it is an angle, whose cosine is in `columns`, else -1;
        - `fuzzy`: whether an observation belongs to all cells around it, or to the
          nearest;
        - `table`, `ranks`: values and preferences, an axis for each variable as long
          as its centres, and one for the actions;
        - `first_action`: the number of the first action;
        - `below`, `above`, for a policy of real inputs: the next action along each
          input, `(n_actions, n_inputs)`, -1 where there is none;
        - if known: `observations`, `inputs`, names with units, and `input_values`,
          `(n_actions, n_inputs)`.
    """
    table = source.table.reshape(*source.cells, -1)
    ranks = source.ranks.reshape(table.shape)
    lines, periods = source.lines, np.array(source.periods)
    columns, sine_of = source.angles.columns, dict(source.angles.pairs)
    for axis in np.flatnonzero(periods):
        table = np.concatenate([table, table.take([0], axis)], axis)
        ranks = np.concatenate([ranks, ranks.take([0], axis)], axis)
    arrays: dict[str, NDArray[Any]] = {
        f"centres_{axis}": line if line.size > 1 else np.append(line, np.inf)
        for axis, line in enumerate(lines)
    }
    arrays |= {
        "periods": periods,
        "columns": np.array(columns),
        "sines": np.array([sine_of.get(column, -1) for column in columns]),
        "fuzzy": np.array(source.kind == "fuzzy"),
        "table": table,
        "ranks": ranks,
        "first_action": np.array(source.first_action),
    }
    if source.grid is not None:
        arrays |= {"below": source.grid.below, "above": source.grid.above}
    if source.signals is not None:
        arrays["observations"] = np.array(source.signals.observations, dtype=np.str_)
        arrays["inputs"] = np.array(source.signals.inputs, dtype=np.str_)
        arrays["input_values"] = np.array(source.signals.values)
    return arrays


def write_numpy_file(path: str | Path, source: Source) -> Path:
    """Write the arrays; see `PartitionPolicy.to_numpy`."""
    target = files.checked_target(files.with_suffix(path))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **numpy_arrays(source))  # type: ignore[arg-type]
    files.write_atomically(target, buffer.getvalue())
    return target
