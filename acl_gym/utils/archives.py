"""Agents and recordings as files: NumPy arrays and JSON in one `.npz`, read without pickle.

An untrusted file cannot run code, for arrays are read without pickle and everything
else is JSON. Nor can it fill the memory: of its arrays only those are read that are
asked for, after a look at their size, and all that is read counts against one limit.
"""

from __future__ import annotations

import io
import json
import math
import os
import struct
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.files import checked_target, with_suffix, write_atomically

AGENT, TRANSITIONS = "agent", "transitions"
"""What a file may hold."""

VERSION = 1

MOST_BYTES = 2**28
"""What a file may hold unpacked, unless `load(path, max_bytes=...)` says otherwise: the
tables of 20 million (cell, action) pairs. An agent takes about five times as much."""

_BYTES_A_VALUE = 64
"""The least bytes that a value in the JSON counts as: it becomes an object in memory."""

_NAMED = {AGENT: "an agent", TRANSITIONS: "a file of transitions"}
_FILE = {AGENT: "agent file", TRANSITIONS: "file of transitions"}
_WRITTEN_BY = {
    AGENT: "save() or by `acl-gym train`",
    TRANSITIONS: "Transitions.save()",
}
_AGAIN = {AGENT: "the agent", TRANSITIONS: "them"}

_PART = 2**20
_SUFFIX = ".npy"
_MOST_ARRAYS = 1_000

_MOST_HEADER = 10_000
"""Bytes of the description of an array; of one of numbers it has about a hundred."""

_LENGTHS = {(1, 0): "<H", (2, 0): "<I"}
"""Version of the format of arrays -> how it writes the length of the description."""

Target = str | os.PathLike[str] | BinaryIO
"""A path, or a file open in binary mode."""


def save(
    target: Target,
    header: dict[str, Any],
    arrays: dict[str, NDArray[Any]],
    kind: str = AGENT,
) -> Any:
    """Write header and arrays in one atomic step, or into an open file.

    Args:
        target: the path, to which `.npz` is added where it is missing; or a file open
            for writing in binary mode.
        header: JSON types.
        arrays: numbers and truth values.
        kind: what they are, `AGENT` or `TRANSITIONS`.

    Returns:
        The path written; None for an open file.

    Raises:
        FileNotFoundError: the folder of the file does not exist.
        TypeError: `target` is neither a path nor a binary file.
    """
    path = None if _is_file("save to", target, "write") else with_suffix(target)  # type: ignore[arg-type]
    text = json.dumps({"format": f"acl-gym {kind}", "version": VERSION, **header})
    if path is not None:
        checked_target(path)
    buffer = io.BytesIO()
    content = np.frombuffer(text.encode(), dtype=np.uint8)
    np.savez_compressed(buffer, header=content, **arrays)  # type: ignore[arg-type]
    if path is None:
        target.write(buffer.getvalue())  # type: ignore[union-attr]
    else:
        write_atomically(path, buffer.getvalue())
    return path


class Archive:
    """What `save` wrote, opened: the header is read, the arrays when they are asked for.

    Args:
        source: the path, with or without `.npz`, or a file open for reading in binary
            mode.
        max_bytes: what the file may hold unpacked, as far as it is read, >= 1.
        kind: what it must hold, `AGENT` or `TRANSITIONS`.

    Attributes:
        name: what the file is called in messages.
        header: what `save` was given, and `format` and `version`.
        arrays: the arrays by name.

    Raises:
        FileNotFoundError: there is no such file.
        TypeError: `source` is neither a path nor a binary file, or `max_bytes` is no
            integer.
        ValueError: it is not a file of this package, is damaged, too large, or is of a
            later version; or `max_bytes` is less than 1.
    """

    def __init__(
        self, source: Target, max_bytes: int = MOST_BYTES, kind: str = AGENT
    ) -> None:
        max_bytes = validation.integer("max_bytes", max_bytes, at_least=1)
        self.name, content = _content(source, max_bytes, kind)
        try:
            members = _Members(content, max_bytes)
            header = _json(members.pop_header(), max_bytes)
            form, number = header.get("format"), header.get("version")
        except TooLargeError as error:
            raise ValueError(f"{self.name} {error}") from error
        except Exception as error:
            # NumPy, zipfile, zlib and json raise a dozen kinds of errors, which all mean
            # the same here.
            raise ValueError(
                f"{self.name} is not {_NAMED[kind]} saved by acl-gym, or is damaged "
                f"({type(error).__name__}); save {_AGAIN[kind]} again or use another copy."
            ) from error
        wanted = f"acl-gym {kind}"
        if form != wanted or number != VERSION:
            raise ValueError(
                f"{self.name} must be of format {wanted!r} version {VERSION}, got "
                f"{form!r:.50} version {number!r:.50}."
            )
        self.header: dict[str, Any] = header
        self.arrays = members


class TooLargeError(ValueError):
    """A file holds more than may be read."""

    def __init__(self, what: str, size: int, most: int) -> None:
        super().__init__(
            f"holds {what} of {size:,} bytes or more, where {most:,} bytes are left of "
            "what a file may hold; if you trust it pass load(path, max_bytes=...)."
        )


