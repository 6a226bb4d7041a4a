"""A reader for files of TSPLIB: instances, symmetric and asymmetric, and tours.

The format is described in G. Reinelt, "TSPLIB 95", Universität Heidelberg. This reader
takes problems of TYPE TSP and ATSP with coordinates in the plane or on the earth (EUC_2D,
CEIL_2D, ATT, GEO) or with a matrix (EXPLICIT), full or triangular, and files of TYPE
TOUR. A file is text that is never run; what a matrix needs is known before memory is
reserved for it.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.graph.cities import (
    TravellingSalesmanInstance,
    check_size,
)
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_METRICS = {"EUC_2D": "euc_2d", "CEIL_2D": "ceil_2d", "ATT": "att", "GEO": "geo"}

# Format -> (upper triangle, with the diagonal). Columns of a triangle of a symmetric
# matrix are rows of the other.
_TRIANGLES = {
    "UPPER_ROW": (True, False),
    "UPPER_DIAG_ROW": (True, True),
    "LOWER_ROW": (False, False),
    "LOWER_DIAG_ROW": (False, True),
    "UPPER_COL": (False, False),
    "UPPER_DIAG_COL": (False, True),
    "LOWER_COL": (True, False),
    "LOWER_DIAG_COL": (True, True),
}

_SECTIONS = (
    "NODE_COORD_SECTION",
    "EDGE_WEIGHT_SECTION",
    "DISPLAY_DATA_SECTION",
    "TOUR_SECTION",
)
_HEADER = re.compile(r"([A-Z_0-9]+)\s*:(.*)")
_KEYWORD = re.compile(r"[A-Z]")
_LARGEST = 2**33
"""Bytes of a file at most: a full matrix of 30,000 cities with nine digits each."""


class _FormatError(ValueError):
    """A text is not of TSPLIB's format; the message names the text."""


@dataclass(frozen=True)
class _File:
    """What stands in a file.

    Attributes:
        source: what messages call it.
        header: keyword -> text.
        sections: keyword -> the words below it.
    """

    source: str
    header: dict[str, str]
    sections: dict[str, list[str]]

    def error(self, message: str) -> _FormatError:
        return _FormatError(f"{self.source}: {message}")

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """The entry of the header, if it is one of the choices.

        TSPLIB writes remarks behind some, which do not count.
        """
        text = self._entry(key, f"one of {', '.join(choices)}")
        found = (text.split() or [""])[0]
        if found not in choices:
            raise self.error(
                f"{key} must be one of {', '.join(choices)}, got "
                f"{validation.shown(text)}; this reader knows no others."
            )
        return found

    def _entry(self, key: str, what: str) -> str:
        """An entry that the header must have."""
        text = self.header.get(key)
        if text is None:
            raise self.error(
                f"there must be a line {key} : followed by {what}, but there is none; "
                "check that it is a complete file of TSPLIB."
            )
        return text

    def dimension(self) -> int:
        """The number of cities."""
        text = self._entry("DIMENSION", "the number of cities")
        if not re.fullmatch(r"[0-9]{1,18}", text):
            raise self.error(
                "DIMENSION must be the number of cities, got "
                f"{validation.shown(text)}; check the header."
            )
        try:
            check_size(int(text))
        except ValueError as error:
            raise self.error(f"DIMENSION: {error}") from None
        return int(text)

    def numbers(self, section: str, count: int) -> FloatArray:
        """The numbers of a section, float64 `(count,)`."""
        words = self.sections.get(section)
        if words is None:
            raise self.error(f"there must be a {section}, but there is none.")
        if len(words) != count:
            raise self.error(
                f"{section} must hold {count:,} numbers, got {len(words):,}; check "
                "DIMENSION and that the file is complete."
            )
        values = np.empty(count)
        for i, word in enumerate(words):
            try:
                # Python takes 1_000 for a number as well.
                values[i] = float("_" if "_" in word else word)
            except ValueError:
                raise self.error(
                    f"{section} must hold numbers, got {validation.shown(word)}."
                ) from None
        return values


