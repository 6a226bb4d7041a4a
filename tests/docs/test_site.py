"""The documentation site: what it holds, that it builds, and that it needs no network."""

from __future__ import annotations

import functools
import http.server
import importlib
import os
import pkgutil
import re
import subprocess
import sys
import threading
import types
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import acl_gym
from acl_gym.cli.envs import parameters
from acl_gym.envs import ENVIRONMENTS
from tests.browser import chromium, needs_chromium, new_tab

DOCS = Path(__file__).resolve().parents[2] / "docs"
GENERATED = DOCS / "environments" / "generated"
SENTENCE = "A sentence that is long enough to be text."
MODULES = ("acl_gym.costs", "acl_gym.deposits", "acl_gym.schedules")

pytestmark = pytest.mark.skipif(
    not (DOCS / "conf.py").exists(), reason="a source distribution has no documentation"
)


def extension(name: str) -> ModuleType:
    """One of the extensions of Sphinx in docs/_extensions."""
    pytest.importorskip("sphinx")
    path = DOCS / "_extensions" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pages() -> Iterator[Path]:
    """All pages that are written by hand."""
    for path in DOCS.rglob("*.md"):
        if not {"_build", "generated"} & set(path.parts):
            yield path


def public_names() -> dict[int, str]:
    """What packages export, by identity: one of the names under which it is public."""
    packages = [
        found.name
        for found in pkgutil.walk_packages(acl_gym.__path__, "acl_gym.")
        if found.ispkg
    ]
    return {
        id(getattr(module, name)): f"{module.__name__}.{name}"
        for module in map(importlib.import_module, ["acl_gym", *packages, *MODULES])
        for name in getattr(module, "__all__", ())
        if name != "__version__"
    }


def documented_names() -> Iterator[tuple[str, Any]]:
    """The names in the reference, and what they stand for."""
    for path in (DOCS / "reference").glob("*.md"):
        text = path.read_text(encoding="utf-8")
        for block in re.findall(r"public-names:: ([\w.]+)\n((?:\n|   .*\n)*)", text):
            module = importlib.import_module(block[0])
            for name in block[1].split():
                yield f"{block[0]}.{name}", getattr(module, name)
        for name in re.findall(r"\.\. module:: ([\w.]+)", text):
            yield name, importlib.import_module(name)


def test_every_public_name_is_in_the_reference() -> None:
    documented = {id(value) for _, value in documented_names()}
    missing = {
        name for value, name in public_names().items() if value not in documented
    }
    assert missing == set(), "add them to a page in docs/reference"


def test_the_reference_has_public_names_only_and_once() -> None:
    public = public_names()
    names = [name for name, value in documented_names() if id(value) in public]
    assert len(names) == len(list(documented_names()))
    assert len(names) == len(set(names))


def test_every_page_is_in_a_table_of_contents() -> None:
    reached: set[Path] = set()
    ahead = [DOCS / "index.md"]
    while ahead:
        page = ahead.pop()
        reached.add(page)
        trees = re.findall(r"```\{toctree\}\n(.*?)```", page.read_text("utf-8"), re.S)
        for line in "\n".join(trees).splitlines():
            if line and not line.startswith(":"):
                name = re.sub(r".* <(.*)>", r"\1", line)  # a title may precede it
                target = Path(os.path.normpath(page.parent / f"{name}.md"))
                assert target.exists(), f"{page} names {line}"
                if target not in reached:
                    ahead.append(target)
    assert set(pages()) - reached == set()


def test_links_between_pages_lead_somewhere() -> None:
    for page in pages():
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text("utf-8")):
            target = Path(os.path.normpath(page.parent / link))
            # Pages of environments are written when the site is built.
            if (
                not link.startswith(("http:", "https:"))
                and GENERATED not in target.parents
            ):
                assert target.is_file(), f"{page} links to {link}"


