"""Checks of arguments, whose errors state what was expected and what was given."""

from __future__ import annotations

import itertools
import math
import os
import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FLOAT64 = np.dtype(np.float64)
_MANY = 10
_MOST_ELEMENTS = 1_000_000
_LONGEST = 200  # letters of a value that a message shows


@dataclass(frozen=True)
class Range:
    """An interval of finite real numbers; None leaves an end open.

    Attributes:
        above: exclusive lower bound.
        at_least: inclusive lower bound.
        at_most: inclusive upper bound.
        below: exclusive upper bound.
    """

    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    below: float | None = None

    def __contains__(self, value: float) -> bool:
        return (
            math.isfinite(value)
            and (self.above is None or value > self.above)
            and (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
            and (self.below is None or value < self.below)
        )

    def __str__(self) -> str:
        left = f"({_short(self.above)}" if self.above is not None else "(-inf"
        if self.at_least is not None:
            left = f"[{_short(self.at_least)}"
        right = f"{_short(self.below)})" if self.below is not None else "inf)"
        if self.at_most is not None:
            right = f"{_short(self.at_most)}]"
        return f"{left}, {right}"

    def in_words(self) -> str:
        """As docstrings say it: "in [0, 1)", "> 0", ">= 0"."""
        if self.at_most is None and self.below is None:
            if self.at_least is not None:
                return f">= {_short(self.at_least)}"
            if self.above is not None:
                return f"> {_short(self.above)}"
        return f"in {self}"


def _short(bound: float) -> str:
    """A bound as people write it: 1e6, not 1e+06."""
    return f"{bound:g}".replace("e+0", "e").replace("e+", "e")


def number(
    name: str, value: Any, within: Range | None = None, **bounds: float | None
) -> float:
    """Return `value` as a finite float inside the given range.

    Args:
        name: what the number is called in the error message.
        value: the candidate.
        within: the range; None takes it from `bounds`.
        **bounds: attributes of `Range`.

    Raises:
        TypeError: `value` is not a real number.
        ValueError: `value` is NaN, infinite or outside the range.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(
            f"{name} must be a real number, got {shown(value)} of type "
            f"{type(value).__name__}; pass an int or a float."
        )
    try:
        result = float(value)
    except OverflowError:  # an int beyond all floats
        result = math.inf
    interval = Range(**bounds) if within is None else within
    if result not in interval:
        raise ValueError(f"{name} must lie in {interval}, got {shown(value)}.")
    return result


def integer(
    name: str, value: Any, *, at_least: int, at_most: int | None = sys.maxsize
) -> int:
    """Return `value` as an int of at least `at_least`.

    Args:
        name: what the number is called in the error message.
        value: the candidate.
        at_least: the smallest that is allowed.
        at_most: the largest; by default what an int64 holds, because arrays and
            kernels take no more. None sets no limit, as for seeds.

    Raises:
        TypeError: `value` is not an integer.
        ValueError: `value` is too small or too large.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(
            f"{name} must be an integer, got {shown(value)} of type "
            f"{type(value).__name__}."
        )
    if value < at_least:
        raise ValueError(
            f"{name} must be at least {at_least}, got {shown(int(value))}."
        )
    if at_most is not None and int(value) > at_most:
        raise ValueError(f"{name} must be at most {at_most}, got {shown(int(value))}.")
    return int(value)


def seed(value: Any, name: str = "seed") -> int | None:
    """Return a seed as an int, Python's or NumPy's; None stays None.

    Raises:
        TypeError: it is not an integer.
        ValueError: it is negative.
    """
    return None if value is None else integer(name, value, at_least=0, at_most=None)


def boolean(name: str, value: Any) -> bool:
    """Return a switch as a bool, Python's or NumPy's.

    Anything else would be true or false as well, such as the text "no".

    Raises:
        TypeError: it is not True or False.
    """
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} must be True or False, got {shown(value)}.")
    return bool(value)


def real_array(
    name: str,
    values: Any,
    *,
    ndim: int | None = None,
    finite: bool = True,
    boolean: bool = False,
) -> NDArray[np.float64]:
    """Return `values` as a new float64 array that is not empty.

    Strings, complex numbers, ragged lists and arrays with masked entries are rejected,
    not converted.

    Args:
        name: what the array is called in the error message.
        values: the candidate.
        ndim: how many axes it must have; None allows any number.
        finite: refuse NaN and infinity.
        boolean: accept True and False as 1 and 0.

    Raises:
        ValueError: `values` are not such an array.
    """
    array = as_array(values)
    if array is not None:
        # For the copy and for looking at each entry; a view may stand for far more.
        check_memory(f"the numbers of {name}", 9 * array.size, "pass fewer")
    valid = (
        array is not None
        and array.dtype.kind in ("iufb" if boolean else "iuf")
        and array.size > 0
        and ndim in (None, array.ndim)
    )
    converted = float64(array) if array is not None and valid else None
    if converted is None or (finite and not np.isfinite(converted).all()):
        kind = "an array" if ndim is None else f"an array of {ndim} axes"
        numbers = "finite real numbers" if finite else "real numbers"
        raise ValueError(f"{name} must be {kind} of {numbers}, got {shown(values)}.")
    return np.array(converted)


