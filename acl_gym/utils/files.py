"""Agents as files: NumPy arrays and JSON in one `.npz`, read without pickle.

A file from a stranger runs no code: arrays are read with pickle refused, everything
else is JSON.
"""

from __future__ import annotations

import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMAT = "acl-gym agent"
VERSION = 1


def with_suffix(path: str | Path) -> Path:
    """Add `.npz` to a path that lacks it."""
    path = Path(path)
    return path if path.suffix == ".npz" else path.with_name(path.name + ".npz")


def save(
    path: str | Path, header: dict[str, Any], arrays: dict[str, NDArray[Any]]
) -> Path:
    """Write header and arrays; the file appears whole or not at all.

    Returns:
        The path written.

    Raises:
        FileNotFoundError: there is no such folder.
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
    """Return the path of a file to be written if its folder is there.

    Raises:
        FileNotFoundError: there is no such folder.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"there is no folder {path.parent} to save {path.name} in; make it first."
        )
    return path


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all."""
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
        ValueError: it is not ours, is cut short or damaged, or is of a later version.
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
        # Whatever NumPy, zipfile, zlib and json may raise, and that is a dozen kinds,
        # means one thing here.
        raise ValueError(
            f"{source} is not an agent saved by acl-gym, or is cut short "
            f"({type(error).__name__}); save the agent again or use another copy."
        ) from error
    if kind != FORMAT or number != VERSION:
        raise ValueError(
            f"{source} must be of format {FORMAT!r} version {VERSION}, got "
            f"{kind!r} version {number!r}."
        )
    return header, arrays


def _plain_number(value: Any) -> Any:
    """NumPy's numbers, which a callback may have left in a row, as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(
        f"an agent's settings and history must be numbers and strings, got {value!r}."
    )
