"""Options of `acl-gym design` that describe measurements."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from acl_gym.cli.errors import BadArgumentError, bad_arguments

SUFFIXES = (".csv", ".parquet")
"""Of files of measurements."""


def load(file: Path, given: Mapping[str, Any]) -> Any:
    """Learn the dynamics that a file shows.

    Args:
        file: of measurements.
        given: the values of the options by their names, None where one was left out.

    Returns:
        A `LearnedVectorEnv`.

    Raises:
        BadArgumentError: an option is missing or not valid, or the file does not fit.
    """
    for name in ("--state", "--input", "--goal"):
        if given[name] is None:
            raise BadArgumentError(
                f"{name} is missing: measurements need --state, --input and --goal; see "
                "acl-gym design --help."
            )
    actions = given["--actions"]
    from acl_gym.design.recordings import Recording, plant_of_recording

    recording = Recording(
        state=_names(given["--state"]),
        input=_names(given["--input"]),
        goal=_numbers("--goal", given["--goal"]),
        tolerance=_numbers_or_none("--tolerance", given["--tolerance"]),
        cost=_cost(given["--cost"]),
        circular=_names(given["--circular"] or ""),
        low=_ends("--low", given["--low"]),
        high=_ends("--high", given["--high"]),
        starts=_starts(given["--starts"]),
        actions=None
        if actions is None
        else tuple(_numbers("--actions", each) for each in actions.split(";")),
        time=given["--time"],
        run=given["--run"],
        sampling_time=given["--sampling-time"],
        max_steps=given["--max-steps"] or Recording.max_steps,
    )
    with bad_arguments():
        return plant_of_recording(file, recording)


def split_names(text: str) -> list[str]:
    """Names between commas; one that holds a comma itself stands in double quotes."""
    line = text.replace("\r", " ").replace("\n", " ")
    return [part.strip() for part in next(csv.reader([line], skipinitialspace=True))]


def _names(text: str) -> tuple[str, ...]:
    return tuple(name for name in split_names(text) if name)


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise BadArgumentError(
            f"{option} must be numbers such as 3.14,0, got {text!r}."
        ) from None


def _numbers_or_none(option: str, text: str | None) -> tuple[float, ...] | None:
    return None if text is None else _numbers(option, text)


def _ends(option: str, text: str | None) -> tuple[float | None, ...] | None:
    """Numbers, of which some may be left out: ",-9"."""
    if text is None:
        return None
    return tuple(
        _numbers(option, part)[0] if part.strip() else None for part in text.split(",")
    )


def _starts(text: str | None) -> Any:
    """The lower and the upper ends of the starts."""
    if text is None:
        return None
    low, colon, high = text.partition(":")
    if not colon:
        raise BadArgumentError(
            "--starts must be the lower and the upper ends of the starts with a colon "
            f"between them, such as 3,-0.5:3.3,0.5, got {text!r}."
        )
    return _numbers("--starts", low), _numbers("--starts", high)


def _cost(text: str | None) -> Any:
    if text is None:
        return "time"
    errors, colon, inputs = text.partition(":")
    if not colon:
        raise BadArgumentError(
            "--cost must be time, or weights on the errors and on the inputs with a "
            f"colon between them, such as 1,0.1:0.05, got {text!r}."
        )
    return list(_numbers("--cost", errors)), list(_numbers("--cost", inputs))
