"""Guides are notebooks: pages whose cells run when the site is built.

A page is a guide if its head says `file_format: mystnb`. MyST-NB runs it and keeps the
outputs in a cache, which is asked for by the text of the cells alone. What the cells
print depends on the package too, so the cache here belongs to one state of the package.

A cell that draws says what its picture shows, in its options:
`:mystnb: {"image": {"alt": "..."}}`.

Each guide begins with a link to its notebook, and that notebook has links to the site.
"""

from __future__ import annotations

import hashlib
import html
import json
import os
import posixpath
import re
import shutil
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.util.typing import ExtensionMetadata

HEAD = re.compile(r"\A---\n(?:.*\n)*?file_format: mystnb\n(?:.*\n)*?---\n")
TITLE = re.compile(r"^# .*\n", re.MULTILINE)
PAGE_LINK = re.compile(r"(?<=\]\()(?P<path>[^():#\s]+)\.md(?P<anchor>#[^)\s]*)?(?=\))")
DOWNLOAD = "{{nb-download}}`Download this guide as a notebook <{name}.ipynb>`\n"
DOWNLOAD_CELL = re.compile(r"\{nb-download\}`[^`]*`\n*")

# What a kernel says about itself and about this machine is no part of a page.
KERNEL = """\
c = get_config()
c.IPKernelApp.log_level = "ERROR"
c.InteractiveShellApp.exec_lines = [
    "import logging",
    "logging.getLogger('acl_gym').setLevel('ERROR')  # kernels are compiled",
    "del logging",
]
"""


def setup(app: Sphinx) -> ExtensionMetadata:
    """Prepare the kernel and its cache; describe pictures; put links into pages."""
    app.connect("config-inited", _prepare_kernel)
    app.connect("source-read", _add_download)
    app.connect("doctree-read", _describe_pictures)
    app.connect("build-finished", _link_to_site)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def is_guide(text: str) -> bool:
    """Whether a page is a notebook."""
    return HEAD.match(text) is not None


def package_digest(package: Path) -> str:
    """A name for the state of a package: it changes with each of its files."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _prepare_kernel(app: Sphinx, config: Config) -> None:
    docs = Path(app.srcdir)
    caches = docs / "_build" / "notebooks"
    cache = caches / package_digest(docs.parent / "acl_gym")
    for outdated in set(caches.glob("*")) - {cache}:
        shutil.rmtree(outdated)
    config.nb_execution_cache_path = str(cache)
    profile = docs / "_build" / "ipython" / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.py").write_text(KERNEL, encoding="utf-8")
    os.environ["IPYTHONDIR"] = str(profile.parent)  # and not that of who builds
    # The cells import the package that the pages are about, wherever another one is
    # installed.
    paths = [str(docs.parent), os.environ.get("PYTHONPATH", "")]
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))


def _add_download(app: Sphinx, page: str, source: list[str]) -> None:
    if is_guide(source[0]):
        link = DOWNLOAD.format(name=posixpath.basename(page))
        source[0] = TITLE.sub(lambda title: f"{title[0]}\n{link}", source[0], count=1)


def _describe_pictures(app: Sphinx, document: nodes.document) -> None:
    """MyST-NB gives an alt text to PNG outputs; those in HTML outputs get it here."""
    for cell in document.findall(nodes.container):
        options = cell.get("cell_metadata", {}).get("mystnb", {})
        alt = html.escape(options.get("image", {}).get("alt", ""))
        for output in cell.findall(nodes.raw) if alt else ():
            before, tag, after = output.astext().partition('<img alt="')
            rest = after.partition('"')[2]
            if tag:
                output.children = [nodes.Text(f'{before}{tag}{alt}"{rest}')]


def _link_to_site(app: Sphinx, error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    for page in app.env.found_docs:
        if posixpath.dirname(page) != "guides":
            continue  # another page may have the name of a guide
        name = posixpath.basename(page)
        for path in Path(app.outdir, "_downloads").glob(f"*/{name}.ipynb"):
            notebook = json.loads(path.read_text(encoding="utf-8"))
            for cell in notebook["cells"]:
                if cell["cell_type"] == "markdown":
                    text = "".join(cell["source"])
                    cell["source"] = link_to_site(text, page, app.config.html_baseurl)
            path.write_text(json.dumps(notebook, indent=1), encoding="utf-8")


def link_to_site(text: str, page: str, site: str) -> str:
    """The text of a page as it stands in a notebook away from the site.

    Args:
        text: Markdown, with links to other pages as paths to their files.
        page: the name of the page, such as `guides/first-colony`.
        site: the address of the site, with a slash at its end.
    """

    def absolute(link: re.Match[str]) -> str:
        target = posixpath.normpath(
            posixpath.join(posixpath.dirname(page), link["path"])
        )
        return f"{site}{target}.html{link['anchor'] or ''}"

    return PAGE_LINK.sub(absolute, DOWNLOAD_CELL.sub("", text))
