"""The directive `public-names`: names of a module, in a table and then one by one.

    .. public-names:: acl_gym.export

       write_c_header
       write_numpy_file

Not a page for each name, as autosummary would make: some hundred pages that all stand in
the list beside each page would be hard to read, and take minutes to build.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterator

from docutils import nodes
from sphinx.addnodes import desc_annotation, desc_signature
from sphinx.application import Sphinx
from sphinx.ext import autosummary
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective
from sphinx.util.parsing import nested_parse_to_nodes
from sphinx.util.rst import escape
from sphinx.util.typing import ExtensionMetadata

LONGEST_VALUE = 80
"""Characters of a value that is shown."""


class PublicNames(SphinxDirective):
    """Names of the module in the argument, one a line."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """A table with the first sentence of each, then what autodoc makes of each."""
        name_of_module = self.arguments[0]
        module = importlib.import_module(name_of_module)
        names = [line.strip() for line in self.content if line.strip()]
        lines = [f".. currentmodule:: {name_of_module}", "", ".. autosummary::"]
        lines += ["   :nosignatures:", "", *(f"   {name}" for name in names), ""]
        for name in names:
            lines += description(name, getattr(module, name))
        source, line = self.get_source_info()
        found: list[nodes.Node] = nested_parse_to_nodes(
            self.state, "\n".join(lines), source=source, offset=line
        )
        return found


def description(name: str, value: object) -> list[str]:
    """The directive that documents a name, as lines of reStructuredText.

    A collection of claims or of experiments shows a table instead of its value, which
    would fill a megabyte.
    """
    records = [f"   {line}".rstrip() for line in _records(value)]
    lines = [f".. {_directive(value)}:: {name}"]
    return [*lines, *["   :no-value:" for _ in records[:1]], "", *records, ""]


def _hide_values(app: Sphinx, document: nodes.document) -> None:
    """Remove a value that is long, or that only says where an object lies in memory."""
    for signature in document.findall(desc_signature):
        for shown in list(signature.findall(desc_annotation)):
            text = shown.astext().strip()
            if text.startswith("=") and not says_something(text[1:].strip()):
                signature.remove(shown)


def says_something(value: str) -> bool:
    """Whether a value, as Python writes it, is short and is not an address."""
    return len(value) <= LONGEST_VALUE and not re.search(
        r"<\w+.* at 0x|<function", value
    )


def _directive(value: object) -> str:
    if inspect.isclass(value) and hasattr(value, "__mro__"):
        return "autoexception" if issubclass(value, BaseException) else "autoclass"
    # A compiled kernel has the function that it is made of.
    if inspect.isfunction(getattr(value, "py_func", value)):
        return "autofunction"
    return "automodule" if inspect.ismodule(value) else "autodata"


def _records(value: object) -> Iterator[str]:
    """A table of the records in a collection; nothing for any other value."""
    records = list(value.values()) if isinstance(value, dict) else value
    if not isinstance(records, list | tuple) or not records:
        return
    if not all(hasattr(one, "name") and hasattr(one, "section") for one in records):
        return
    content = "title" if hasattr(records[0], "title") else "text"
    rows = [("Name", content.capitalize(), "Section of the thesis")]
    for record in records:
        text = " ".join(getattr(record, content).split())
        rows.append((record.name, text, record.section))
    yield from [".. list-table::", "   :header-rows: 1", ""]
    for row in rows:
        for number, cell in enumerate(row):
            yield f"   {'  -' if number else '* -'} {escape(cell)}"
    yield ""


def _documentation_of_data(
    app: Sphinx, what: str, name: str, value: object, options: object, lines: list[str]
) -> None:
    """The text below a constant is in the module that defines it, not where it is public.

    Without it, autodoc shows the documentation of `dict` for a dictionary.
    """
    if what != "data":
        return
    package, _, own = name.rpartition(".")
    for other in sorted(name for name in sys.modules if name.startswith(package)):
        if getattr(sys.modules[other], own, None) is value:
            found = ModuleAnalyzer.for_module(other).find_attr_docs().get(("", own))
            if found:
                lines[:] = found
                return
    lines.clear()


def setup(app: Sphinx) -> ExtensionMetadata:
    """Register the directive."""
    # Or the sentence in the table would end at "eq. (3.28)".
    autosummary.WELL_KNOWN_ABBREVIATIONS = (
        *autosummary.WELL_KNOWN_ABBREVIATIONS,
        "eq.",
    )
    app.add_directive("public-names", PublicNames)
    app.connect("autodoc-process-docstring", _documentation_of_data, priority=50)
    app.connect("doctree-read", _hide_values)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
