"""Agents as files: NumPy arrays and JSON in one `.npz`, read without pickle.

A file from a stranger runs no code: arrays are read with pickle refused, everything
else is JSON.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
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
    """
    target = with_suffix(path)
    text = json.dumps({"format": FORMAT, "version": VERSION, **header})
    buffer = io.BytesIO()
    content = np.frombuffer(text.encode(), dtype=np.uint8)
    np.savez_compressed(buffer, header=content, **arrays)  # type: ignore[arg-type]
    write_atomically(target, buffer.getvalue())
    return target


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
    source = Path(path)
    if not source.is_file():
        source = with_suffix(path)
    if not source.is_file():
        raise FileNotFoundError(f"no agent file at {source}.")
    try:
        with np.load(source, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        header = json.loads(arrays.pop("header").tobytes())
        ours = header["format"] == FORMAT
    except (
        # What NumPy, zipfile, zlib and json raise for files that are something else.
        AttributeError,
        EOFError,
        KeyError,
        OSError,
        TypeError,
        ValueError,
        zipfile.BadZipFile,
    ) as error:
        raise ValueError(
            f"{source} is not an agent saved by acl-gym, or is cut short: {error}."
        ) from error
    if not ours or header["version"] != VERSION:
        raise ValueError(
            f"{source} must be of format {FORMAT!r} version {VERSION}, got "
            f"{header['format']!r} version {header.get('version')!r}."
        )
    return header, arrays
