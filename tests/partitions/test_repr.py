"""What partitions say they are, in a line and in a notebook."""

from __future__ import annotations

import math
from typing import Any

import pytest

from acl_gym import Crisp, Discrete, Fuzzy
from acl_gym.partitions import Partition


class Own(Partition):
    n_cells, cells_per_state = 5, 1

    def locate(self, *arguments: Any) -> None:
        raise NotImplementedError

    def settings(self) -> Any:
        raise NotImplementedError

    def cell_states(self) -> Any:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("partition", "line"),
    [
        (Fuzzy([[0.0, 1.0], [0.0]], [2.0, None]), "Fuzzy(2 x 1 cells, circular=[0])"),
        (Crisp([[0.0, 1.0]]), "Crisp(2 cells, circular=[])"),
        (Discrete(6), "Discrete(6)"),
        (Discrete([2, 3], 1), "Discrete([2, 3], starts=[1, 1])"),
        (Discrete([2] * 12), "Discrete(12 variables, 4096 cells)"),
        (Own(), "Own(5 cells)"),
    ],
)
def test_a_line(partition: Partition, line: str) -> None:
    assert repr(partition) == line
    page = partition._repr_html_()
    assert line in page
    assert f"{partition.n_cells:,} cells" in page


def test_a_notebook_lists_the_variables() -> None:
    page = Fuzzy([[0.0, math.pi], [-9.0, 0.0, 9.0]], [2 * math.pi, None])._repr_html_()
    for text in ("circular, period 6.283", ">-9<", ">3.142<"):
        assert text in page


def test_many_variables_are_cut() -> None:
    assert Discrete([2] * 20)._repr_html_().count("<tr>") == 13  # with the heads
