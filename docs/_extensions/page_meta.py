"""What search engines and chats show of a page: its first paragraph and a picture."""

from __future__ import annotations

from html import escape
from typing import Any

from docutils import nodes
from markupsafe import Markup
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

LONGEST = 200
"""Characters of a description, about what is shown of one."""


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the tags when a page is written."""
    app.add_config_value("page_picture", "", "html", str)
    app.add_config_value("page_description", "", "html", str)
    app.connect("html-page-context", _add_tags)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _add_tags(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    document: nodes.document | None,
) -> None:
    text = first_paragraph(document) if document else ""
    description = text or app.config.page_description
    tags = {
        "og:type": "website",
        "og:site_name": app.config.html_title,
        "og:title": Markup(context.get("title", "")).striptags()
        or app.config.html_title,
        "og:description": description,
        "og:url": f"{app.config.html_baseurl}{page}.html",
        "og:image": f"{app.config.html_baseurl}{app.config.page_picture}",
    }
    lines = [f'<meta name="description" content="{escape(description)}">']
    lines += [
        f'<meta property="{name}" content="{escape(text)}">'
        for name, text in tags.items()
    ]
    context["metatags"] = context.get("metatags", "") + "\n".join(lines)


def first_paragraph(document: nodes.document) -> str:
    """The first paragraph that is a sentence, cut between words where it is long."""
    for paragraph in document.findall(nodes.paragraph):
        text = " ".join(paragraph.astext().split())
        inside = (nodes.Admonition, nodes.table, nodes.list_item)
        if text.endswith((".", "?", ":")) and not isinstance(paragraph.parent, inside):
            return shortened(text)
    return ""


def shortened(text: str) -> str:
    """At most `LONGEST` characters of a text, whole words, with dots if it goes on."""
    if len(text) <= LONGEST:
        return text
    return (
        text[: LONGEST - 1].rpartition(" ")[0].rstrip(" ,;:")
        + "\N{HORIZONTAL ELLIPSIS}"
    )
