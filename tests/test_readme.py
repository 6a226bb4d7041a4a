"""The README's Python runs as printed and does what its comments promise."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

README = Path(__file__).resolve().parents[1] / "README.md"
PAGES = [f"docs/{path.name}" for path in sorted((README.parent / "docs").glob("*.md"))]
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)


def run(block: str) -> dict[str, object]:
    names: dict[str, object] = {"__name__": "readme"}
    exec(compile(block, str(README), "exec"), names)
    return names


def test_ten_lines_learn_the_pendulum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run(BLOCKS[0])
    cost = float(capsys.readouterr().out.split()[0])
    assert cost < 1.25 * 38.4
    assert (tmp_path / "swing_up.npz").exists()


def test_a_newcomers_environment_is_learned() -> None:
    """Untrained, the cart hardly ever comes to rest; 18 steps is about the best."""
    names = run(BLOCKS[1])
    result = names["result"]
    assert result.success_rate == 1.0  # type: ignore[attr-defined]
    assert result.cost < 30.0  # type: ignore[attr-defined]


@pytest.mark.skipif(not PAGES, reason="a source distribution has no documentation")
@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", *PAGES])
def test_links_within_the_project_lead_somewhere(page: str) -> None:
    source = README.parent / page
    links = re.findall(r"\]\(([^)#]+)\)", source.read_text())
    for link in links:
        if not link.startswith(("http:", "https:")):
            assert (source.parent / link).is_file(), f"{page} links to {link}"
