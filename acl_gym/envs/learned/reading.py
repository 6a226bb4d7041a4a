"""Steps from tables of measurements, with a row for each moment."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.learned.quality import DataWarning
from acl_gym.utils import validation

UNEVEN = 0.1
"""The share of a sampling time by which a step may be longer or shorter."""

OFTEN = 0.1
"""The share of uneven steps from which on they are no gaps, but the clock is uneven."""

COLUMNS = ("state", "input", "next_state", "time", "run", "reward", "terminated")
"""The arguments that name columns."""

DESCRIBED = (
    "sampling_time",
    "state_names",
    "input_names",
    "circular",
    "low",
    "high",
    "angles",
    "values",
    "numbered",
)
"""The arguments that describe what the columns hold."""


def arrays_of_frames(
    frames: Sequence[Any],
    *,
    state: Any = None,
    input: Any = None,
    next_state: Any = None,
    time: str | None = None,
    run: str | None = None,
    reward: str | None = None,
    terminated: str | None = None,
    sampling_time: float | None = None,
    names: Sequence[str] = (),
    **described: Any,
) -> dict[str, Any]:
    """Make steps from rows; see `Transitions.from_csv`.

    Args:
        frames: pandas frames, each with runs of its own.
        state: see there.
        input: see there.
        next_state: see there.
        time: see there.
        run: see there.
        reward: see there.
        terminated: see there.
        sampling_time: see there.
        names: of the frames, for messages.
        **described: passed on to `Transitions`.

    Returns:
        Arguments of `Transitions`.

    Raises:
        ValueError: a column is missing or holds no numbers, time does not increase, or
            no two rows follow each other.
    """
    _check_described(described)
    columns = {"state": _listed("state", state), "input": _listed("input", input)}
    time, run, reward, terminated = (
        None if each is None else _listed(key, each)[0]
        for key, each in zip(
            ("time", "run", "reward", "terminated"),
            (time, run, reward, terminated),
            strict=True,
        )
    )
    if next_state is not None:
        columns["next_state"] = _listed("next_state", next_state)
        if len(columns["next_state"]) != len(columns["state"]):
            raise ValueError(
                "next_state must name a column for each of state, got "
                f"{columns['next_state']} for {columns['state']}."
            )
    both = set(columns["state"]) & set(columns["input"])
    if both:
        raise ValueError(
            f"a column is a variable of the state or an input, got {sorted(both)} as both."
        )
    if sampling_time is not None:
        sampling_time = validation.number("sampling_time", sampling_time, above=0)
    if terminated is not None and next_state is None and run is None:
        raise ValueError(
            "terminated needs next_state or run as well: without them the row after an "
            "end may be its last state or the first of the next run."
        )
    parts: list[dict[str, Any]] = []
    runs_before, gaps = 0, 0
    times: list[float] = []
    tables = []
    for number, frame in enumerate(frames):
        name = names[number] if names else "the frame"
        table = {key: _numbers(frame, each, name) for key, each in columns.items()}
        for key, column in (("reward", reward), ("terminated", terminated)):
            if column is not None:
                table[key] = _numbers(frame, [column], name)[:, 0]
        if time is not None:
            table["time"] = _seconds(frame, time, name)
        table["run"] = _changes(frame, run, name)
        if time is not None:
            usual = _usual_step(table["time"], table["run"], time, name)
            times += [] if usual is None else [usual]
        tables.append(table)
    if sampling_time is None and times:
        sampling_time = float(np.median(times))
    for table in tables:
        part, missed = _steps(table, sampling_time if time is not None else None)
        part["episodes"] += runs_before
        runs_before = int(part["episodes"].max(initial=runs_before - 1)) + 1
        gaps += missed
        parts.append(part)
    if gaps:
        left = sum(len(part["states"]) for part in parts)
        words = (
            f"there {'is 1 gap' if gaps == 1 else f'are {gaps} gaps'} in time, where "
            f"a row is not {sampling_time:g} s after the one before; the run is taken "
            "to end there."
        )
        if gaps > OFTEN * (gaps + left):
            words = (
                f"{gaps} of {gaps + left} steps are longer or shorter than "
                f"{sampling_time:g} s by more than {UNEVEN:.0%} and are left out: the "
                "clock of this recording is uneven. Interpolate its rows to even times "
                "to keep them."
            )
        warnings.warn(DataWarning(words), stacklevel=4)
    joined = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    if not len(joined["states"]):
        raise ValueError(
            "there must be two rows or more that follow each other in one run, got none; "
            "check the columns of time and run."
        )
    return {
        **joined,
        "state_names": columns["state"],
        "input_names": columns["input"],
        "sampling_time": sampling_time,
        **described,
    }


def _steps(
    table: dict[str, Any], sampling_time: float | None
) -> tuple[dict[str, Any], int]:
    """The steps between the rows of one table, and how many gaps there are."""
    if "next_state" in table:
        rows = np.arange(len(table["state"]))
        part = {"states": table["state"], "next_states": table["next_state"]}
        runs, gaps = table["run"], 0
    else:
        same = table["run"][1:] == table["run"][:-1]
        breaks = ~same
        gaps = 0
        if sampling_time is not None:
            uneven = np.abs(np.diff(table["time"]) - sampling_time)
            gap = same & (uneven > UNEVEN * sampling_time)
            gaps = int(np.count_nonzero(gap))
            breaks |= gap
        rows = np.flatnonzero(~breaks)
        runs = np.concatenate([[0], np.cumsum(breaks)])[rows]
        state = table["state"]
        part = {"states": state[rows], "next_states": state[rows + 1]}
    part |= {"inputs": table["input"][rows], "episodes": runs.astype(np.int64)}
    for key, name in (("reward", "rewards"), ("terminated", "terminated")):
        if key in table:
            part[name] = table[key][rows]
    return part, gaps


def _usual_step(time: Any, run: Any, column: str, name: str) -> float | None:
    """The median time from a row to the next of its run; None where none has a next."""
    step = np.diff(time)
    inside = run[1:] == run[:-1]
    if inside.any() and not (step[inside] > 0).all():
        row = int(np.flatnonzero(inside & ~(step > 0))[0])
        raise ValueError(
            f"the time in column {column!r} of {name} must increase, got {time[row]:g} "
            f"and then {time[row + 1]:g} in rows {row} and {row + 1}; sort the rows, "
            "remove those that are there twice, or name the column of the run."
        )
    return float(np.median(step[inside])) if inside.any() else None


def _changes(frame: Any, run: str | None, name: str) -> Any:
    """The number of the run of each row."""
    if run is None:
        return np.zeros(len(frame), np.int64)
    _check_columns(frame, [run], name)
    column = _column(frame, run)
    missing = column.isna().to_numpy()
    if missing.any():
        raise ValueError(
            f"column {run!r} of {name} must say which run each row belongs to, got "
            f"nothing in row {int(np.argmax(missing))} ({np.count_nonzero(missing)} rows of "
            f"{len(missing)} are empty); fill in the run, or leave such rows out."
        )
    values = column.to_numpy()
    changed = np.zeros(len(values), np.int64)
    changed[1:] = values[1:] != values[:-1]
    return np.cumsum(changed)


def _numbers(frame: Any, columns: list[str], name: str) -> NDArray[np.float64]:
    _check_columns(frame, columns, name)
    found = []
    for column in columns:
        values = _column(frame, column).to_numpy()
        if values.dtype.kind == "O" and all(map(_is_number, values)):
            # Numbers of several types; what no float64 holds becomes infinite.
            values = np.array([_as_float(each) for each in values])
        if values.dtype.kind in "mM":
            raise ValueError(
                f"column {column!r} of {name} must hold numbers, got dates or times "
                f"({values.dtype}); only the column of the time may hold these."
            )
        if values.dtype.kind not in "biuf":
            row = next((i for i, v in enumerate(values) if not _reads_as_number(v)), 0)
            raise ValueError(
                f"column {column!r} of {name} must hold numbers, got "
                f"{validation.shown(values[row : row + 1].tolist())} in row {row}, counted "
                "from 0 below the names; repair the file or name another column."
            )
        found.append(values.astype(np.float64))
    table = np.stack(found, axis=1)
    finite = np.isfinite(table).all(axis=1)
    if not finite.all():
        row = int(np.argmin(finite))
        raise ValueError(
            f"columns {columns} of {name} must be finite, got {table[row].tolist()} in "
            f"row {row} ({np.count_nonzero(~finite)} rows of {len(table)} are not); "
            "leave such rows out, or fill them in."
        )
    return table


def _seconds(frame: Any, column: str, name: str) -> NDArray[np.float64]:
    """The time of each row in s; dates are counted from the first one."""
    import pandas as pd

    _check_columns(frame, [column], name)
    values = _column(frame, column)
    if pd.api.types.is_datetime64_any_dtype(values):
        values = values - values.min()
    if pd.api.types.is_timedelta64_dtype(values):
        frame = pd.DataFrame({column: values.dt.total_seconds()})
    return _numbers(frame, [column], name)[:, 0]


def _column(frame: Any, name: str) -> Any:
    """The column of that name; names in a frame may be numbers."""
    return frame.iloc[:, [str(each) for each in frame.columns].index(name)]


def _check_columns(frame: Any, columns: list[str], name: str) -> None:
    if not hasattr(frame, "columns") or not hasattr(frame, "__getitem__"):
        raise TypeError(f"a pandas frame is needed, got {validation.shown(frame)}.")
    there = [str(each) for each in frame.columns]
    for column in columns:
        if column not in there:
            divided = [each for each in there if column == each.partition(",")[0]]
            remedy = "check the spelling"
            if divided:
                remedy = (
                    "on a command line, a name with a comma stands in double quotes, such "
                    f"as '\"{divided[0]}\"'"
                )
            raise ValueError(
                f"{name} must have a column {column!r}, got the columns {there[:20]}; "
                f"{remedy}."
            )
        if there.count(column) > 1:
            raise ValueError(f"{name} must have one column {column!r}, got several.")


def _check_described(described: dict[str, Any]) -> None:
    """Refuse what describes no recording, such as a name that is misspelt."""
    for name in described:
        if name not in DESCRIBED:
            raise TypeError(
                f"columns of a recording are named by {', '.join(COLUMNS)}, and described "
                f"by {', '.join(DESCRIBED)}, got {name!r}."
                f"{validation.did_you_mean(name, (*COLUMNS, *DESCRIBED))}"
            )


def _listed(name: str, columns: Any) -> list[str]:
    single = isinstance(columns, str | int)
    listed = [columns] if single else validation.elements(columns)
    if listed and not any(isinstance(each, bool) for each in listed):
        # A frame that was made of an array has numbers as names.
        listed = [
            str(each) if isinstance(each, int | np.integer) else each for each in listed
        ]
    if not listed or not all(isinstance(each, str) for each in listed):
        raise ValueError(
            f"{name} must be names of columns, one or more, got "
            f"{validation.shown(columns)}."
        )
    if len(set(listed)) < len(listed):
        raise ValueError(f"{name} must name each column once, got {listed}.")
    return listed


def _as_float(value: Real) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _reads_as_number(value: Any) -> bool:
    """Whether a value, which may be text, is a number."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    except OverflowError:  # an integer beyond all floats
        return True
    return True


def _is_number(value: Any) -> bool:
    """Whether a value is a real number already."""
    return isinstance(value, Real) and not isinstance(value, bool)
