"""Hashes of values, to tell whether they are the same."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.utils.typing import FloatArray

NUMBERS_BYTES = hashlib.sha256().digest_size
"""How many bytes `hashed_numbers` returns."""


def hashed(value: Any) -> str:
    """The SHA-256 hash of JSON types, in hexadecimal digits."""
    text = json.dumps(value, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def hashed_numbers(numbers: FloatArray) -> bytes:
    """The SHA-256 hash of an array's shape and float64 numbers, `NUMBERS_BYTES` long.

    The same on every machine; -0 counts as another number than 0.
    """
    content = np.ascontiguousarray(numbers, dtype="<f8")
    found = hashlib.sha256(str(content.shape).encode())
    found.update(content.data)
    return found.digest()


def digest(path: Path) -> str:
    """The SHA-256 hash of a file, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_CHECKSUM = "checksum"


def with_checksum(values: dict[str, Any]) -> dict[str, Any]:
    """The values and, under `checksum`, the hash over them; all JSON types."""
    return {**values, _CHECKSUM: hashed(json.loads(json.dumps(values)))}


def without_checksum(values: dict[str, Any]) -> dict[str, Any]:
    """The values that `with_checksum` was given."""
    return {name: value for name, value in values.items() if name != _CHECKSUM}


def checksum_fits(values: dict[str, Any]) -> bool:
    """Whether values are as they were when `with_checksum` was called."""
    return values.get(_CHECKSUM) == hashed(without_checksum(values))
