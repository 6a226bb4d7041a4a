"""Angles that are observed as cosine and sine are circular variables of grids."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import Crisp, Fuzzy, ReturningACL, WaitingVectorEnv
from acl_gym.partitions.growing import carried_over, initial_partition, widened
from acl_gym.partitions.settings import partition_from_settings
from acl_gym.utils.angles import Angles, find_angles

CIRCLE = [0.0, math.pi / 2, math.pi, 3 * math.pi / 2]
LINE = [-1.0, 0.0, 2.0]
KINDS = pytest.mark.parametrize("kind", [Crisp, Fuzzy])


@KINDS
@given(
    angle=st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=5),
    other=st.floats(-3.0, 3.0),
    length=st.floats(1e-3, 1e3),
    order=st.permutations([0, 1, 2]),
)
def test_cells_are_those_of_the_angle(
    kind: Any, angle: list[float], other: float, length: float, order: list[int]
) -> None:
    """Wherever cosine and sine are in an observation, and whatever their length is."""
    plain = kind([CIRCLE, LINE], [2 * math.pi, None])
    cosine, sine, third = order
    lines = [LINE, LINE]
    lines[0 if cosine < third else 1] = CIRCLE
    grid = kind(lines, angles=[(cosine, sine)])
    seen = np.empty((len(angle), 3))
    seen[:, cosine] = length * np.cos(angle)
    seen[:, sine] = length * np.sin(angle)
    seen[:, third] = other
    values = np.random.default_rng(0).normal(size=plain.n_cells)
    table = values.reshape(4, 3)
    mine = (table if cosine < third else table.T).ravel()
    index, degree = grid(seen)
    found = np.sum(degree * mine[index], axis=1)
    index, degree = plain(np.column_stack([angle, np.full(len(angle), other)]))
    expected = np.sum(degree * values[index], axis=1)
    if kind is Fuzzy:
        np.testing.assert_allclose(found, expected, atol=1e-9)
    else:  # halfway between two centres rounding decides
        clear = np.abs(np.mod(np.array(angle) + math.pi / 4, math.pi / 2)) > 1e-9
        assert np.array_equal(found[clear], expected[clear])


@KINDS
def test_the_states_of_cells_are_observations(kind: Any) -> None:
    grid = kind([LINE, CIRCLE], angles=[(2, 0)])
    states = grid.cell_states()
    assert states.shape == (12, 3)
    index, degree = grid(states)
    found = np.take_along_axis(index, degree.argmax(axis=1)[:, None], axis=1)
    assert np.array_equal(found.ravel(), np.arange(12))
    np.testing.assert_allclose(degree.max(axis=1), 1.0, atol=1e-12)
    again = grid.observations(grid.variables(states))
    np.testing.assert_allclose(again, states, atol=1e-12)
    assert grid.columns == (1, 2)


def test_observations_and_variables_without_angles_are_the_same() -> None:
    grid, states = Fuzzy([LINE]), np.array([[1.0]])
    assert grid.variables(states) is states
    assert grid.observations(states) is states


@KINDS
def test_settings_pickles_and_finer_grids_keep_angles(kind: Any) -> None:
    grid = kind([CIRCLE, LINE], angles=[(0, 2)])
    for made in (
        partition_from_settings(grid.settings()),
        pickle.loads(pickle.dumps(grid)),
        copy.deepcopy(grid),
        grid.refined(0),
        grid.refined(1),
        grid.refine(1, [0.5]),
    ):
        assert made.angles == grid.angles == ((0, 2),)
        assert made.periods == (2 * math.pi, None)
        assert made(np.array([[0.0, 0.1, 1.0]]))[0].shape == (1, grid.cells_per_state)
    assert "angles=[(0, 2)]" in repr(grid)
    assert "angles" not in kind([LINE]).settings()


def test_a_table_carried_over_says_the_same() -> None:
    rng = np.random.default_rng(1)
    coarse = Fuzzy([CIRCLE, LINE], angles=[(0, 1)])
    fine = coarse.refined(0).refined(1)
    table = rng.normal(size=(coarse.n_cells, 2))
    carried = carried_over(table, coarse, fine)
    angle = rng.uniform(-4.0, 4.0, 100)
    seen = np.column_stack([np.cos(angle), np.sin(angle), rng.uniform(-2, 3, 100)])
    (i, b), (j, c) = coarse(seen), fine(seen)
    np.testing.assert_allclose(
        np.einsum("nk,nka->na", b, table[i]),
        np.einsum("nk,nka->na", c, carried[j]),
        atol=1e-9,
    )


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        ([(0, 0)], "different numbers"),
        ([(0, 1, 2)], "pairs of different numbers"),
        ([(0, 3)], r"among the 0\.\.2 "),
        ([(0, -1)], "among the"),
        ([(0, 1.0)], "pairs of"),
        ([(True, 0)], "pairs of"),
        ([(0, 1), (1, 2)], "each pair is one of the 2 variables"),
        ([(0, 1), (2, 3), (4, 5)], "one of the 2 variables"),
        ([0, 1], "pairs of"),
        (3, "pairs"),
        ("ab", "pairs"),
    ],
)
def test_angles_that_are_none_are_refused(angles: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"angles must be.*{words}"):
        Fuzzy([CIRCLE, LINE], angles=angles)


def test_the_period_of_an_angle_is_a_full_circle() -> None:
    assert Fuzzy([CIRCLE], [2 * math.pi], [(0, 1)]).periods == (2 * math.pi,)
    with pytest.raises(ValueError, match=r"periods\[0\] must be 2 pi or None"):
        Fuzzy([CIRCLE], [3.0], [(0, 1)])
    with pytest.raises(ValueError, match="must span less than their period"):
        Fuzzy([[0.0, 7.0]], angles=[(0, 1)])


@KINDS
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_observations_must_be_finite(kind: Any, wrong: float, column: int) -> None:
    grid, seen = kind([CIRCLE, LINE], angles=[(0, 1)]), np.zeros((2, 3))
    seen[1, column] = wrong
    with pytest.raises(ValueError, match="states must be finite"):
        grid(seen)
    index, degree = np.zeros((1, grid.cells_per_state), np.int32), np.zeros((1, 1))
    degree = np.zeros(index.shape)
    grid.locate(seen, np.array([0]), index, degree)  # the other one is not looked at
    assert degree.sum() == pytest.approx(1.0)


def test_the_observation_of_a_space_has_all_columns() -> None:
    grid = Fuzzy([CIRCLE, LINE], angles=[(0, 1)])
    grid.check_space(spaces.Box(-1.0, 1.0, (3,)))
    with pytest.raises(ValueError, match=r"Box of shape \(3,\)"):
        grid.check_space(spaces.Box(-1.0, 1.0, (2,)))
    with pytest.raises(ValueError, match=r"shape \(n, 3\), got \(1, 2\)"):
        grid(np.zeros((1, 2)))


def seen(n: int = 50, dtype: Any = np.float32) -> Any:
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-9.0, 9.0, (2, n))
    return np.column_stack(
        [np.cos(a), b / 9.0, np.sin(b), np.sin(a), np.cos(b), np.full(n, 0.6)]
    ).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_angles_are_found(dtype: Any) -> None:
    found = [(0, 3), (2, 4)]
    assert find_angles(seen(dtype=dtype)) == (found if dtype != np.float16 else [])


def test_what_is_constant_or_misses_once_is_no_angle() -> None:
    assert find_angles(np.full((9, 2), math.sqrt(0.5))) == []
    almost = seen()
    almost[7, 3] += 0.01
    assert find_angles(almost) == [(2, 4)]
    assert find_angles(np.zeros((3, 0))) == []


def test_a_few_flags_are_no_angle() -> None:
    """Of which one is set every time: so do the squares of a cosine and a sine add up."""
    flags = np.eye(2)[[0, 1, 1, 0, 1] * 60]
    assert find_angles(flags) == []
    nine = np.linspace(0.0, 1.0, 9)
    directions = np.column_stack([np.cos(nine), np.sin(nine)])
    assert find_angles(np.repeat(directions, 30, axis=0)) == []
    assert find_angles(np.vstack([directions, [[0.0, 1.0]]])) == [(0, 1)]


def test_a_partition_takes_angles_before_it_knows_ranges() -> None:
    space = spaces.Box(-np.inf, np.inf, (6,), np.float64)
    begun = initial_partition(_spaced(space), 20_000)
    wide = widened(begun, seen(), space, 20_000)
    assert wide is not None
    assert wide.angles == ((0, 3), (2, 4))
    assert wide.columns == (0, 1, 2, 5)
    assert [line.size for line in wide.centres] == [8, 7, 8, 1]
    assert wide.centres[1][0] < -0.9
    assert wide.centres[1][-1] > 0.9
    assert widened(wide, seen(), space, 20_000) is None
    further = seen()
    further[0, 1] = 5.0
    wider = widened(wide, further, space, 20_000)
    assert wider is not None
    assert wider.angles == wide.angles
    assert wider.centres[1][-1] > 5.0


def test_variables_that_have_a_range_stay_as_they_are() -> None:
    grid = Fuzzy([[-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])
    a = np.linspace(-3.0, 3.0, 50)
    box = spaces.Box(-1.0, 1.0, (2,), np.float64)
    assert widened(grid, np.column_stack([np.cos(a), np.sin(a)]), box, 20_000) is None


def _spaced(space: spaces.Box) -> Any:
    class Env(gym.Env[Any, Any]):
        observation_space = space
        action_space = spaces.Discrete(2)

    return Env()


def test_the_angles_of_acrobot_are_found() -> None:
    env = WaitingVectorEnv.make("Acrobot-v1", 2)
    colony = ReturningACL(env, seed=0, max_steps=50).learn(trials=2)
    partition: Any = colony.partition
    assert partition.angles == ((0, 1), (2, 3))
    assert partition.cells_per_state == 16
    assert len(partition.centres) == 4
    assert colony.predict(env.reset(seed=1)[0])[0].shape == (2,)


def test_angles_are_equal_if_they_read_alike() -> None:
    assert Angles([(2, 3), (0, 1)], 2) == Angles([(0, 1), (2, 3)], 2)
    assert len({Angles([(0, 1)], 2), Angles([(0, 1)], 2), Angles([(1, 0)], 2)}) == 2
    assert Angles([], 2) != Angles([], 3)
