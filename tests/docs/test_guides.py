"""The guides that are notebooks: their form, and that their cells run without a warning."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib as mpl
import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
INDEX = DOCS / "guides" / "index.md"
GUIDES = sorted(path for path in INDEX.parent.glob("*.md") if path != INDEX)

pytestmark = pytest.mark.skipif(
    not INDEX.exists(), reason="a source distribution has no documentation"
)


def extension() -> ModuleType:
    """What runs guides when the site is built."""
    pytest.importorskip("sphinx")
    path = DOCS / "_extensions" / "guides.py"
    spec = importlib.util.spec_from_file_location("guides", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cells(guide: Path) -> list[str]:
    """The code of a guide, without the options of the cells."""
    blocks = re.findall(
        r"^```\{code-cell\}[^\n]*\n(?::[^\n]*\n)*(.*?)^```$",
        guide.read_text(encoding="utf-8"),
        re.MULTILINE | re.DOTALL,
    )
    return [block.strip("\n") for block in blocks]


def run(cell: str, names: dict[str, Any]) -> Any:
    """Run one cell as a notebook does: what its last line gives is shown."""
    tree = ast.parse(cell)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    if last is None:
        return None
    assert isinstance(last, ast.Expr)
    shown = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
    return shown._repr_html_() if hasattr(shown, "_repr_html_") else repr(shown)


@pytest.mark.parametrize("guide", GUIDES, ids=lambda path: path.stem)
def test_a_guide_is_a_notebook_that_the_index_shows(guide: Path) -> None:
    text = guide.read_text(encoding="utf-8")
    assert text.startswith("---\nfile_format: mystnb\nkernelspec:\n  name: python3\n")
    assert re.search(r"^# \S", text, re.MULTILINE), "it has a title"
    assert cells(guide), "it has cells"
    assert len(cells(guide)) == text.count("{code-cell}"), "a cell is not closed"
    index, _, tree = INDEX.read_text(encoding="utf-8").partition("```{toctree}")
    assert f"]({guide.name})" in index, "the index has a line about it"
    assert f" <{guide.stem}>\n" in tree, "its toctree has it, with a short title"


@pytest.mark.slow
@pytest.mark.parametrize("guide", GUIDES, ids=lambda path: path.stem)
def test_the_cells_of_a_guide_run(
    guide: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    with mpl.rc_context({"backend": "agg"}):
        try:
            for cell in cells(guide):
                run(cell, names)
        finally:
            plt.close("all")


def test_a_notebook_away_from_the_site_has_links_to_it() -> None:
    module = extension()
    text = (
        "# A\n\n{nb-download}`Download this guide as a notebook <a.ipynb>`\n\n"
        "[B](b.md), [C](../start/c.md#d), [E](https://example.org/e.md)"
    )
    assert module.link_to_site(text, "guides/a", "https://example.org/docs/") == (
        "# A\n\n[B](https://example.org/docs/guides/b.html), "
        "[C](https://example.org/docs/start/c.html#d), [E](https://example.org/e.md)"
    )
    assert module.is_guide("---\nfile_format: mystnb\nkernelspec:\n  name: p\n---\n")
    assert not module.is_guide("# A\n\n---\nfile_format: mystnb\n---\n")


def test_the_cache_of_outputs_belongs_to_one_state_of_the_package(
    tmp_path: Path,
) -> None:
    module = extension()
    (tmp_path / "a.py").write_text("1")
    (tmp_path / "__pycache__").mkdir()
    first = module.package_digest(tmp_path)
    (tmp_path / "__pycache__" / "a.pyc").write_text("2")
    assert module.package_digest(tmp_path) == first
    (tmp_path / "a.py").write_text("2")
    assert module.package_digest(tmp_path) != first
