"""The programs of the gallery run and draw the pictures that the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.scripts import run_script

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "gallery.md"
SCRIPT = ROOT / "benchmarks" / "gallery_figures.py"

pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="a source distribution has no documentation"
)


@pytest.mark.slow
def test_the_programs_of_the_gallery_draw_its_pictures(tmp_path: Path) -> None:
    done = run_script(SCRIPT, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    text = PAGE.read_text(encoding="utf-8")
    shown = re.findall(r"\]\(figures/gallery/([^)]+)\)", text)
    drawn = {path.name for path in tmp_path.iterdir() if path.stat().st_size > 5_000}
    assert drawn == set(shown)
    assert len(shown) == len(set(shown)) > 10


def test_the_programs_that_the_gallery_names_are_there() -> None:
    named = re.findall(r"python (benchmarks/\w+\.py)", PAGE.read_text(encoding="utf-8"))
    assert len(named) > 5
    assert [path for path in named if not (ROOT / path).is_file()] == []
