"""The examples of docs/safe-learning.md run as printed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

PAGE = Path(__file__).resolve().parents[3] / "docs" / "safe-learning.md"


def test_the_examples_of_the_page() -> None:
    names: dict[str, Any] = {"__name__": "page"}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL):
        exec(compile(block, str(PAGE), "exec"), names)
    colony, infos = names["colony"], names["infos"]
    assert colony.num_timesteps >= 2_000
    np.testing.assert_array_equal(infos["_shielded"], True)
    assert names["env"].violations.sum() == 0
