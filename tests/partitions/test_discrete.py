"""Integer states: every combination of values is a cell."""

import json
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import Discrete, Fuzzy
from acl_gym.partitions import partition_from_settings
from acl_gym.partitions.kernels import locate_discrete
from tests.partitions import reference_partition as reference

NAN, INF = float("nan"), float("inf")


@st.composite
def variables(draw: st.DrawFn) -> tuple[list[int], list[int]]:
    """Sizes and starts of 1 to 4 variables."""
    d = draw(st.integers(1, 4))
    sizes = draw(st.lists(st.integers(1, 6), min_size=d, max_size=d))
    start = st.integers(-20, 20) | st.sampled_from([2**52, -(2**52)])
    return sizes, draw(st.lists(start, min_size=d, max_size=d))


@given(variables())
def test_cells_are_all_combinations_in_order(case: tuple[list[int], list[int]]) -> None:
    sizes, starts = case
    partition = Discrete(sizes, starts)
    states = reference.discrete_states(sizes, starts)
    assert partition.n_cells == len(states)
    assert partition.cells_per_state == 1
    assert partition.state_ndim == 1
    np.testing.assert_array_equal(partition.cell_states(), states)
    index, degree = partition(states)
    assert index.dtype == np.int32
    np.testing.assert_array_equal(index[:, 0], np.arange(len(states)))
    np.testing.assert_array_equal(degree, 1.0)


@given(variables(), st.data())
def test_kernel_finds_the_cells_of_some_slots(
    case: tuple[list[int], list[int]], data: st.DataObject
) -> None:
    sizes, starts = case
    partition = Discrete(sizes, starts)
    every = reference.discrete_states(sizes, starts)
    cells = data.draw(st.lists(st.integers(0, len(every) - 1), min_size=1, max_size=9))
    slots = data.draw(st.lists(st.integers(0, len(cells) - 1), max_size=9))
    states, chosen = every[cells], np.array(slots, dtype=np.int64)
    arguments = (chosen, np.array(sizes), np.array(starts))
    for kernel in (locate_discrete, locate_discrete.py_func):
        index = np.full((9, 1), -7, dtype=np.int32)
        degree = np.full((9, 1), -7.0)
        assert kernel(states, *arguments, index, degree) == (-1, -1)
        np.testing.assert_array_equal(index[: len(slots), 0], np.array(cells)[chosen])
        assert (index[len(slots) :] == -7).all()
        assert (degree[: len(slots)] == 1.0).all()
        assert (degree[len(slots) :] == -7.0).all()
    exact = max(map(abs, starts)) < 100
    for kind in ("f4", "f8", "i1", "i4", ">i8") if exact else ("i8",):
        found = partition(states.astype(kind))[0][:, 0]
        np.testing.assert_array_equal(found, cells)


@given(variables(), st.data())
def test_values_that_are_not_states_are_reported(
    case: tuple[list[int], list[int]], data: st.DataObject
) -> None:
    sizes, starts = case
    states = reference.discrete_states(sizes, starts)[:3].astype(np.float64)
    row = data.draw(st.integers(0, len(states) - 1))
    axis = data.draw(st.integers(0, len(sizes) - 1))
    low, stop = starts[axis], starts[axis] + sizes[axis]
    wrong = [low - 1e3, stop + 1e3, NAN, INF, -INF, 1e300, -1e300]
    if max(abs(low), abs(stop)) < 100:
        wrong += [low - 1.0, float(stop), low + 0.5, np.nextafter(low, INF)]
    states[row, axis] = data.draw(st.sampled_from(wrong))
    expected = (
        rf"whole numbers in {low}\.\.{stop - 1}, got .* in row {row}, variable {axis}\."
    )
    with pytest.raises(ValueError, match=expected):
        Discrete(sizes, starts)(states)
    slots, index = np.arange(len(states)), np.zeros((len(states), 1), dtype=np.int32)
    settings = (slots, np.array(sizes), np.array(starts), index, np.zeros(index.shape))
    assert locate_discrete.py_func(states, *settings) == (row, axis)


@pytest.mark.parametrize("wrong", [-(2**63), 2**63 - 1, -3, 3])
def test_integers_out_of_range_do_not_wrap_round(wrong: int) -> None:
    with pytest.raises(ValueError, match=rf"in -2\.\.2, got {wrong} in row 1\."):
        Discrete(5, -2)(np.array([0, wrong]))
    high = np.array([2**64 - 1], dtype=np.uint64)  # -1 in two's complement
    with pytest.raises(ValueError, match="whole numbers"):
        Discrete(5, -2)(high)
    assert Discrete(5, -2)(np.array([2], dtype=np.uint64))[0].tolist() == [[4]]


SPACES = [
    (spaces.Discrete(5), ()),
    (spaces.Discrete(5, start=-2), ()),
    (spaces.Discrete(1, start=7), ()),
    (spaces.MultiDiscrete([3, 2, 4]), (3,)),
    (spaces.MultiDiscrete([3, 2], start=[-4, 9]), (2,)),
    (spaces.MultiDiscrete([[2, 3], [1, 2]], start=[[0, 1], [5, -1]]), (2, 2)),
    (spaces.MultiBinary(4), (4,)),
    (spaces.MultiBinary([2, 3]), (2, 3)),
]


