"""Draw the pictures of docs/gallery.md: run the programs that stand on the page.

The page is the source: each of its programs saves the picture that is shown above it.

    python benchmarks/gallery_figures.py
"""

from __future__ import annotations

import argparse
import contextlib
import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parent.parent / "docs" / "gallery.md"
OUT = PAGE.parent / "figures" / "gallery"


def run_page(page: Path, out: Path) -> None:
    """Run the programs of a page, one after the other, in the folder of its pictures.

    Args:
        page: a Markdown file.
        out: a folder; it is made if it is missing.
    """
    out.mkdir(parents=True, exist_ok=True)
    names: dict[str, Any] = {"__name__": "gallery"}
    text = page.read_text(encoding="utf-8")
    with contextlib.chdir(out):
        for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            exec(compile(block, str(page), "exec"), names)


def main() -> None:
    """Draw the pictures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", type=Path, default=OUT, help="a folder (default: docs/figures/gallery)"
    )
    run_page(PAGE, parser.parse_args().out)


if __name__ == "__main__":
    main()
