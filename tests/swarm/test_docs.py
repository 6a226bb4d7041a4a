"""The programs of docs/moving-agents.md and of docstrings do what they say."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "moving-agents.md"
MODULES = ("acl_gym.swarm.inbox", "acl_gym.agents.moving_ants")


@pytest.mark.skipif(not PAGE.exists(), reason="not in the checkout")
def test_the_programs_of_the_page_print_what_it_says(
    capsys: pytest.CaptureFixture[str],
) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    names: dict[str, object] = {"__name__": "page"}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
        promised = re.findall(r"^print\(.*\)\s+# (True True|True|\d+)", block, re.M)
        assert capsys.readouterr().out.splitlines() == promised
    assert len(blocks) == 4


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings(name: str) -> None:
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted > 0
    assert found.failed == 0
