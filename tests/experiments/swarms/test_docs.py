"""The program of docs/swarms/delays.md prints what the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[3] / "docs" / "swarms" / "delays.md"


@pytest.mark.skipif(not PAGE.exists(), reason="not in the checkout")
def test_delays_do_nothing_without_repulsion(
    capsys: pytest.CaptureFixture[str],
) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    exec(compile(program, str(PAGE), "exec"), {"__name__": "page"})
    assert capsys.readouterr().out.split() == ["True", "False"]
    assert "# True, then False" in program
