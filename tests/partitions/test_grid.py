"""Partitions against (4.2), (4.7) and (4.8), and along the circle."""

import json
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.envs.pendulum import Pendulum
from acl_gym.partitions import Crisp, Fuzzy, partition_from_settings
from acl_gym.partitions import kernels as module
from tests.partitions import reference_partition as reference

Grid = tuple[list[np.ndarray], list[float | None], np.ndarray]
TWO_PI = 2 * np.pi
# Both kinds, over a circular, an irregular and a lone axis.
CENTRES = [np.arange(5) * TWO_PI / 5, np.array([-2.0, -0.5, 0.0, 3.0]), np.array([1.0])]
PERIODS = [TWO_PI, None, None]


@given(reference.grids())
def test_fuzzy_degrees_are_those_of_the_equations(grid: Grid) -> None:
    centres, periods, states = grid
    ours = reference.dense(Fuzzy(centres, periods), states)
    expected = [reference.fulfilment(x, centres, periods) for x in states]
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
@given(grid=reference.grids())
def test_degrees_are_a_distribution_over_cells(kind: Any, grid: Grid) -> None:
    centres, periods, states = grid
    partition = kind(centres, periods)
    index, degree = partition(states)
    several = sum(len(axis) > 1 for axis in centres)
    k = 2**several if kind is Fuzzy else 1
    assert partition.cells_per_state == k
    assert partition.n_cells == np.prod([a.size for a in centres])
    assert (index.shape, index.dtype) == ((len(states), k), np.int32)
    assert (degree.shape, degree.dtype) == ((len(states), k), np.float64)
    assert index.min() >= 0
    assert index.max() < partition.n_cells
    assert degree.min() >= 0.0
    assert np.abs(degree.sum(axis=1) - 1.0).max() < 1e-12
    for cells, degrees in zip(index, degree, strict=True):
        taken = cells[degrees > 0.0]
        assert np.unique(taken).size == taken.size


@given(reference.grids())
def test_crisp_is_the_nearest_centre(grid: Grid) -> None:
    centres, periods, states = grid
    index, degree = Crisp(centres, periods)(states)
    assert np.all(degree == 1.0)
    shape = [a.size for a in centres]
    chosen = np.array(np.unravel_index(index[:, 0], shape)).T
    for state, cells in zip(states, chosen, strict=True):
        for x, cell, a, period in zip(state, cells, centres, periods, strict=True):
            away = reference.nearest_distance(x, a, period)
            assert away[cell] <= away.min() + 1e-12


@given(reference.grids())
def test_crisp_takes_the_largest_fuzzy_degree(grid: Grid) -> None:
    centres, periods, states = grid
    index, _ = Crisp(centres, periods)(states)
    beta = reference.dense(Fuzzy(centres, periods), states)
    taken = np.take_along_axis(beta, index.astype(np.int64), axis=1)[:, 0]
    assert np.all(taken >= beta.max(axis=1) - 1e-12)


@pytest.mark.parametrize("last", [3.0, 4.0], ids=["regular", "irregular"])
@pytest.mark.parametrize(
    ("x", "cell"),
    [(0.5, 1), (np.nextafter(0.5, 0.0), 0), (1.5, 2), (np.nextafter(1.5, 0.0), 1)],
)
def test_half_way_belongs_to_the_upper_cell(x: float, cell: int, last: float) -> None:
    partition = Crisp([[0.0, 1.0, 2.0, last]])
    assert partition([[x]])[0].item() == cell
    assert partition([[(2.0 + last) / 2]])[0].item() == 3


@pytest.mark.parametrize(("x", "cell"), [(3.5, 0), (-0.5, 0), (3.4, 3), (7.5, 0)])
def test_half_way_across_the_seam(x: float, cell: int) -> None:
    # The first centre, one period on, is the upper of the two.
    assert Crisp([[0, 1, 2, 3]], [4.0])([[x]])[0].item() == cell


