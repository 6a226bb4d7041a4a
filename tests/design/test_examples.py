"""The examples: what the command learns, in C, drives their equations written in C."""

from __future__ import annotations

import importlib
import shutil
from pathlib import Path

import numpy as np
import pytest

from acl_gym.cli.design_help import EXAMPLES, example
from acl_gym.design.learning import CHOOSING, learn
from acl_gym.design.run import draw_starts
from tests.design.c_simulation import EQUATIONS, steps_in_c

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")

# With which every seed tried succeeds: 6,000 for few variables, half a million for four.
STEPS = {"pendulum": 6_000, "dc_motor": 6_000, "two_tanks": 6_000, "cart_pole": 500_000}


@needs_cc
@pytest.mark.parametrize(
    "name",
    [
        "pendulum",
        "dc_motor",
        "two_tanks",
        pytest.param("cart_pole", marks=pytest.mark.slow),
    ],
)
def test_the_controller_in_c_reaches_the_goal(name: str, tmp_path: Path) -> None:
    env = importlib.import_module(f"acl_gym.examples.{name}").env
    plant = env.system
    learned = learn(
        env,
        draw_starts(plant, CHOOSING, 0, 1),
        seed=0,
        seconds=None,
        steps=STEPS[name],
        stop=lambda: False,
        tell=lambda progress: None,
    )
    header = learned.policy.to_c(tmp_path / "policy.h")
    starts = draw_starts(plant, 100, 0, 3)
    steps = steps_in_c(name, header, plant, starts)
    assert steps.shape == (100,)
    assert (steps > 0).mean() >= 0.95
    # A controller that does nothing does not.
    idle = np.argmin(np.abs(plant.inputs[:, 0]))
    learned.policy.table[:] = np.arange(plant.inputs.size) == idle
    steps = steps_in_c(name, learned.policy.to_c(header), plant, starts)
    assert (steps > 0).mean() < 0.5


def test_each_example_is_listed_with_equations_in_c() -> None:
    files = Path(importlib.import_module("acl_gym.examples").__file__).parent
    names = {file.stem for file in files.glob("*.py")} - {"__init__"}
    assert names == set(EXAMPLES) == set(EQUATIONS)
    for name in names:
        text = example(name)
        assert f"acl-gym design {name}.py" in text
        assert text.count("\n") <= 60


PAGE = Path(__file__).resolve().parents[2] / "docs" / "design.md"


@pytest.mark.skipif(not PAGE.exists(), reason="a source distribution has no docs")
def test_the_documentation_shows_the_example_as_it_is() -> None:
    text = PAGE.read_text()
    lines = text.partition("```python\n")[2].partition("```")[0].splitlines()
    known = example("pendulum").splitlines()
    assert len(lines) > 15
    assert [line for line in lines if line and line not in known] == []
    for name in EXAMPLES:
        assert f"`{name}`" in text
