"""Links from a page to a picture file open the picture, in place of a download."""

from __future__ import annotations

import posixpath
from pathlib import PurePosixPath
from urllib.parse import quote

from docutils import nodes
from sphinx.addnodes import download_reference
from sphinx.application import Sphinx
from sphinx.util.osutil import relative_uri
from sphinx.util.typing import ExtensionMetadata

PICTURES = (".gif", ".png", ".svg")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Change the links when the address of each file is known."""
    app.connect("doctree-resolved", _open_pictures)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _open_pictures(app: Sphinx, document: nodes.document, page: str) -> None:
    if app.builder.format != "html":
        return
    downloads = relative_uri(app.builder.get_target_uri(page), "_downloads")
    for link in list(document.findall(download_reference)):
        name = link.get("filename", "")
        if PurePosixPath(name).suffix in PICTURES:
            address = posixpath.join(downloads, quote(name))
            reference = nodes.reference("", "", refuri=address, internal=True)
            reference += [text.deepcopy() for text in link.children]
            link.replace_self(reference)
