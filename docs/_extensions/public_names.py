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
import sys

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.ext import autosummary
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective
from sphinx.util.parsing import nested_parse_to_nodes
from sphinx.util.typing import ExtensionMetadata


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
            lines += [f".. {_directive(getattr(module, name))}:: {name}", ""]
        source, line = self.get_source_info()
        found: list[nodes.Node] = nested_parse_to_nodes(
            self.state, "\n".join(lines), source=source, offset=line
        )
        return found


def _directive(value: object) -> str:
    if inspect.isclass(value) and hasattr(value, "__mro__"):
        return "autoexception" if issubclass(value, BaseException) else "autoclass"
    if inspect.isfunction(value):
        return "autofunction"
    return "automodule" if inspect.ismodule(value) else "autodata"


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
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