def read_tsplib(
    path: str | os.PathLike[str], *, optimum: float | None = None
) -> TravellingSalesmanInstance:
    """Read an instance from a file of TSPLIB, `.tsp` or `.atsp`.

    Args:
        path: of the file.
        optimum: the length of a shortest tour, if known; files do not hold it.

    Returns:
        The instance, whose name is that in the file. Coordinates are those of the cities
        or, with a matrix, those of the file's DISPLAY_DATA_SECTION if there is one.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a file of TSPLIB that this reader knows, see `tsplib`.
    """
    return parse_tsplib(*_read(path), optimum=optimum)


def read_tour(path: str | os.PathLike[str]) -> NDArray[np.int32]:
    """Read a tour from a file of TSPLIB, `.tour`.

    Args:
        path: of the file.

    Returns:
        The cities in their order, numbered from 0, int32 `(n,)`.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a tour, which visits each city once.
    """
    return parse_tour(*_read(path))


def parse_tsplib(
    text: str, source: str = "TSPLIB text", *, optimum: float | None = None
) -> TravellingSalesmanInstance:
    """Return the instance that a text in TSPLIB's format describes.

    Args:
        text: what would stand in the file.
        source: what messages call it.
        optimum: the length of a shortest tour, if known.

    Raises:
        TypeError: it is no text.
        ValueError: it is not of TSPLIB's format, see `tsplib`.
    """
    file = _parsed(text, source)
    kind = file.choice("TYPE", ("TSP", "ATSP"))
    n = file.dimension()
    weights = file.choice("EDGE_WEIGHT_TYPE", (*_METRICS, "EXPLICIT"))
    named: dict[str, Any] = {
        "name": file.header.get("NAME") or "TSPLIB",
        "optimum": optimum,
    }
    if "FIXED_EDGES_SECTION" in file.sections:
        raise file.error("fixed edges are not supported; remove FIXED_EDGES_SECTION.")
    try:
        if weights != "EXPLICIT":
            metric = _METRICS[weights]
            places = _places(file, "NODE_COORD_SECTION", n)
            return TravellingSalesmanInstance.from_coordinates(places, metric, **named)
        form = file.choice("EDGE_WEIGHT_FORMAT", ("FULL_MATRIX", *_TRIANGLES))
        matrix = _matrix(file, form, n)
        shown = [
            _places(file, section, n)
            for section in ("DISPLAY_DATA_SECTION", "NODE_COORD_SECTION")
            if section in file.sections
        ]
        found = TravellingSalesmanInstance.from_distances(
            matrix, coordinates=shown[0] if shown else None, **named
        )
    except _FormatError:
        raise
    except ValueError as error:  # of the numbers, which say nothing of the file
        raise file.error(str(error)) from None
    if kind == "TSP" and not found.symmetric:
        raise file.error(
            "the matrix of TYPE TSP must be symmetric, but is not; set TYPE to ATSP."
        )
    return found


def parse_tour(text: str, source: str = "TSPLIB text") -> NDArray[np.int32]:
    """Return the tour that a text in TSPLIB's format describes; see `read_tour`.

    Raises:
        TypeError: it is no text.
        ValueError: it is not of that format.
    """
    file = _parsed(text, source)
    file.choice("TYPE", ("TOUR",))
    n = file.dimension()
    words = file.sections.get("TOUR_SECTION", [])
    if "-1" in words:  # ends the tour
        file.sections["TOUR_SECTION"] = words[: words.index("-1")]
    cities = file.numbers("TOUR_SECTION", n)
    return _order(file, "TOUR_SECTION", cities).astype(np.int32)


def _order(file: _File, section: str, numbers: FloatArray) -> NDArray[np.int64]:
    """Numbers 1..n of cities, each once, as 0..n - 1."""
    whole = np.isfinite(numbers) & (numbers == np.floor(numbers))
    inside = whole & (numbers >= 1) & (numbers <= numbers.size)
    order = np.where(inside, numbers, 0).astype(np.int64) - 1
    if not inside.all() or (np.bincount(order, minlength=numbers.size) != 1).any():
        raise file.error(
            f"{section} must number the cities 1 to {numbers.size}, each once."
        )
    return order


