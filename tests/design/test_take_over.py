"""The linear controller that takes over at the goal, as docs/design.md shows it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from acl_gym.cli.design import example
from tests.export.compiled import STRICT

PAGE = Path(__file__).resolve().parents[2] / "docs" / "design.md"
HEAD = "## A linear controller that takes over at the goal"

pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="a source distribution has no documentation"
)


def blocks(language: str) -> list[str]:
    """The blocks of the section in one language; "" is what a program prints."""
    section = PAGE.read_text(encoding="utf-8").partition(HEAD)[2].partition("\n## ")[0]
    found = re.findall(r"^```(\w*)\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    return [text for name, text in found if name == language]


@pytest.fixture(scope="module")
def section(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the Python of the section defines, run in a folder with pendulum.py."""
    folder = tmp_path_factory.mktemp("take-over")
    (folder / "pendulum.py").write_text(example("pendulum"))
    names: dict[str, Any] = {"__name__": "page", "printed": []}
    names["print"] = names["printed"].append
    with pytest.MonkeyPatch.context() as patch, mpl.rc_context({"backend": "agg"}):
        patch.chdir(folder)
        patch.syspath_prepend(folder)
        patch.delitem(sys.modules, "pendulum", raising=False)
        for block in blocks("python"):
            exec(compile(block, str(PAGE), "exec"), names)
        sys.modules.pop("pendulum", None)
    return {**names, "folder": folder}


def test_the_figures_are_those_of_the_page(section: dict[str, Any]) -> None:
    assert section["made"].succeeded
    assert (section["folder"] / "take-over.png").stat().st_size > 10_000
    printed = blocks("")[1].splitlines()
    for found, shown in zip(section["printed"], printed, strict=True):
        numbers = [re.findall(r"\d\.\d+", line) for line in (found, shown)]
        np.testing.assert_allclose(*np.array(numbers, dtype=float), atol=0.01)
    for linear in (False, True):
        ends = np.abs(section["angles"](section["starts"], linear)[160:]).max(axis=0)
        assert (ends <= 0.1).all(), "every start reaches the goal and stays"
        assert (ends.max() < 1e-3) == linear


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_program_in_c_holds_the_pendulum_upright(section: dict[str, Any]) -> None:
    folder = section["folder"]
    (program,) = blocks("c")
    (folder / "main.c").write_text(program)
    command = ["cc", "-std=c99", "-O2", *STRICT, "-Ipendulum", "main.c", "-o", "main"]
    subprocess.run([*command, "-lm"], cwd=folder, check=True, timeout=60)
    ran = subprocess.run(
        ["./main"], cwd=folder, check=True, capture_output=True, text=True, timeout=60
    )
    rows = np.array([line.split() for line in ran.stdout.splitlines()], dtype=float)
    assert rows.shape == (200, 3)
    angle = np.remainder(rows[:, 0] + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_array_equal(np.abs(angle[160:]) < 1e-3, True)
    # From where it takes over, the input is that of `StateFeedback`; before, of the table.
    first = np.flatnonzero((np.abs(angle) <= 0.1) & (np.abs(rows[:, 1]) <= 1.0))[0]
    assert 10 < first < 150
    expected = section["hold"](rows[first:, :2])[:, 0]
    np.testing.assert_allclose(rows[first:, 2], expected, atol=2e-5)
    assert set(rows[:first, 2].round(6)) <= set(section["inputs"])