@given(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3), st.floats(-9, 9))
def test_lone_cells_make_fuzzy_crisp(state: list[float], centre: float) -> None:
    for periods in (None, [TWO_PI, None, 1.0]):
        for kind in (Crisp, Fuzzy):
            partition = kind([[centre]] * 3, periods)
            assert partition.n_cells == 1
            assert reference.dense(partition, np.array([state])).tolist() == [[1.0]]


@given(reference.grids(), st.integers(-9, 9))
def test_whole_periods_change_nothing(grid: Grid, turns: int) -> None:
    centres, periods, states = grid
    partition = Fuzzy(centres, periods)
    moved = states + turns * np.array([period or 0.0 for period in periods])
    ours, expected = (reference.dense(partition, x) for x in (moved, states))
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=1e-10)


@given(reference.axes(), st.floats(-60.0, 60.0), st.floats(0.0, 1e-3))
def test_degrees_are_continuous(
    axis: tuple[np.ndarray, float | None], x: float, shift: float
) -> None:
    centres, period = axis
    # Gaps are at least 0.05: no degree changes faster than 20 in one unit of x.
    ours = reference.dense(Fuzzy([centres], [period]), np.array([[x], [x + shift]]))
    assert np.abs(ours[1] - ours[0]).max() <= 20.0 * shift + 1e-10


@pytest.mark.parametrize("cells", [1, 2, 3, 40])
def test_the_circle_has_no_seam(cells: int) -> None:
    partition = Fuzzy([np.arange(cells) * TWO_PI / cells], [TWO_PI])
    around = [0.0, TWO_PI, -TWO_PI, np.nextafter(TWO_PI, 0.0), -1e-300, 5e-324]
    beta = reference.dense(partition, np.array(around)[:, None])
    np.testing.assert_allclose(beta - np.eye(cells)[0], 0.0, atol=1e-14)


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_far_outside_means_the_outermost_cell(kind: Any) -> None:
    partition = kind([[-1.0, 0.0, 2.0]])
    far = np.array([[-1e308], [-1.0], [2.0], [1e308]])
    expected = np.eye(3)[[0, 0, 2, 2]]
    np.testing.assert_array_equal(reference.dense(partition, far), expected)
    # So far round a circle there is no telling where; it is still somewhere.
    circle = kind([[-1.0, 0.0, 2.0]], [4.0])
    for beta in reference.dense(circle, np.array([[-1e308], [1e17], [1e308]])):
        assert beta.min() >= 0.0
        assert beta.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_from_box_spreads_the_centres_of_the_pendulum(kind: Any) -> None:
    space = Pendulum().observation_space
    partition = kind.from_box(space, [40, 41], circular=[0])
    theta = [2 * np.pi * i / 40 for i in range(40)]
    omega = [-9.0 + 2 * 9.0 * i / 40 for i in range(41)]
    np.testing.assert_allclose(partition.centres[0], theta, rtol=0, atol=1e-14)
    np.testing.assert_allclose(partition.centres[1], omega, rtol=0, atol=1e-14)
    assert partition.periods == (TWO_PI, None)
    # Both equilibria are centres.
    for state in ([0.0, 0.0], [np.pi, 0.0]):
        assert reference.dense(partition, np.array([state])).max() > 1.0 - 1e-12


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64])
def test_from_box_of_any_type(dtype: Any) -> None:
    space = spaces.Box(-2, 2, (2,), dtype=dtype)
    partition = Fuzzy.from_box(space, 5)
    for axis in partition.centres:
        assert axis.tolist() == [-2.0, -1.0, 0.0, 1.0, 2.0]
    assert partition.periods == (None, None)


