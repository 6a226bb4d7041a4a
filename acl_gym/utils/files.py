"""Agents as files: NumPy arrays and JSON in one `.npz`, read without pickle.

An untrusted file cannot run code: arrays are read without pickle, and everything else
is JSON.
"""

from __future__ import annotations

import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils import validation

FORMAT = "acl-gym agent"
VERSION = 1


def with_suffix(path: str | Path) -> Path:
    """Add `.npz` to a path that lacks it."""
    path = validation.path("path", path)
    return path if path.suffix == ".npz" else path.with_name(path.name + ".npz")


def save(
    path: str | Path, header: dict[str, Any], arrays: dict[str, NDArray[Any]]
) -> Path:
    """Write header and arrays in one atomic step.

    Returns:
        The path written.

    Raises:
        FileNotFoundError: the folder of the file does not exist.
    """
    target = with_suffix(path)
    text = json.dumps(
        {"format": FORMAT, "version": VERSION, **header}, default=_plain_number
    )
    checked_target(target)
    buffer = io.BytesIO()
    content = np.frombuffer(text.encode(), dtype=np.uint8)
    np.savez_compressed(buffer, header=content, **arrays)  # type: ignore[arg-type]
    write_atomically(target, buffer.getvalue())
    return target


def checked_target(path: Path) -> Path:
    """Return the path of a file to be written if its folder exists.

    Raises:
        FileNotFoundError: the folder of the file does not exist.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"there is no folder {path.parent} to save {path.name} in; make it first."
        )
    return path


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that it appears complete or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def load(path: str | Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Read what `save` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not a file of this package, is damaged, or is of a later
            version.
    """
    source = with_suffix(path)
    if not source.is_file():
        source = Path(path)
    if not source.is_file():
        raise FileNotFoundError(f"no agent file at {with_suffix(path)}.")
    try:
        with source.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        header = json.loads(arrays.pop("header").tobytes())
        kind, number = header.get("format"), header.get("version")
    except Exception as error:
        # NumPy, zipfile, zlib and json raise a dozen kinds of errors, which all mean
        # the same here.
        raise ValueError(
            f"{source} is not an agent saved by acl-gym, or is damaged "
            f"({type(error).__name__}); save the agent again or use another copy."
        ) from error
    if kind != FORMAT or number != VERSION:
        raise ValueError(
            f"{source} must be of format {FORMAT!r} version {VERSION}, got "
            f"{kind!r} version {number!r}."
        )
    return header, arrays


def _plain_number(value: Any) -> Any:
    """Turn a NumPy number, which a callback may have added, into a Python number."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(
        f"an agent's settings and history must be numbers and strings, got {value!r}."
    )
