"""Finer grids say what the coarser ones said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import Crisp, Fuzzy
from acl_gym.partitions import locate_all
from acl_gym.partitions.growing import carried_over, refined


def value(table: Any, partition: Any, states: Any) -> Any:
    index, degree = locate_all(partition, states, partition.n_cells)
    return np.einsum("nk,nka->na", degree, table[index])


@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.lists(st.integers(1, 5), min_size=1, max_size=4),
    round_axis=st.booleans(),
    axis=st.integers(0, 3),
)
def test_a_fuzzy_table_says_the_same_everywhere(
    seed: int, sizes: list[int], round_axis: bool, axis: int
) -> None:
    rng = np.random.default_rng(seed)
    centres = [np.sort(rng.choice(100, n, replace=False)) / 10.0 for n in sizes]
    period = 10.0 if round_axis and sizes[0] > 1 else None
    coarse = Fuzzy(centres, [period] + [None] * (len(sizes) - 1))
    axis %= len(sizes)
    fine = refined(coarse, axis)
    table = rng.normal(size=(coarse.n_cells, 3))
    carried = carried_over(table, coarse, fine)
    states = rng.uniform(-2.0, 12.0, (200, len(sizes)))
    np.testing.assert_allclose(
        value(carried, fine, states), value(table, coarse, states), atol=1e-9
    )
    assert set(coarse.centres[axis]) <= set(fine.centres[axis])
    rounded = axis == 0 and period is not None
    expected = 2 * sizes[axis] - (not rounded)
    assert fine.centres[axis].size == expected


def test_cells_of_a_crisp_grid_are_copied() -> None:
    coarse = Crisp([[0.0, 1.0, 2.0]])
    fine = refined(coarse, 0)
    table = np.array([[1.0], [2.0], [4.0]])
    # A centre on the border of two cells belongs to the upper one, as a state does.
    assert carried_over(table, coarse, fine).ravel().tolist() == [1, 2, 2, 4, 4]


@pytest.mark.parametrize(("axis", "words"), [(2, "axis must be"), (-1, "axis must be")])
def test_an_axis_must_exist(axis: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        refined(Fuzzy([[0.0, 1.0]] * 2), axis)


def test_a_table_of_another_partition_is_refused() -> None:
    coarse = Fuzzy([[0.0, 1.0]])
    with pytest.raises(ValueError, match="table must have 2 rows, one for each cell"):
        carried_over(np.zeros((3, 1)), coarse, refined(coarse, 0))