@pytest.mark.parametrize(("space", "shape"), SPACES, ids=str)
def test_every_element_of_a_space_has_its_own_cell(
    space: Any, shape: tuple[int, ...]
) -> None:
    partition = Discrete.from_space(space)
    states = partition.cell_states()
    n = partition.n_cells
    assert partition.state_ndim == len(shape)
    assert states.shape == (n, *shape)
    assert len(np.unique(states.reshape(n, -1), axis=0)) == n
    for cell, state in enumerate(states):
        element = state.astype(space.dtype) if shape else state
        assert space.contains(element)
        assert partition(state[None])[0].item() == cell
    # The batches that vector environments hand out are of this form.
    batch = batch_space(space, 50)
    batch.seed(1)
    drawn = batch.sample()
    index, degree = partition(drawn)
    np.testing.assert_array_equal(states[index[:, 0]], drawn)
    np.testing.assert_array_equal(degree.sum(axis=1), 1.0)
    partition.check_space(space)


@pytest.mark.parametrize(("space", "shape"), SPACES, ids=str)
def test_settings_build_it_again(space: Any, shape: tuple[int, ...]) -> None:
    partition = Discrete.from_space(space)
    settings = json.loads(json.dumps(partition.settings()))
    again = partition_from_settings(settings)
    assert isinstance(again, Discrete)
    assert again.settings() == partition.settings()
    assert again.state_ndim == len(shape)
    np.testing.assert_array_equal(again.cell_states(), partition.cell_states())
    again.check_space(space)


def test_repr_shows_sizes_and_starts() -> None:
    assert repr(Discrete(5)) == "Discrete(5)"
    assert repr(Discrete(5, -1)) == "Discrete(5, starts=-1)"
    assert repr(Discrete([2, 3], 1)) == "Discrete([2, 3], starts=[1, 1])"


def test_it_keeps_its_own_numbers() -> None:
    sizes, starts = np.array([2, 3]), np.array([0, 1])
    partition = Discrete(sizes, starts)
    sizes[:], starts[:] = 9, 9
    assert partition.settings()["sizes"] == [2, 3]
    assert partition.settings()["starts"] == [0, 1]


@pytest.mark.parametrize(
    "sizes",
    [0, -1, [], [2, 0], 2.0, [2.0], "3", None, True, [True], [[1, 2], [3]], [2, None]],
    ids=str,
)
def test_bad_sizes_are_refused(sizes: Any) -> None:
    with pytest.raises(ValueError, match=r"^sizes must be"):
        Discrete(sizes)


@pytest.mark.parametrize("starts", [[0], [0, 0, 0], [[0, 0]], 0.5, "0", None, 2**60])
def test_bad_starts_are_refused(starts: Any) -> None:
    with pytest.raises(ValueError, match=r"^starts must"):
        Discrete([2, 3], starts)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Discrete(2**31),
        lambda: Discrete([2**33, 2**33]),
        lambda: Discrete.from_space(spaces.MultiBinary(31)),
    ],
)
def test_too_many_cells_are_refused_before_they_are_made(make: Any) -> None:
    with pytest.raises(ValueError, match=r"fewer than 2\^31 cells, got"):
        make()
    assert Discrete(2**31 - 1)([2**31 - 2])[0].item() == 2**31 - 2


@pytest.mark.parametrize(
    ("sizes", "states"),
    [
        (5, 3),
        (5, [[3]]),
        (5, "3"),
        (5, ["3"]),
        (5, [1j]),
        (5, [None]),
        ([2, 2], [0, 1]),
        ([2, 2], [[0, 1, 1]]),
        ([2, 2], [[[0, 1]]]),
        ([2, 2], [[0, 1], [0]]),
        ([[2, 2]], [[0, 1]]),
    ],
    ids=str,
)
def test_bad_states_are_refused(sizes: Any, states: Any) -> None:
    with pytest.raises(ValueError, match=r"^states must"):
        Discrete(sizes)(states)


def test_no_states_have_no_cells() -> None:
    assert Discrete(5)(np.empty(0))[0].shape == (0, 1)
    assert Discrete([2, 2])(np.empty((0, 2)))[1].shape == (0, 1)


@pytest.mark.parametrize(
    "space", [spaces.Box(0, 1, (2,)), spaces.Tuple([spaces.Discrete(2)]), None, 4]
)
def test_other_spaces_are_refused(space: Any) -> None:
    with pytest.raises(ValueError, match=r"^space must be Discrete, MultiDiscrete"):
        Discrete.from_space(space)


@pytest.mark.parametrize(
    ("space", "remedy"),
    [
        (spaces.Discrete(6), "from_space"),
        (spaces.Discrete(5, start=1), "from_space"),
        (spaces.MultiDiscrete([5]), "from_space"),
        (spaces.MultiBinary(5), "from_space"),
        (spaces.Box(0, 1, (1,)), "automatic_partition"),
    ],
)
def test_a_space_that_does_not_fit_is_refused(space: Any, remedy: str) -> None:
    with pytest.raises(ValueError, match=rf"^Discrete\(5\) takes .* got .*{remedy}"):
        Discrete(5).check_space(space)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(0, 1, (3,)),
        spaces.Box(0, 1, (1, 2)),
        spaces.Discrete(2),
        spaces.MultiDiscrete([2, 2]),
    ],
)
def test_a_grid_wants_a_box_of_its_variables(space: Any) -> None:
    grid = Fuzzy([[0.0, 1.0], [0.0, 1.0]])
    grid.check_space(spaces.Box(-9, 9, (2,)))
    with pytest.raises(ValueError, match=r"Box of shape \(2,\), got"):
        grid.check_space(space)


@pytest.mark.parametrize(
    "settings",
    [
        {"type": "Discrete", "sizes": 5},
        {"type": "Discrete", "starts": 0},
        {"type": "Discrete", "sizes": "many", "starts": 0},
        {"type": "Discrete", "sizes": [2, 2], "starts": [0, 0, 0]},
    ],
)
def test_settings_of_something_else_are_refused(settings: Any) -> None:
    with pytest.raises(ValueError, match=r"^(settings|sizes|starts) must"):
        partition_from_settings(settings)
