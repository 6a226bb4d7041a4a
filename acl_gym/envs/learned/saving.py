"""The file that holds recorded transitions: arrays and JSON, read without pickle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.learned.description import Description
from acl_gym.utils import archives
from acl_gym.utils.validation import shown

MOST_BYTES = 2**32
"""What a file of transitions may hold unpacked, unless `load` gets another limit."""

_ARRAYS = ("states", "inputs", "next_states", "rewards", "terminated", "episodes")
_FLAT = ("state_names", "input_names", "circular", "angles", "numbered")

Made = TypeVar("Made")


def save(
    path: archives.Target,
    description: Description,
    arrays: Mapping[str, NDArray[Any]],
    unit_doubts: Sequence[str],
) -> Any:
    """Write a file; see `Transitions.save`.

    Args:
        path: see there.
        description: of the arrays.
        arrays: of `_ARRAYS` those that are known.
        unit_doubts: what spoke against the units before angles were brought back.
    """
    header = {name: getattr(description, name) for name in _FLAT}
    header["unit_doubts"] = list(unit_doubts)
    header["sampling_time"] = description.sampling_time
    kept: dict[str, NDArray[Any]] = dict(arrays)
    kept |= {"low": np.array(description.low), "high": np.array(description.high)}
    if description.values is not None:
        kept["values"] = np.array(description.values)
    return archives.save(path, header, kept, archives.TRANSITIONS)


def load(
    path: archives.Target,
    max_bytes: int,
    make: Callable[[dict[str, Any], list[str]], Made],
) -> Made:
    """Read a file; see `Transitions.load`.

    Args:
        path: see there.
        max_bytes: see there.
        make: of the arguments of `Transitions`, which it checks, and the doubts about
            units.
    """
    archive = archives.Archive(path, max_bytes, archives.TRANSITIONS)
    try:
        facts: dict[str, Any] = {name: archive.header[name] for name in _FLAT}
        facts["sampling_time"] = archive.header["sampling_time"]
        facts |= {n: archive.arrays[n] for n in _ARRAYS if n in archive.arrays}
        for name in ("low", "high", "values"):
            facts[name] = archive.arrays.get(name)
        told = archive.header.get("unit_doubts", [])  # older files have none
        if not isinstance(told, list) or not all(isinstance(t, str) for t in told):
            raise ValueError(f"unit_doubts must be texts, got {shown(told)}.")
        return make(facts, told)
    except archives.TooLargeError as error:
        raise ValueError(f"{archive.name} {error}") from error
    except Exception as error:  # whatever a damaged file leads to
        raise ValueError(
            f"{archive.name} is not a complete file of transitions: {error} Save "
            "them again or use another copy."
        ) from error
