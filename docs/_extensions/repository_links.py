"""Links to files that are not pages of the site lead to the repository.

Pages are read in the repository too, where `../README.md` is the right address. On the
site such a file is no page, so the link is given the address of the repository.
"""

from __future__ import annotations

import os
import re
from pathlib import Path, PurePosixPath

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

LINK = re.compile(r"(?<=\]\()(?P<path>[^():#\s]+)(?P<anchor>#[^)\s]*)?(?=\))")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Change links when a page is read."""
    app.add_config_value("repository_url", "", "env")
    app.connect("source-read", _change_links)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _change_links(app: Sphinx, page: str, source: list[str]) -> None:
    docs = Path(app.srcdir)
    folder = (docs / page).parent
    target_root = f"{app.config.repository_url}/blob/main"

    def changed(link: re.Match[str]) -> str:
        target = Path(os.path.normpath(folder / link["path"]))
        if target.is_relative_to(docs) or not target.exists():
            return link[0]  # a page, or a mistake, of which Sphinx tells
        path = PurePosixPath(target.relative_to(docs.parent).as_posix())
        return f"{target_root}/{path}{link['anchor'] or ''}"

    source[0] = LINK.sub(changed, source[0])