@pytest.mark.parametrize("name", ["first-colony", "questions", "which-agent"])
def test_programs_for_newcomers_run(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "start" / f"{name}.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {"__name__": name}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(block, name, "exec"), names)
    said = capsys.readouterr().out.splitlines()
    if name == "questions":
        assert said == ["10"]
    elif name == "which-agent":
        assert said == ["13.0"]
    else:
        cost = float(said[0].split()[1].rstrip(","))
        assert 38.0 < cost < 1.25 * 38.4
        assert Path("swing_up.h").is_file()


@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_an_environment_has_a_page_and_a_picture(env_id: str) -> None:
    module = extension("environment_pages")
    text = module.page(env_id)
    heads = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert heads[:4] == ["Description", "Action Space", "Observation Space", "Rewards"]
    assert {"Starting State", "Episode End", "Arguments", "Version History"} <= set(
        heads
    )
    single = module._load(ENVIRONMENTS[env_id].single)
    for row in parameters(single.system_type):
        assert f"| `{row['name']}` | `{row['default']!r}` |" in text
    picture = f"{module.page_name(env_id)}.png"
    assert (DOCS / "figures" / "environments" / picture).is_file()
    assert env_id in module.table()


def test_docstrings_become_restructuredtext() -> None:
    translated = extension("docstrings").to_restructuredtext(
        [
            "## Head",
            "The norm |x| of x_ and `|y|`.",
            "| Num | Unit |",
            "|-----|------|",
            "| 0   | a|b  |",
            "```python",
            "a |= b",
            "```",
            ">>> x_ | y",
            "1",
            "",
            "See docs/versus.md, not `docs/a.md`.",
        ]
    )
    assert [line for line in translated if line] == [
        ".. rubric:: Head",
        r"The norm \|x\| of x\_ and `|y|`.",
        ".. list-table::",
        "   :header-rows: 1",
        "   * - Num",
        "     - Unit",
        "   * - 0",
        "     - a",
        "     - b",
        ".. code-block:: python",
        "   a |= b",
        ">>> x_ | y",
        "1",
        "See :doc:`/versus`, not `docs/a.md`.",
    ]


def test_constants_show_a_short_value_or_a_table() -> None:
    module = extension("public_names")
    assert module.description("N", 3) == [".. autodata:: N", "", ""]
    claim = types.SimpleNamespace(name="C1", text="A * b.", section="§3")
    table = "\n".join(module.description("CLAIMS", (claim,)))
    assert ":no-value:" in table
    assert r"* - C1" in table
    assert r"- A \* b." in table
    kernel = types.SimpleNamespace(py_func=module.description)
    assert module.description("f", kernel)[0] == ".. autofunction:: f"
    assert module.says_something("30")
    assert not module.says_something("<object at 0x7f00>")
    assert not module.says_something("CPUDispatcher(<function f at 0x7f00>)")
    assert not module.says_something("1" * 100)


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["C1", SENTENCE], True),
        (["x", "3.1"], False),
        ([SENTENCE] * 6, False),
    ],
)
def test_tables_of_text_are_told_from_tables_of_figures(
    cells: list[str], expected: bool
) -> None:
    parser = pytest.importorskip("myst_parser.parsers.docutils_").Parser()
    core = pytest.importorskip("docutils.core")
    rows = [["head"] * len(cells), ["-"] * len(cells), cells]
    text = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    document = core.publish_doctree(text, parser=parser)
    module = extension("tables")
    (table,) = document.findall(pytest.importorskip("docutils.nodes").table)
    assert module.holds_text(table) is expected


def test_a_description_is_the_first_sentence_and_not_too_long() -> None:
    parser = pytest.importorskip("myst_parser.parsers.docutils_").Parser()
    core = pytest.importorskip("docutils.core")
    module = extension("page_meta")
    document = core.publish_doctree("# A\n\nnote\n\nIt *is*\nso.\n", parser=parser)
    assert module.first_paragraph(document) == "It is so."
    short = module.shortened("word " * 100)
    assert len(short) <= module.LONGEST
    assert short.endswith("word\N{HORIZONTAL ELLIPSIS}")


