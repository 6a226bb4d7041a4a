"""The programs of docs/particle-swarms.md and of `minimize` do what they say."""

from __future__ import annotations

import doctest
import re
from pathlib import Path
from typing import Any

import pytest

from acl_gym.swarm.pso import optimize

PAGE = Path(__file__).resolve().parents[3] / "docs" / "particle-swarms.md"


@pytest.mark.skipif(not PAGE.exists(), reason="a source distribution has no docs")
def test_the_programs_run(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    names: dict[str, Any] = {"__name__": "page"}
    exec("\n".join(blocks), names)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2:] == ["All 999 iterations were made.", "True"]
    assert names["result"].success
    assert names["result"].fun < 1e-6
    promised = re.findall(r"^(\w+\(0.*?\)) +# ([\w.]+)", "\n".join(blocks), re.M)
    assert len(promised) == 4
    for call, value in promised:
        found = eval(call, names)
        assert (f"{found:.3f}" if isinstance(found, float) else str(found)) == value


def test_the_example_of_the_docstring() -> None:
    assert doctest.testmod(optimize) == (0, 2)
