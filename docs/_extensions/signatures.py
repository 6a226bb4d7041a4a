"""Signatures as they are written in the source, with links to the types they name.

Autodoc shows what an annotation stands for, so that `ArrayLike` becomes a union that
takes five lines. The source says it shorter. Its names have no module, so a name that
only one public object has is looked up.
"""

from __future__ import annotations

import inspect
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.util.inspect import stringify_signature
from sphinx.util.typing import ExtensionMetadata

CALLED = ("class", "exception", "function", "method")
PUBLIC = ("class", "data", "exception", "function")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Connect what shows signatures and what finds the names in them."""
    app.connect("autodoc-process-signature", _as_written)
    app.connect("missing-reference", _by_last_name)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _as_written(
    app: Sphinx,
    what: str,
    name: str,
    value: Any,
    options: object,
    signature: str | None,
    returned: str | None,
) -> tuple[str, str | None] | None:
    if what not in CALLED or not signature:
        return None
    try:
        written = inspect.signature(value)
    except (TypeError, ValueError):  # not of Python
        return None
    parameters = list(written.parameters.values())
    if parameters and parameters[0].name in ("self", "cls"):
        parameters = parameters[1:]
    shown = written.replace(parameters=parameters)
    annotation = written.return_annotation if what in ("function", "method") else None
    return (
        stringify_signature(
            shown, show_return_annotation=False, unqualified_typehints=True
        ),
        annotation if isinstance(annotation, str) else returned,
    )


def _by_last_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, text: nodes.TextElement
) -> nodes.reference | None:
    if node.get("refdomain") != "py":
        return None
    domain = env.domains.python_domain
    found = _public(domain, node["reftarget"])
    if len(found) != 1:
        return None
    return domain.resolve_xref(
        env, node["refdoc"], app.builder, "obj", found[0], node, text
    )


def _public(domain: PythonDomain, name: str) -> list[str]:
    return [
        full
        for full, entry in domain.objects.items()
        if full.endswith(f".{name}") and not entry.aliased and entry.objtype in PUBLIC
    ]