@pytest.mark.parametrize("cells", [np.int64(5), np.array([5, 5]), (5, np.int32(5))])
def test_from_box_takes_numbers_of_numpy(cells: Any) -> None:
    space = spaces.Box(-2.0, 2.0, (2,))
    assert Fuzzy.from_box(space, cells).n_cells == 25


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_cells_are_in_the_order_of_the_equations(kind: Any) -> None:
    partition = kind(CENTRES, PERIODS)
    states = partition.cell_states()
    expected = [(a, b, c) for a in CENTRES[0] for b in CENTRES[1] for c in CENTRES[2]]
    np.testing.assert_array_equal(states, expected)
    np.testing.assert_array_equal(reference.dense(partition, states), np.eye(20))


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_refine_adds_centres_along_one_axis(kind: Any) -> None:
    partition = kind(CENTRES, PERIODS)
    refined = partition.refine(1, [0.25, -0.5, -0.25, 0.25])
    assert type(refined) is kind
    assert refined.centres[1].tolist() == [-2.0, -0.5, -0.25, 0.0, 0.25, 3.0]
    for axis in (0, 2):
        assert refined.centres[axis].tolist() == CENTRES[axis].tolist()
    assert refined.periods == partition.periods
    assert partition.centres[1].tolist() == CENTRES[1].tolist()


@pytest.mark.parametrize("cells", [40, 50, 82])
def test_refine_skips_centres_that_are_there_but_for_rounding(cells: int) -> None:
    partition = Fuzzy.from_box(Pendulum().observation_space, [cells, 3], circular=[0])
    assert partition.refine(0, [np.pi]).centres[0].size == cells


def some_states(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-8.0, 8.0, (n, 3))


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
@pytest.mark.parametrize("slots", [[], [3], [5, 0, 5, 8], list(range(9))])
def test_some_slots_are_rows_of_all(kind: Any, slots: list[int]) -> None:
    partition = kind(CENTRES, PERIODS)
    states = some_states(9, 1)
    index, degree = partition(states)
    k, m = partition.cells_per_state, len(slots)
    some_index = np.full((9, k), -7, dtype=np.int32)
    some_degree = np.full((9, k), -7.0)
    chosen = np.array(slots, dtype=np.int64)
    partition.locate(states, chosen, some_index, some_degree)
    np.testing.assert_array_equal(some_index[:m], index[chosen])
    np.testing.assert_array_equal(some_degree[:m], degree[chosen])
    assert np.all(some_index[m:] == -7)
    assert np.all(some_degree[m:] == -7.0)


def test_other_slots_need_not_be_finite() -> None:
    partition = Fuzzy(CENTRES, PERIODS)
    states = some_states(3, 2)
    states[1] = np.nan
    index, degree = (
        np.zeros((2, partition.cells_per_state), dtype=np.int32),
        np.zeros((2, partition.cells_per_state)),
    )
    partition.locate(states, np.array([0, 2]), index, degree)
    assert np.all(degree.sum(axis=1) > 1.0 - 1e-12)
    with pytest.raises(ValueError, match=r"row 1\b"):
        partition.locate(states, np.array([2, 1]), index, degree)


@pytest.mark.parametrize(
    "convert",
    [
        lambda x: x.astype(np.float32),
        lambda x: x.astype(np.int64),
        lambda x: x.astype(np.int8),
        lambda x: x.astype(">f8"),
        lambda x: x.tolist(),
        np.asfortranarray,
        lambda x: np.repeat(x, 2, axis=0)[::2],
        lambda x: np.repeat(x, 2, axis=1)[:, ::2],
    ],
)
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_states_of_any_real_type(kind: Any, convert: Any) -> None:
    partition = kind(CENTRES, PERIODS)
    states = convert(some_states(6, 3))
    plain = np.array(states, dtype=np.float64)
    for ours, expected in zip(partition(states), partition(plain), strict=True):
        np.testing.assert_array_equal(ours, expected)


def test_states_and_results_are_not_shared() -> None:
    partition = Fuzzy(CENTRES, PERIODS)
    states = some_states(4, 4)
    kept = states.copy()
    first, second = partition(states), partition(states)
    np.testing.assert_array_equal(states, kept)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)
        assert not np.shares_memory(one, other)
    centres = np.array([0.0, 1.0, 2.0])
    owner = Fuzzy([centres])
    centres[:] = 5.0
    assert owner.centres[0].tolist() == [0.0, 1.0, 2.0]


