"""Small pictures and tables for notebooks, without a plotting library."""

from __future__ import annotations

import base64
import functools
import html
import struct
import zlib
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#F0E442"),
    *("#CC79A7", "#56B4E9", "#E69F00", "#000000"),
)
"""Of Okabe and Ito, which people who are colour-blind can tell apart."""

_BLUE, _GREY, _ORANGE = (
    np.array([0, 114, 178]),
    np.array([232, 232, 232]),
    np.array([213, 94, 0]),
)
_CIRCLE = np.array([[213, 94, 0], [240, 228, 66], [0, 114, 178], [204, 121, 167]])
"""East, north, west, south."""
_SEQUENCE = np.array([[0, 32, 77], [87, 93, 109], [165, 156, 116], [255, 234, 70]])


def action_colours(count: int, values: Sequence[float] | None = None) -> list[str]:
    """A colour for each action, as "#RRGGBB".

    Args:
        count: how many actions there are.
        values: their physical values, if they are numbers on one scale: from blue for
            the lowest over grey for 0 to orange for the highest.
    """
    if values is not None:
        scaled = np.asarray(values, dtype=np.float64)
        shares = scaled / (np.abs(scaled).max() or 1.0)
        if not scaled.min() < 0.0 < scaled.max():
            ranks = np.unique(scaled, return_inverse=True)[1]
            shares = 2.0 * ranks / max(ranks.max(), 1) - 1.0
        ends = np.where(shares[:, None] > 0, _ORANGE, _BLUE)
        return _written(_GREY + np.abs(shares[:, None]) * (ends - _GREY))
    if count <= len(COLOURS):
        return list(COLOURS[:count])
    places = np.linspace(0.0, len(_SEQUENCE) - 1.0, count)
    return _written(_between(places, _SEQUENCE))


def direction_colours(vectors: NDArray[Any]) -> list[str]:
    """A colour for the direction of each vector `(n, 2)`; grey for those of no length."""
    angle = np.arctan2(vectors[:, 1], vectors[:, 0]) / (2 * np.pi)
    colours = _between((angle % 1.0) * len(_CIRCLE), [*_CIRCLE, _CIRCLE[0]])
    still = np.asarray(np.abs(vectors).sum(axis=1) == 0.0)
    return _written(np.where(still.reshape(-1, 1), _GREY, colours))


def _between(places: NDArray[Any], colours: Any) -> NDArray[Any]:
    """Mixtures of neighbouring colours at places on the way along them."""
    known = np.arange(len(colours))
    return np.stack(
        [np.interp(places, known, channel) for channel in np.transpose(colours)], axis=1
    )


def _written(colours: NDArray[Any]) -> list[str]:
    return ["#{:02X}{:02X}{:02X}".format(*c) for c in np.rint(colours).astype(int)]


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of "#RRGGBB", each 0..255."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


def png(pixels: NDArray[Any]) -> bytes:
    """A PNG file of pixels `(height, width, 3)`, uint8."""
    height, width, _ = pixels.shape
    # Each row begins with the number of its filter: none.
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 1:] = pixels.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = (
        (b"IHDR", header),
        (b"IDAT", zlib.compress(rows.tobytes(), 9)),
        (b"IEND", b""),
    )
    chunks = (
        struct.pack(">I", len(data))
        + kind
        + data
        + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def inline_png(data: bytes, alt: str, style: str = "max-width:100%") -> str:
    """A PNG file as an element of a page."""
    encoded = base64.b64encode(data).decode("ascii")
    return (
        f'<img alt="{html.escape(alt)}" style="{html.escape(style)}" '
        f'src="data:image/png;base64,{encoded}">'
    )


class Markup(str):
    """A text that is HTML already."""

    __slots__ = ()


def guarded(page: Callable[[Any], str]) -> Callable[[Any], str]:
    """Let a `_repr_html_` show the plain `repr` instead of raising."""

    @functools.wraps(page)
    def safe(thing: Any) -> str:
        try:
            return page(thing)
        except Exception:  # a notebook must be able to show what is broken
            return f"<pre>{html.escape(repr(thing))}</pre>"

    return safe


def table(rows: Iterable[Sequence[Any]], heads: Sequence[str] = ()) -> str:
    """A table of texts, all escaped; the first of a row names it."""

    def line(cells: Sequence[Any], kind: str) -> str:
        style = "text-align:left;padding:1px 12px 1px 0;vertical-align:top"
        inside = (
            f'<{kind} style="{style}">{_escaped(cell)}</{kind}>' for cell in cells
        )
        return f"<tr>{''.join(inside)}</tr>"

    head = f"<thead>{line(heads, 'th')}</thead>" if heads else ""
    body = "".join(line(row, "td") for row in rows)
    return (
        '<table style="border-collapse:collapse;margin:0;font-size:90%">'
        f"{head}<tbody>{body}</tbody></table>"
    )


def _escaped(cell: Any) -> str:
    return cell if isinstance(cell, Markup) else html.escape(str(cell))