def float64(array: NDArray[Any]) -> NDArray[np.float64]:
    """Return real numbers as kernels take them, not copied if they are so already.

    Args:
        array: of booleans, integers or floats, in any order and any format. What a
            float64 cannot hold, as a `longdouble` can, becomes infinite.

    Returns:
        A plain array in C order, of float64 in the byte order of the machine.
    """
    # NumPy has one object for this type in the byte order of the machine, and comparing
    # objects takes a third of the time of comparing types; `np.require` takes ten times
    # as long, and gives back what passes through here.
    if type(array) is np.ndarray and array.dtype is _FLOAT64:
        flags = array.flags
        if flags.carray or (flags.c_contiguous and flags.aligned):
            return array
    with np.errstate(over="ignore"):
        return np.require(np.asarray(array), np.float64, ("C", "A"))


def check_square(name: str, shape: tuple[int, ...], rows: str = "row") -> None:
    """Check that an array is a square matrix.

    Args:
        name: what the array is called in the error message.
        shape: of the array.
        rows: what has a row and a column each, such as "city".

    Raises:
        ValueError: it has another shape, or no row.
    """
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] == 0:
        raise ValueError(
            f"{name} must be a square matrix, a row and a column for each {rows}, got "
            f"shape {shape}."
        )


def as_array(values: Any) -> NDArray[Any] | None:
    """Return `values` as an array; None if they are ragged or have masked entries."""
    try:
        if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
            return None
        return np.asarray(values)
    except (TypeError, ValueError, OverflowError):
        return None


def elements(values: Any) -> list[Any] | None:
    """Return the elements of a sequence, set or array; None for anything else.

    Strings are no sequences here, and neither is what has more than a million elements,
    such as a generator without end.
    """
    if isinstance(values, str | bytes):
        return None
    try:
        found = list(itertools.islice(iter(values), _MOST_ELEMENTS + 1))
    except TypeError:
        return None
    return found if len(found) <= _MOST_ELEMENTS else None


def path(name: str, value: Any) -> Path:
    """Return the path of a file or folder.

    Raises:
        TypeError: `value` is neither text nor a path.
        ValueError: `value` is empty or holds a NUL, which no name does.
    """
    try:
        text = os.fsdecode(value)
    except TypeError:
        raise TypeError(
            f"{name} must be a path, text or pathlib.Path, got {shown(value)} of type "
            f"{type(value).__name__}."
        ) from None
    if not text or "\0" in text:
        raise ValueError(f"{name} must be the name of a file, got {shown(value)}.")
    return Path(text)


def file_path(name: str, value: Any) -> Path:
    """Return the path of a file: one that ends in a name, as `.`, `..` and `/` do not.

    Raises:
        TypeError: `value` is neither text nor a path.
        ValueError: `value` has no name at its end, or holds a NUL.
    """
    checked = path(name, value)
    if checked.name in ("", ".."):
        raise ValueError(
            f"{name} must be the name of a file, got the folder {shown(value)}; add a "
            "name to it."
        )
    return checked


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view of `array` that cannot be written to."""
    view = array.view()
    view.setflags(write=False)  # half as slow as through `flags`
    return view


def shown(value: Any) -> str:
    """Return what a message shows of a value: its repr, on one line and shortened.

    Works for any value: one whose repr fails is described by its type.
    """
    try:
        text = repr(value)
    except Exception:
        return f"an object of type {type(value).__name__}"
    if "\n" in text:  # as of arrays
        text = " ".join(text.split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def check_memory(what: str, n_bytes: int, remedy: str) -> None:
    """Refuse to reserve more memory than the machine has, before anything is reserved.

    Args:
        what: what the memory is for, in the plural, such as "solutions of 10 ants".
        n_bytes: how much they need.
        remedy: what to do about it, an imperative.

    Raises:
        ValueError: it is more than the machine has.
    """
    most = _memory_of_the_machine()
    if n_bytes > most:
        raise ValueError(
            f"{what} must fit into {most:,} bytes of memory, but need {n_bytes:,} "
            f"bytes; {remedy}."
        )


def _memory_of_the_machine() -> int:
    """Bytes of physical memory; where they are unknown, more than any machine has."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # pragma: no cover - not on Linux
        return 2**48


def one_of(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return `value` if it is one of the `allowed` strings.

    Raises:
        ValueError: it is not; the message suggests the most similar one, if any, and
            then does not list the others where they are many.
    """
    if not isinstance(value, str) or value not in allowed:
        choices = ", ".join(repr(choice) for choice in allowed)
        message = f"{name} must be one of {choices}, got {shown(value)}."
        if question := did_you_mean(value, allowed):
            if len(allowed) > _MANY:
                message = (
                    f"{name} must be one of {len(allowed)} names, got {shown(value)}."
                )
            message += question
        raise ValueError(message)
    return str(value)


def did_you_mean(name: Any, known: Iterable[str]) -> str:
    """Return the question " Did you mean ...?" with the most similar name.

    Args:
        name: what was given.
        known: the names that there are.

    Returns:
        The question after a blank; "" if no name is similar, or `name` is no text.
    """
    if not isinstance(name, str):
        return ""
    similar = get_close_matches(name[:_LONGEST], list(known), 1)
    return f" Did you mean {similar[0]!r}?" if similar else ""
