"""Numbers, tables and comments as C text."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_WIDTH = 88


class Number:
    """How C writes real numbers.

    Attributes:
        type: "float" or "double".
        bytes: of one number.
        largest: the macro of the largest finite number.
        whole_from: the literal from which on there are no fractions.
        atan2: the function of <math.h>.
        integer: a type that holds all whole numbers below `whole_from`.

    Raises:
        ValueError: `precision` is neither.
    """

    def __init__(self, precision: Any) -> None:
        self.type = validation.one_of("precision", precision, ("float", "double"))
        single = self.type == "float"
        self._dtype: Any = np.float32 if single else np.float64
        self._suffix = "f" if single else ""
        self.bytes = 4 if single else 8
        self.largest = "FLT_MAX" if single else "DBL_MAX"
        self.whole_from = self.literal(2.0**23 if single else 2.0**52)
        self.atan2 = "atan2f" if single else "atan2"
        self.integer = "int32_t" if single else "int64_t"

    def rounded(self, values: FloatArray) -> NDArray[Any]:
        """The nearest numbers of this type."""
        with np.errstate(over="ignore"):  # whoever cannot have infinity checks for it
            return np.asarray(values).astype(self._dtype)

    def literal(self, value: Any) -> str:
        """The shortest literal that is read as this number."""
        text = str(self._dtype(value))
        return (text if re.search(r"[.e]", text) else f"{text}.0") + self._suffix


def integer_type(values: NDArray[Any]) -> tuple[str, int]:
    """The smallest unsigned type of <stdint.h> for `values`, and its bytes."""
    highest = int(values.max())
    bits = next(b for b in (8, 16, 32) if highest < 2**b)
    return f"uint{bits}_t", bits // 8


def table(
    declaration: str, items: Iterable[str], comment: str, row: int | None = None
) -> str:
    """A constant table, which compilers for microcontrollers place in flash.

    Args:
        declaration: type, name and size.
        items: the values as text.
        comment: what it holds.
        row: how many items a line has; None fills the lines.
    """
    lines, line, count = [], "", 0
    for item in items:
        full = len(line) + len(item) + 6 > _WIDTH
        if line and (full if row is None else count == row):
            lines.append(line.rstrip())
            line, count = "", 0
        line += f"{item}, "
        count += 1
    lines.append(line.rstrip().rstrip(","))
    body = "\n".join(f"    {one}" for one in lines)
    return f"/* {comment} */\nstatic const {declaration} = {{\n{body}\n}};\n"


def sanitised(text: str) -> str:
    """Text that a C comment may hold: ASCII that neither ends nor nests a comment."""
    kept = "".join(c if " " <= c <= "~" and c != "\\" else "." for c in str(text))
    return re.sub(r"(?<=[*/?])(?=[*/?])", " ", kept)
