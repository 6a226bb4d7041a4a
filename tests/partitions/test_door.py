"""What reaches the kernels of a partition is checked, and cannot be changed."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from acl_gym import Crisp, Discrete, Fuzzy
from acl_gym.partitions import checked_partition, locate_all
from tests.fuzz import liars


def grid(kind: Any = Fuzzy) -> Any:
    return kind([[0.0, 1.0], [0.0, 1.0, 2.0]], [None, 4.0])


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_a_variable_with_one_centre_makes_no_difference(kind: Any) -> None:
    rng = np.random.default_rng(0)
    states = rng.uniform(-1.0, 3.0, (50, 2))
    plain = grid(kind)
    wide = kind(
        [[5.0], [0.0, 1.0], [7.0], [0.0, 1.0, 2.0], [9.0]], [2.0, None, None, 4.0, 1.0]
    )
    assert wide.n_cells == plain.n_cells
    assert wide.cells_per_state == plain.cells_per_state
    others = rng.uniform(-99.0, 99.0, (50, 3))
    seen = np.column_stack(
        [others[:, 0], states[:, 0], others[:, 1], states[:, 1], others[:, 2]]
    )
    for found, expected in zip(wide(seen), plain(states), strict=True):
        np.testing.assert_array_equal(found, expected)
    seen[3, 2] = np.nan
    with pytest.raises(ValueError, match=r"states must be finite.* in row 3"):
        wide(seen)


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_one_cell_alone_takes_every_state(kind: Any) -> None:
    one = kind([[0.0], [0.0]])
    index, degree = one([[3.0, 4.0], [-1.0, 0.0]])
    assert index.tolist() == [[0], [0]]
    assert degree.tolist() == [[1.0], [1.0]]


def test_24_variables_of_which_two_matter() -> None:
    wide = Fuzzy.from_box(spaces.Box(-1, 1, (24,)), [5, 5] + [1] * 22)
    assert (wide.n_cells, wide.cells_per_state) == (25, 4)


@pytest.mark.parametrize(
    "name", ["centres", "periods", "n_cells", "cells_per_state", "locate"]
)
def test_grids_are_fixed(name: str) -> None:
    with pytest.raises(AttributeError, match=rf"{name} of a Fuzzy is fixed"):
        setattr(grid(), name, 99)


@pytest.mark.parametrize(
    "copied", [lambda x: x, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_arrays_of_partitions_are_read_only(copied: Any) -> None:
    cells, fuzzy = copied(Discrete((3, 2))), copied(grid())
    for array in (cells.sizes, cells.starts, *fuzzy.centres):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 99
    np.testing.assert_array_equal(fuzzy([[0.5, 1.5]])[1], grid()([[0.5, 1.5]])[1])


@pytest.mark.parametrize(
    ("kind", "states"),
    [(liars.FarCrisp, [[0.0, 0.0]]), (liars.FarFuzzy, [[0.0, 0.0]])],
)
def test_a_subclass_is_checked_whatever_it_inherits(kind: Any, states: Any) -> None:
    with pytest.raises(ValueError, match=r"locate must give cells in 0\.\.5"):
        grid(kind)(states)


def test_the_table_counts_not_what_the_partition_says() -> None:
    partition = liars.OwnPartition(lambda *arrays: None)
    partition.n_cells = 99
    with pytest.raises(ValueError, match=r"cells in 0\.\.1, got 0 to 2"):
        locate_all(partition, np.zeros((1, 2)), n_cells=2)


@pytest.mark.parametrize("lie", liars.LIES_OF_CELLS)
def test_lies_about_cells_are_refused(lie: str) -> None:
    partition = liars.OwnPartition(liars.LIES_OF_CELLS[lie])
    words = "read-only" if lie == "slots" else r"OwnPartition.locate must give"
    with pytest.raises(ValueError, match=words):
        partition(np.zeros((4, 2)))


def test_slots_beyond_the_states_are_refused() -> None:
    index, degree = np.zeros((1, 4), np.int32), np.zeros((1, 4))
    for slot in (-1, 2, 2**40):
        with pytest.raises(ValueError, match=r"slots must be rows of the 2 states"):
            grid().locate(np.zeros((2, 2)), np.array([slot]), index, degree)
    with pytest.raises(ValueError, match=r"slots must be rows of the 2 states"):
        Discrete(3).locate(
            np.zeros(2, int), np.array([5]), index[:, :1].copy(), degree[:, :1].copy()
        )


def test_arrays_to_write_to_must_fit() -> None:
    index, degree = np.zeros((1, 1), np.int32), np.zeros((1, 4))
    with pytest.raises(ValueError, match=r"index and degree must be arrays of int32"):
        grid().locate(np.zeros((1, 2)), np.arange(1), index, degree)


def test_huge_values_of_a_circular_variable_have_a_cell() -> None:
    circular = Fuzzy([[0.0, 1e-300]], [2e-300])
    index, degree = circular([[1e308], [-1e308]])
    assert set(index.ravel()) <= {0, 1}
    np.testing.assert_allclose(degree.sum(axis=1), 1.0)


@pytest.mark.parametrize("name", ["n_cells", "cells_per_state"])
def test_sizes_of_ones_own_partition_are_checked(name: str) -> None:
    partition = liars.OwnPartition(lambda *arrays: None)
    for value, error in ((0, ValueError), ("a", TypeError), (2**31, ValueError)):
        setattr(partition, name, value)
        with pytest.raises(error, match=rf"{name} of OwnPartition must be"):
            checked_partition(partition)


def test_more_than_fits_into_memory_is_refused_with_the_bytes() -> None:
    wide = Crisp.from_box(spaces.Box(0, 1, (3,)), 1200)
    with pytest.raises(
        ValueError, match=r"must fit into [\d,]+ bytes.* need 82,944,000,000"
    ):
        wide.cell_states()
