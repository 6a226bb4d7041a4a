"""Hashes of values, to tell whether they are the same."""

from __future__ import annotations

import hashlib
import json
from typing import Any


def hashed(value: Any) -> str:
    """The SHA-256 hash of JSON types, in hexadecimal digits."""
    text = json.dumps(value, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
