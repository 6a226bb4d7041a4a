"""Recordings of others: tables of measurements, and Minari's data sets."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.learned.quality import DataWarning
from acl_gym.utils import validation
from acl_gym.utils.boxes import declared_bounds

UNEVEN = 0.1
"""The share of a sampling time by which a step may be longer or shorter."""


def arrays_of_files(
    path: Any,
    kind: str,
    *,
    state: Any = None,
    input: Any = None,
    next_state: Any = None,
    **columns: Any,
) -> dict[str, Any]:
    """Read one or several tables; see `Transitions.from_csv`.

    Args:
        path: a path, or a list of them.
        kind: "csv" or "parquet".
        state: see there.
        input: see there.
        next_state: see there.
        **columns: see there.

    Returns:
        Arguments of `Transitions`.
    """
    import pandas as pd

    read = _read_csv if kind == "csv" else pd.read_parquet
    several = isinstance(path, list | tuple)
    paths = [
        validation.file_path("path", each) for each in (path if several else [path])
    ]
    if not paths:
        raise ValueError("path must be a file or several, got an empty list.")
    frames = []
    for each in paths:
        if not each.is_file():
            raise FileNotFoundError(
                f"there is no file {each}; check the name and the folder."
            )
        try:
            frames.append(read(each))
        except Exception as error:  # whatever pandas raises for a file of another kind
            raise ValueError(
                f"{each} must be a {kind} file with names of columns in its first row, "
                f"but cannot be read: {_first_line(error)}."
            ) from error
    return arrays_of_frames(
        frames,
        names=[str(each) for each in paths],
        state=state,
        input=input,
        next_state=next_state,
        **columns,
    )


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
    columns = {"state": _listed("state", state), "input": _listed("input", input)}
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
            table["time"] = _numbers(frame, [time], name)[:, 0]
        table["run"] = _changes(frame, run, name)
        if time is not None:
            times.append(_usual_step(table["time"], table["run"], time, name))
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
        warnings.warn(
            DataWarning(
                f"there {'is 1 gap' if gaps == 1 else f'are {gaps} gaps'} in time, where "
                f"a row is not {sampling_time:g} s after the one before; the run is taken "
                "to end there. Resample a recording whose steps are uneven throughout."
            ),
            stacklevel=4,
        )
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


def arrays_of_minari(dataset: Any) -> dict[str, Any]:
    """Read a data set of Minari; see `Transitions.from_minari`.

    Returns:
        Arguments of `Transitions`.
    """
    if isinstance(dataset, str | Path):
        dataset = _of_minari_id(str(dataset))
    if not hasattr(dataset, "iterate_episodes"):
        raise TypeError(
            "dataset must be a minari.MinariDataset or the id of one, got "
            f"{validation.shown(dataset)}."
        )
    seen, acted = dataset.observation_space, dataset.action_space
    if not isinstance(seen, spaces.Box) or len(seen.shape) != 1:
        raise TypeError(
            "a data set needs observations that are a Box of one axis, got "
            f"{validation.shown(seen)}."
        )
    numbered = isinstance(acted, spaces.Discrete)
    if not numbered and not (isinstance(acted, spaces.Box) and len(acted.shape) == 1):
        raise TypeError(
            "a data set needs Discrete actions or a Box of one axis, got "
            f"{validation.shown(acted)}."
        )
    parts: dict[str, list[NDArray[Any]]] = {}
    for number, episode in enumerate(dataset.iterate_episodes()):
        steps = len(episode.actions)
        new = {
            "states": np.asarray(episode.observations, np.float64)[:steps],
            "inputs": np.asarray(episode.actions, np.float64).reshape(steps, -1),
            "next_states": np.asarray(episode.observations, np.float64)[1:],
            "rewards": np.asarray(episode.rewards, np.float64),
            "terminated": np.asarray(episode.terminations, np.bool_),
            "episodes": np.full(steps, number),
        }
        for name, array in new.items():
            parts.setdefault(name, []).append(array)
    if not parts:
        raise ValueError("dataset must hold one episode or more, got none.")
    facts: dict[str, Any] = {n: np.concatenate(kept) for n, kept in parts.items()}
    facts["low"], facts["high"] = declared_bounds(seen)
    if numbered:
        numbers = np.arange(int(acted.start), int(acted.start + acted.n))
        facts |= {"values": numbers[:, None].astype(np.float64), "numbered": True}
    return facts


def _of_minari_id(name: str) -> Any:
    """The data set of that id on this machine; see `Transitions.from_minari`."""
    try:
        import minari
    except ImportError as error:
        raise ImportError(
            "a data set is loaded by its id with Minari, which is not installed; "
            'run pip install "acl-gym[minari]".'
        ) from error
    try:
        return minari.load_dataset(name)
    except FileNotFoundError as error:
        there = list(minari.list_local_datasets())
        similar = get_close_matches(name, there, 1)
        hint = f" Did you mean {similar[0]!r}?" if similar else ""
        raise FileNotFoundError(
            f"dataset must be the id of a data set of Minari on this machine, got "
            f"{validation.shown(name)}; check the spelling, or download it with "
            f"minari.download_dataset({validation.shown(name)}).{hint}"
        ) from error
    except Exception as error:  # whatever Minari and HDF5 raise for a damaged one
        raise ValueError(
            f"the data set {validation.shown(name)} of Minari cannot be read: "
            f"{_first_line(error)}; download or make it again."
        ) from error


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


def _usual_step(time: Any, run: Any, column: str, name: str) -> float:
    step = np.diff(time)
    inside = run[1:] == run[:-1]
    if inside.any() and not (step[inside] > 0).all():
        row = int(np.flatnonzero(inside & ~(step > 0))[0])
        raise ValueError(
            f"the time in column {column!r} of {name} must increase, got {time[row]:g} "
            f"and then {time[row + 1]:g} in rows {row} and {row + 1}; sort the rows, "
            "remove those that are there twice, or name the column of the run."
        )
    return float(np.median(step[inside])) if inside.any() else np.nan


def _changes(frame: Any, run: str | None, name: str) -> Any:
    """The number of the run of each row."""
    if run is None:
        return np.zeros(len(frame), np.int64)
    _check_columns(frame, [run], name)
    values = frame[run].to_numpy()
    changed = np.zeros(len(values), np.int64)
    changed[1:] = values[1:] != values[:-1]
    return np.cumsum(changed)


def _numbers(frame: Any, columns: list[str], name: str) -> NDArray[np.float64]:
    _check_columns(frame, columns, name)
    found = []
    for column in columns:
        values = frame[column].to_numpy()
        if values.dtype.kind not in "biuf":
            row = next((i for i, v in enumerate(values) if not _is_number(v)), 0)
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


def _check_columns(frame: Any, columns: list[str], name: str) -> None:
    if not hasattr(frame, "columns") or not hasattr(frame, "__getitem__"):
        raise TypeError(f"a pandas frame is needed, got {validation.shown(frame)}.")
    there = [str(each) for each in frame.columns]
    for column in columns:
        if column not in there:
            raise ValueError(
                f"{name} must have a column {column!r}, got the columns {there[:20]}; "
                "check the spelling."
            )
        if there.count(column) > 1:
            raise ValueError(f"{name} must have one column {column!r}, got several.")


def _listed(name: str, columns: Any) -> list[str]:
    listed = [columns] if isinstance(columns, str) else validation.elements(columns)
    if not listed or not all(isinstance(each, str) for each in listed):
        raise ValueError(
            f"{name} must be names of columns, one or more, got "
            f"{validation.shown(columns)}."
        )
    if len(set(listed)) < len(listed):
        raise ValueError(f"{name} must name each column once, got {listed}.")
    return listed


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def _read_csv(path: Path) -> Any:
    """A frame from a CSV file, whatever separates its columns."""
    import pandas as pd

    with path.open(encoding="utf-8", errors="replace") as file:
        head, first = file.readline(), file.readline()
    separator = max((",", ";", "\t"), key=head.count)
    comma = separator != "," and "," in first and "." not in first
    frame = pd.read_csv(
        path, sep=separator, decimal="," if comma else ".", skipinitialspace=True
    )
    return frame.rename(columns=lambda name: str(name).strip())


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0].rstrip(".")
