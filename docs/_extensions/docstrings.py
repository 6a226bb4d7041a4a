"""Docstrings, which have the marks of Markdown, in the form that autodoc reads.

The docstrings of this package are read in editors and by `help()`. They hold plain text,
code in single backquotes, lists and examples, which Markdown and reStructuredText write
alike. What differs is translated here: headings, tables and blocks of code; and the signs
that have a meaning in reStructuredText alone, such as the bars of |x|, are protected.
The file of a page, such as docs/design.md, becomes a link to that page.
Napoleon then translates the sections of Google's style (Args, Returns, Raises).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sphinx.application import Sphinx
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.util.typing import ExtensionMetadata

CODE = re.compile(r"(``.*?``|`[^`]*`_*)", re.DOTALL)
PAGE = re.compile(r"\bdocs/([\w/-]+)\.md\b")
SPECIAL = re.compile(r"\*(?=\S)|\||(?<=\w)_(?!\w)")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Translate each docstring, and leave out what a class only inherits from tuple."""
    app.connect("autodoc-process-docstring", _translate)
    app.connect("autodoc-skip-member", _skip)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _translate(
    app: Sphinx, what: str, name: str, obj: object, options: Any, lines: list[str]
) -> None:
    if what == "class" and any(line == "## Action Space" for line in lines):
        lines[:] = _summary_of_environment(app, name, lines)
    # Of an attribute, napoleon would take what stands before a colon for its type; the
    # annotation has that.
    kind = "object" if what in ("attribute", "data", "property") else what
    text = list(to_restructuredtext(lines))
    lines[:] = GoogleDocstring(text, app.config, app, kind, name, obj, options).lines()


def _summary_of_environment(app: Sphinx, name: str, lines: list[str]) -> list[str]:
    """Up to the first heading; the page of the environment has it all."""
    page = app.config.environment_pages.get(name.rpartition(".")[2])
    if page is None:
        return lines
    head = next(i for i, line in enumerate(lines) if line.startswith("## "))
    return [*lines[:head], f"See :doc:`its page </environments/generated/{page}>`.", ""]


def to_restructuredtext(lines: list[str]) -> Iterator[str]:
    """The lines of a docstring as reStructuredText."""
    text: list[str] = []
    position = 0
    while position < len(lines):
        line = lines[position]
        bare = line.strip()
        if bare.startswith("```"):
            yield from _protected(text)
            text = []
            indent = line[: len(line) - len(line.lstrip())]
            end = next(
                i for i in range(position + 1, len(lines)) if lines[i].strip() == "```"
            )
            yield from [f"{indent}.. code-block:: {bare[3:] or 'text'}", ""]
            yield from [
                "   " + inner if inner else "" for inner in lines[position + 1 : end]
            ]
            yield ""
            position = end
        elif bare.startswith(">>> "):
            yield from _protected(text)
            text = []
            while position < len(lines) and lines[position].strip():
                yield lines[position]
                position += 1
            continue
        elif re.match(r"\|.*\|$", bare):
            yield from _protected(text)
            text = []
            end = position
            while end < len(lines) and lines[end].strip().startswith("|"):
                end += 1
            yield from _table(lines[position:end])
            position = end - 1
        elif bare.startswith("## "):
            yield from _protected(text)
            text = []
            yield from [f".. rubric:: {bare[3:]}", ""]
        else:
            text.append(line)
        position += 1
    yield from _protected(text)


def _protected(text: list[str]) -> list[str]:
    """Text in which signs stand for themselves and pages are links, outside code."""
    pieces = CODE.split("\n".join(text))
    pieces[::2] = [
        PAGE.sub(r":doc:`/\1`", SPECIAL.sub(r"\\\g<0>", piece)) for piece in pieces[::2]
    ]
    return "".join(pieces).split("\n") if text else []


def _table(lines: list[str]) -> Iterator[str]:
    indent = lines[0][: len(lines[0]) - len(lines[0].lstrip())]
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines
    ]
    yield from [f"{indent}.. list-table::", f"{indent}   :header-rows: 1", ""]
    for row in [rows[0], *rows[2:]]:
        for number, cell in enumerate(row):
            mark = "* -" if number == 0 else "  -"
            yield f"{indent}   {mark} {''.join(_protected([cell]))}"
    yield ""


def _skip(
    app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: object
) -> bool | None:
    """Fields of a named tuple have no docstring of their own."""
    return True if type(obj).__name__ == "_tuplegetter" else None