def _places(file: _File, section: str, n_cities: int) -> FloatArray:
    """The coordinates of a section, whose rows are a number, x and y, `(n, 2)`."""
    rows = file.numbers(section, 3 * n_cities).reshape(n_cities, 3)
    places = np.empty((n_cities, 2))
    places[_order(file, section, rows[:, 0])] = rows[:, 1:]
    bad = ~np.isfinite(places).all(axis=1)
    if bad.any():
        city = int(np.argmax(bad))
        raise file.error(
            f"{section} must hold finite numbers, got {places[city].tolist()} for city "
            f"{city + 1}."
        )
    return places


def _matrix(file: _File, form: str, n_cities: int) -> FloatArray:
    """The distances of a file with a matrix, `(n, n)`."""
    section = "EDGE_WEIGHT_SECTION"
    if form == "FULL_MATRIX":
        return file.numbers(section, n_cities**2).reshape(n_cities, n_cities)
    upper, diagonal = _TRIANGLES[form]
    offset = 0 if diagonal else 1
    count = n_cities * (n_cities + 1) // 2 - offset * n_cities
    numbers = file.numbers(section, count)
    matrix = np.zeros((n_cities, n_cities))
    if upper:
        matrix[np.triu_indices(n_cities, offset)] = numbers
    else:
        matrix[np.tril_indices(n_cities, -offset)] = numbers
    np.fill_diagonal(matrix, 0.0)  # it does not count, and twice as much may overflow
    return matrix + matrix.T


def _read(path: str | os.PathLike[str]) -> tuple[str, str]:
    """The text of a file, and its name for messages."""
    checked = validation.file_path("path", path)
    try:
        return _text_of(checked), checked.name
    except OSError as error:
        # Of the same class, so that a missing file is still a FileNotFoundError.
        raise type(error)(
            f"path must be a file of TSPLIB that can be read, got "
            f"{validation.shown(str(path))} ({error.strerror or error}); check the name, "
            f"which is looked for from {os.getcwd()}, and the permissions."
        ) from None


def _text_of(checked: Path) -> str:
    # Devices and pipes may have no end, and large files cannot be meant.
    size = checked.stat().st_size
    if not checked.is_file():
        raise ValueError(f"path must be a file, got {validation.shown(str(checked))}.")
    if size > _LARGEST:
        raise ValueError(
            f"{checked.name}: the file must have at most {_LARGEST:,} bytes, got "
            f"{size:,}."
        )
    # Words of text take about twenty times as much memory as in the file.
    validation.check_memory(
        f"the words of {checked.name}", 20 * size, "take fewer cities"
    )
    return checked.read_bytes().decode("utf-8", errors="replace")


def _parsed(text: str, source: str) -> _File:
    """Divide a text into its header and sections.

    Raises:
        TypeError: it is no text.
        ValueError: it is not of TSPLIB's format.
    """
    if not isinstance(text, str):
        raise TypeError(
            f"text must be what stands in a file of TSPLIB, got {validation.shown(text)} of "
            f"type {type(text).__name__}; read a file with read_tsplib or read_tour."
        )
    file = _File(source, {}, {})
    words: list[str] | None = None  # of the section that is being read
    # Editors may put a byte-order mark before the first line.
    lines = text.removeprefix("\ufeff").splitlines()
    for number, line in enumerate(lines, start=1):
        line = line.strip()
        if line == "EOF":
            break
        if not line:
            continue
        section = line.rstrip(" \t:")
        if section.endswith("_SECTION"):
            if section in file.sections:
                raise file.error(f"line {number}: there is a second {section}.")
            if section not in (*_SECTIONS, "FIXED_EDGES_SECTION"):
                raise file.error(
                    f"line {number}: {validation.shown(section)} must be one of "
                    f"{', '.join(_SECTIONS)}; this reader knows no others."
                )
            words = file.sections[section] = []
        elif words is not None and not (
            _KEYWORD.match(line) and _HEADER.fullmatch(line)
        ):
            words.extend(line.split())
        elif match := _HEADER.fullmatch(line):
            key, value = match[1], match[2].strip()
            if key in file.header and key != "COMMENT":
                raise file.error(f"line {number}: there is a second {key}.")
            file.header[key] = value
            words = None
        else:
            raise file.error(
                f"line {number} must be KEYWORD : value, got {validation.shown(line)}; "
                "check that it is a file of TSPLIB."
            )
    return file
