"""Tables that hold text are marked, so that narrow screens can stack their cells.

A table of figures keeps its columns, and scrolls in a box where it is too wide; its
short cells are not broken, since a break after the hyphen of 1e-16 misleads. A
table of text is easier to read one cell below the other. `_static/site.css` and
`_static/wide.js` do both.
"""

from __future__ import annotations

from statistics import median

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

LONG = 40
"""Characters of a cell that is text."""
MOST_COLUMNS = 5
CLASS = "text-table"

SHORT = 28
"""Characters of a figure and its interval, at most."""


def setup(app: Sphinx) -> ExtensionMetadata:
    """Mark tables when a page has been read; load the script on each page."""
    app.connect("doctree-read", _mark)
    app.add_js_file("wide.js", loading_method="defer")
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _mark(app: Sphinx, document: nodes.document) -> None:
    for table in document.findall(nodes.table):
        if holds_text(table) or not _heads(table):
            table["classes"].append(CLASS)
            for cell in table.findall(nodes.entry):
                if not _length(cell):
                    cell["classes"].append("empty")
        else:
            for body in table.findall(nodes.tbody):
                for cell in body.findall(nodes.entry):
                    if _length(cell) <= SHORT:
                        cell["classes"].append("short")


def holds_text(table: nodes.table) -> bool:
    """Whether one of at most five columns mostly has cells with a sentence or a picture."""
    rows = [
        [cell for cell in row.children if isinstance(cell, nodes.entry)]
        for body in table.findall(nodes.tbody)
        for row in body.findall(nodes.row)
    ]
    if any("morecols" in cell or "morerows" in cell for row in rows for cell in row):
        return False
    columns = list(zip(*rows, strict=False))
    return 2 <= len(columns) <= MOST_COLUMNS and any(
        median(map(_length, column)) >= LONG for column in columns
    )


def _heads(table: nodes.table) -> str:
    """The text of the headings; there is none where the first column names the rows."""
    return "".join(head.astext() for head in table.findall(nodes.thead)).strip()


def _length(cell: nodes.entry) -> int:
    return LONG if next(cell.findall(nodes.image), None) else len(cell.astext().strip())
