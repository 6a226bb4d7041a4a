"""The programs of docs/swarm-aggregation.md and of the package do what they say."""

from __future__ import annotations

import doctest
import re
from pathlib import Path
from typing import Any

import pytest

from acl_gym.swarm import aggregation

PAGE = Path(__file__).resolve().parents[3] / "docs" / "swarm-aggregation.md"
SHORTER = {"trials=200": "trials=2", "total_timesteps=200_000": "total_timesteps=1_000"}
"""What takes long, and what is run in its place."""


@pytest.mark.skipif(not PAGE.exists(), reason="a source distribution has no docs")
def test_the_programs_run(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pettingzoo")
    pytest.importorskip("stable_baselines3")
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(blocks) == 5
    program = "\n".join(blocks)
    for long, short in SHORTER.items():
        assert program.count(long) == 1
        program = program.replace(long, short)
    names: dict[str, Any] = {"__name__": "page"}
    exec(compile(program, str(PAGE), "exec"), names)
    assert capsys.readouterr().out.splitlines() == ["[3. 3.] True"]
    assert names["history"]["positions"].shape == (1501, 200, 2)
    assert names["observations"].shape == (100, 7)
    assert len(names["colony"].history) == 2
    assert names["model"].num_timesteps == 1_000


def test_the_example_of_the_package() -> None:
    found = doctest.testmod(aggregation)
    assert found.attempted > 0
    assert found.failed == 0


def test_the_example_of_the_environment() -> None:
    from acl_gym.envs.swarm_aggregation import env

    found = doctest.testmod(env)
    assert found.attempted > 0
    assert found.failed == 0