def test_an_equation_that_cannot_be_drawn_is_one_clear_error() -> None:
    nodes = pytest.importorskip("docutils.nodes")
    errors = pytest.importorskip("sphinx.errors")
    module = extension("mathml")
    drawn = module._mathml(nodes.math("", r"\tau_0"), as_block=False)
    assert drawn.startswith("<math")
    with pytest.raises(errors.ExtensionError, match="cannot be drawn"):
        module._mathml(nodes.math("", r"\nonsense{x}"), as_block=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built with warnings as errors."""
    pytest.importorskip("furo")
    out = tmp_path_factory.mktemp("site")
    options = ["-b", "html", "-W", "--keep-going", "-q"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, DOCS, out],
        env={**os.environ, "PYTHONPATH": str(DOCS.parent)},
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.slow
def test_the_site_builds_and_loads_nothing_from_elsewhere(site: Path) -> None:
    html = sorted(site.rglob("*.html"))
    assert len(html) > len(ENVIRONMENTS) + len(list(pages()))
    for path in html:
        text = path.read_text(encoding="utf-8")
        loaded = re.findall(
            r"<(?:script|img|iframe|source)[^>]*\ssrc=\"([^\"]*)\"", text
        ) + re.findall(r"<link[^>]*rel=\"stylesheet\"[^>]*href=\"([^\"]*)\"", text)
        assert [one for one in loaded if re.match(r"https?:|//", one)] == [], path
    for path in (site / "_static").rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:|//)", path.read_text())


@pytest.mark.slow
def test_every_picture_says_what_it_shows(site: Path) -> None:
    for path in sorted(site.rglob("*.html")):
        for image in re.findall(r"<img\b[^>]*>", path.read_text(encoding="utf-8")):
            if 'class="toggler"' in image:  # the sign that opens a list
                continue
            alt = re.search(r'\balt="([^"]*)"', image)
            assert alt is not None, f"{path}: {image[:200]}"
            assert len(alt[1].split()) >= 3, f"{path}: {alt[0]}"
            assert not re.search(r"\w+\.(png|gif|svg)|[0-9a-f]{20}", alt[1]), path


@pytest.mark.slow
def test_every_page_has_an_icon_and_a_description(site: Path) -> None:
    for path in sorted(site.rglob("*.html")):
        text = path.read_text(encoding="utf-8")
        assert re.search(r'<link rel="shortcut icon" href="[^"]*favicon.svg', text), (
            path
        )
        for name in ('name="description"', 'property="og:title"', 'property="og:url"'):
            assert re.search(rf'<meta {name} content="[^"]+"', text), f"{path}: {name}"
    picture = re.search(r'og:image" content="([^"]+)"', text)
    assert picture is not None
    assert (site / "_images" / picture[1].rpartition("/")[2]).is_file()


@pytest.mark.slow
def test_the_reference_shows_no_long_values(site: Path) -> None:
    page = site / "reference" / "experiments.html"
    text = page.read_text(encoding="utf-8")
    assert len(text) < 200_000
    for name in ("C34", "fig5.4", "versus-noise"):
        assert f"<p>{name}</p>" in text, name
    for path in (site / "reference").glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "CPUDispatcher(" not in text, path
        assert " at 0x" not in text, path
        assert not re.search(r"\bdocs/[\w/-]+\.md", text), path


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """The site as `make docs-serve` serves it."""
    handler = functools.partial(QuietHandler, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *arguments: object) -> None:
        """Keep what is served out of the output of the tests."""


# After two frames, because sizes are observed at the end of one.
UNREACHABLE = """async () => {
    const unreachable = () =>
        [...document.querySelectorAll(".table-wrapper, .output.text_html, .picture-box")]
        .filter(box => box.scrollWidth > box.clientWidth + 1)
        .filter(box => box.tabIndex !== 0 || box.getAttribute("role") !== "region"
            || !box.getAttribute("aria-label") || !box.classList.contains("scrolls"))
        .map(box => "the keyboard cannot reach " + box.outerHTML.slice(0, 99));
    // Boxes are marked when the browser has measured them, on a busy machine later.
    for (let frame = 0; frame < 100 && unreachable().length; frame++)
        await new Promise(done => requestAnimationFrame(done));
    return unreachable();
}"""


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_pages_in_a_browser(site: Path, address: str, width: int, scheme: str) -> None:
    """No errors, nothing from elsewhere, no scrolling sideways; equations and search."""
    wrong: list[str] = []
    with chromium() as browser:
        tab = new_tab(browser, width, scheme, wrong)
        tab.on(
            "request",
            lambda asked: (
                asked.url.startswith((address, "data:")) or wrong.append(asked.url)
            ),
        )
        tab.route(lambda url: not url.startswith(address), lambda route: route.abort())
        for page in sorted(site.rglob("*.html")):
            tab.goto(f"{address}/{page.relative_to(site).as_posix()}")
            across = tab.evaluate("document.documentElement.scrollWidth")
            if across > width:
                wrong.append(f"{page} scrolls sideways")
            missing = "[...document.images].filter(i => i.complete && !i.naturalWidth)"
            wrong += tab.evaluate(f"{missing}.map(i => i.src)")
            wrong += [f"{page}: {text}" for text in tab.evaluate(UNREACHABLE)]
        tab.goto(f"{address}/background/index.html")
        equation = tab.locator(".math-block math").first.bounding_box()
        assert equation is not None
        assert equation["height"] > 30, "a fraction has two lines"
        tab.goto(f"{address}/search.html?q=evaporation")
        tab.locator("#search-results li a").first.wait_for(timeout=20_000)
        tab.wait_for_load_state("networkidle")
    assert wrong == []