@given(reference.axes(), st.data())
def test_shortcut_of_regular_axes_is_the_search(
    axis: tuple[np.ndarray, float | None], data: st.DataObject
) -> None:
    centres, period = axis
    edges = centres if period is None else np.append(centres, centres[0] + period)
    length = period or 0.0
    gaps = np.diff(edges)
    rate = float(1.0 / gaps.mean()) if gaps.size else 0.0
    x = data.draw(reference.positions(edges))
    near = np.array([x, np.nextafter(x, -np.inf), np.nextafter(x, np.inf)])

    def find(kernel: Any, rate: float) -> list[list[float]]:
        low, fraction = np.empty(3, np.int32), np.empty(3)
        scratch = np.empty((2, 3))
        kernel(near.copy(), edges, length, rate, low, fraction, *scratch)
        return [low.tolist(), fraction.tolist()]

    searched = find(module.locate_on_axis, 0.0)
    assert find(module.locate_on_axis, rate) == searched
    # Without the compiler it is the same.
    assert find(module.locate_on_axis.py_func, rate) == searched
    assert find(module.locate_on_axis.py_func, 0.0) == searched


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_many_states_are_located_as_one_by_one(kind: Any) -> None:
    partition = kind(CENTRES, PERIODS)
    states = some_states(3 * module.BLOCK + 5, 5)
    index, degree = partition(states)
    for row in (0, module.BLOCK - 1, module.BLOCK, 2 * module.BLOCK + 7, -1):
        one_index, one_degree = partition(states[[row]])
        np.testing.assert_array_equal(index[[row]], one_index)
        np.testing.assert_array_equal(degree[[row]], one_degree)
    for row in (3, module.BLOCK + 3, 3 * module.BLOCK + 4):
        broken = states.copy()
        broken[row, 1] = np.nan
        with pytest.raises(ValueError, match=f"finite.* in row {row}"):
            partition(broken)


def test_nearly_regular_axes_are_searched_alike() -> None:
    regular = np.linspace(-9.0, 9.0, 41)
    bent = regular.copy()
    bent[17] += 1e-7
    states = np.linspace(-10.0, 10.0, 5003)[:, None]
    for kind in (Crisp, Fuzzy):
        ours, other = kind([regular]), kind([bent])
        assert (ours._axes[4][0] > 0.0, other._axes[4][0] > 0.0) == (True, False)
        beta, expected = (reference.dense(p, states) for p in (ours, other))
        same = np.abs(beta - expected).max(axis=1) < 1e-6
        # A crisp cell may change for the few states next to the moved border.
        assert same.mean() > 0.999
        assert kind is Crisp or same.all()


@pytest.mark.parametrize("fuzzy", [False, True])
def test_kernel_runs_the_same_without_the_compiler(fuzzy: bool) -> None:
    partition = Fuzzy(CENTRES, PERIODS) if fuzzy else Crisp(CENTRES, PERIODS)
    states = some_states(12, 5)
    index = np.zeros((12, partition.cells_per_state), dtype=np.int32)
    degree = np.zeros(index.shape)
    settings = (partition._edges, partition._axes, fuzzy)
    bad = module.locate.py_func(states, np.arange(12), *settings, index, degree)
    assert bad == -1
    np.testing.assert_array_equal(index, partition(states)[0])
    np.testing.assert_allclose(degree, partition(states)[1], rtol=1e-14)
    states[7, 1] = np.inf
    bad = module.locate.py_func(states, np.arange(12), *settings, index, degree)
    assert bad == 7


@given(reference.grids())
def test_settings_build_it_again(grid: Grid) -> None:
    centres, periods, states = grid
    for kind in (Crisp, Fuzzy):
        partition = kind(centres, periods)
        settings = json.loads(json.dumps(partition.settings()))
        again = partition_from_settings(settings)
        assert type(again) is kind
        assert again.settings() == partition.settings()
        for ours, theirs in zip(again(states), partition(states), strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_repr_shows_the_shape() -> None:
    assert repr(Fuzzy(CENTRES, PERIODS)) == "Fuzzy(5 x 4 x 1 cells, circular=[0])"