class _Members(Mapping[str, NDArray[Any]]):
    """The arrays in a zip file, each read when it is asked for, and checked before."""

    def __init__(self, content: bytes, most: int) -> None:
        self._file = zipfile.ZipFile(io.BytesIO(content))
        self._left = most
        infos = self._file.infolist()
        names = {info.filename for info in infos}
        if len(names) < len(infos) or len(infos) > _MOST_ARRAYS:
            raise ValueError("an array is there twice, or there are too many")
        if not all(name.endswith(_SUFFIX) for name in names):
            raise ValueError("there is more than arrays")
        self._infos = {info.filename.removesuffix(_SUFFIX): info for info in infos}
        self._read: dict[str, NDArray[Any]] = {}
        for name in self._infos:
            with self._opened(name) as member:
                _read_kind(member)

    def pop_header(self) -> bytes:
        """The header, which is not one of the arrays."""
        # Half of the room stays for the arrays.
        header = self._array("header", self._left // 2)
        del self._infos["header"]
        if header.dtype != np.uint8 or header.ndim != 1:
            raise ValueError("the header must be text")
        return header.tobytes()

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._infos:
            raise KeyError(name)
        if name not in self._read:
            try:
                self._read[name] = self._array(name, self._left)
            except TooLargeError:
                raise
            except Exception as error:  # a dozen kinds, see `Archive`
                raise ValueError(
                    f"its array {name!r:.50} cannot be read ({type(error).__name__})"
                ) from error
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._infos

    def __iter__(self) -> Iterator[str]:
        return iter(self._infos)

    def __len__(self) -> int:
        return len(self._infos)

    def _opened(self, name: str) -> IO[bytes]:
        info = self._infos[name]
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError("it is packed in an unknown way")
        return self._file.open(info)

    def _array(self, name: str, most: int) -> NDArray[Any]:
        packed = self._infos[name].file_size
        if packed > most:
            raise TooLargeError(name, packed, most)
        with self._opened(name) as member:
            shape, by_column, dtype = _read_kind(member)
            size = dtype.itemsize * math.prod(shape)
            if size > packed:
                raise ValueError(f"it must hold {size} bytes")
            content = bytearray(member.read(size))
            # To the end, where the checksum is compared.
            if len(content) != size or member.read(1):
                raise ValueError(f"it must hold {size} bytes")
        self._left -= packed
        array = np.frombuffer(content, dtype).reshape(
            shape, order="F" if by_column else "C"
        )
        return array.astype(dtype.newbyteorder("="), copy=False)


def _read_kind(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether columns come first, and type of an array, which follows them.

    Raises:
        ValueError: it is no array of numbers.
    """
    version = npy.read_magic(member)
    if version not in _LENGTHS:
        raise ValueError(f"an array is of the unknown version {version}")
    # NumPy would read as much as the field says before it looks at the limit.
    field = member.read(struct.calcsize(_LENGTHS[version]))
    (length,) = struct.unpack(_LENGTHS[version], field)
    if length > _MOST_HEADER:
        raise ValueError(f"the description of an array has {length} bytes")
    text = io.BytesIO(field + member.read(length))
    if version == (1, 0):
        kind = npy.read_array_header_1_0(text)
    else:
        kind = npy.read_array_header_2_0(text)
    shape, by_column, dtype = kind
    if dtype.kind not in "biuf" or any(size < 0 for size in shape):
        raise ValueError(f"an array must hold numbers, got {dtype} of shape {shape}")
    return shape, by_column, dtype


def _is_file(doing: str, target: Any, method: str) -> bool:
    """Whether `target` is an open file, not a path.

    Raises:
        TypeError: it is neither, or a file in text mode.
    """
    if isinstance(target, (str, os.PathLike)):
        return False
    if not hasattr(target, method) or isinstance(target, io.TextIOBase):
        raise TypeError(
            f"the place to {doing} must be a path or a file open in binary mode, got "
            f"{validation.shown(target)}; pass a path, io.BytesIO(), or a file opened "
            "in binary mode."
        )
    return True


def _content(source: Target, most: int, kind: str) -> tuple[str, bytes]:
    """The name and the bytes of a file."""
    if _is_file("load from", source, "read"):
        name = str(getattr(source, "name", "the file"))
        return name, _read(source, name, most, kind)  # type: ignore[arg-type]
    named = with_suffix(source)  # type: ignore[arg-type]
    typed = Path(source)  # type: ignore[arg-type]
    path = named if _is_there(named) else typed
    if not _is_there(path):
        or_typed = "" if typed == named else f", and none at {typed}"
        raise FileNotFoundError(
            f"no {_FILE[kind]} at {named}{or_typed}; give the name of a file that "
            f"was written by {_WRITTEN_BY[kind]}."
        )
    with path.open("rb") as file:
        return str(path), _read(file, str(path), most, kind)


def _is_there(path: Path) -> bool:
    """Whether there is such a file; names that are too long are of none."""
    try:
        return path.is_file()
    except OSError:
        return False


def _read(file: BinaryIO, name: str, most: int, kind: str) -> bytes:
    """The rest of a file, in parts: `read(most)` would make room for all of `most`."""
    parts: list[bytes] = []
    left = most
    while part := file.read(min(_PART, left + 1)):
        if not isinstance(part, bytes):
            raise TypeError(
                f"{name} must be open in binary mode, but gives {type(part).__name__}; "
                "open it in the mode 'rb'."
            )
        left -= len(part)
        if left < 0:
            size = most - left
            raise ValueError(f"{name} {TooLargeError(_NAMED[kind], size, most)}")
        parts.append(part)
    return b"".join(parts)


def _json(text: bytes, most: int) -> dict[str, Any]:
    """A JSON object of a limited number of values."""
    values = sum(text.count(sign) for sign in (b",", b"[", b"{"))
    if values * _BYTES_A_VALUE > most:
        raise TooLargeError(f"{values:,} values", values * _BYTES_A_VALUE, most)
    found = json.loads(text)
    if not isinstance(found, dict):
        raise TypeError("the header must be an object")
    return found
