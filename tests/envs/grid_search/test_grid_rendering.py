"""Frames of the grids: where everything is, and the arrows of a table."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.grid_search import (
    GridSearch1DEnv,
    GridSearch2DEnv,
    GridSearch2DVectorEnv,
)

WALL, FREE, GOAL = (64, 64, 68), (250, 250, 250), (0, 158, 115)
ANT, BEST, PAPER = (0, 114, 178), (20, 20, 20), (255, 255, 255)
DESC = ["..#.", "...G"]  # wider than high: cells of 117 pixels, the rows in the middle
SIDE, TOP, LEFT = 117, 123, 6


def frame_of(env: ControlEnv, state: int, action: int | None = None) -> np.ndarray:
    env.reset(options={"state": state})
    if action is not None:
        env.step(action)
    frame = env.render()
    assert frame is not None
    return frame


def pixel(frame: np.ndarray, row: float, column: float) -> np.ndarray:
    """The colour at a place counted in cells from the corner of the map."""
    return frame[round(TOP + SIDE * row), round(LEFT + SIDE * column)]


def assert_colour(actual: np.ndarray, expected: tuple[int, int, int]) -> None:
    np.testing.assert_allclose(actual.astype(int), expected, atol=6)


@pytest.fixture
def env() -> GridSearch2DEnv:
    return GridSearch2DEnv(render_mode="rgb_array", desc=DESC)


def test_cells_are_where_the_map_has_them(env: GridSearch2DEnv) -> None:
    frame = frame_of(env, 4)
    for row, line in enumerate(DESC):
        for column, character in enumerate(line):
            colour = {"#": WALL, ".": FREE, "G": GOAL}[character]
            if (row, column) == (1, 1):  # state 4
                colour = ANT
            assert_colour(pixel(frame, row + 0.5, column + 0.5), colour)
            assert not (pixel(frame, row + 0.06, column + 0.06) == ANT).all()
    # Nothing is drawn around the map.
    assert_colour(frame[: TOP - 10].reshape(-1, 3).min(axis=0), PAPER)
    assert_colour(frame[TOP + 2 * SIDE + 10 :].reshape(-1, 3).min(axis=0), PAPER)


@pytest.mark.parametrize(
    ("action", "state", "tip"),
    [
        (0, 1, (0.08, 1.5)),
        (1, 4, (1.92, 1.5)),
        (2, 5, (1.5, 2.92)),
        (3, 3, (1.5, 0.08)),
    ],
)
def test_the_ant_points_where_it_tried_to_go(
    env: GridSearch2DEnv, action: int, state: int, tip: tuple[float, float]
) -> None:
    frame = frame_of(env, 4, action)
    row, column = env.system.cells[state] + 0.5
    assert_colour(pixel(frame, row, column), ANT)
    assert_colour(pixel(frame, *tip), ANT)
    # Without an action there is no tip.
    assert_colour(pixel(frame_of(env, state), *tip), FREE)


def test_a_row_is_a_row() -> None:
    frame = frame_of(GridSearch1DEnv(render_mode="rgb_array"), 0)
    ink = (frame != 255).any(axis=-1)
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    assert 40 < np.ptp(rows) < 60
    assert np.ptp(columns) > 460
    assert abs(rows.mean() - 239.5) < 2
    assert abs(columns.mean() - 239.5) < 2


def one_best(n_states: int, n_actions: int, action: int) -> np.ndarray:
    table = np.full((n_states, n_actions), 0.1)
    table[:, action] = 1.0
    return table


@pytest.mark.parametrize(
    ("action", "ahead"), [(0, (-1, 0)), (1, (1, 0)), (2, (0, 1)), (3, (0, -1))]
)
def test_arrows_point_to_the_best_action(
    env: GridSearch2DEnv, action: int, ahead: tuple[int, int]
) -> None:
    table = one_best(env.system.n_states, 4, action)
    env.show_table(table)
    frame = frame_of(env, 4)
    for row, column in env.system.cells:
        if DESC[row][column] == "G":
            continue
        centre = np.array([row, column]) + 0.5
        assert_colour(pixel(frame, *(centre + 0.25 * np.array(ahead))), BEST)
        beside = centre + 0.25 * np.array(ahead[::-1])
        assert (pixel(frame, *beside) != BEST).any()
    assert_colour(pixel(frame, 1.5, 3.5), GOAL)  # no arrow in the goal


def darkness(frame: np.ndarray) -> int:
    return int((255 - frame.astype(int)).sum())


def test_arrows_grow_with_their_share(env: GridSearch2DEnv) -> None:
    inks = []
    for share in (0.05, 0.2, 0.4):
        table = one_best(env.system.n_states, 4, 2)
        table[0] = [0.0, share, 1.0 - share, 0.0]
        env.show_table(table)
        frame = frame_of(env, 6)
        corner = frame[TOP + 75 : TOP + 110, LEFT + 5 : LEFT + 110]  # south, state 0
        inks.append(darkness(corner))
    assert inks[0] < inks[1] < inks[2]


def test_no_action_is_best_where_levels_tie(env: GridSearch2DEnv) -> None:
    plain = frame_of(env, 6)
    for level in (0.0, 0.5):
        env.show_table(np.full((env.system.n_states, 4), level))
        frame = frame_of(env, 6)
        cell = frame[TOP + 5 : TOP + 110, LEFT + 5 : LEFT + 110]
        assert cell.min() > 100
        assert darkness(frame) > darkness(plain)


def test_frames_follow_the_table(env: GridSearch2DEnv) -> None:
    plain = frame_of(env, 4)
    table = one_best(env.system.n_states, 4, 0)
    env.show_table(table)
    first = env.render()
    table[:] = one_best(env.system.n_states, 4, 1)
    second = env.render()
    assert (first != plain).any()
    assert (first != second).any()
    env.show_table(None)
    np.testing.assert_array_equal(env.render(), plain)


@pytest.mark.parametrize("name", ["11x11", "31x31"])
def test_slots_show_the_table_of_single_environments(name: str) -> None:
    vector = GridSearch2DVectorEnv(2, map_name=name, render_mode="rgb_array")
    single = GridSearch2DEnv(map_name=name, render_mode="rgb_array")
    table = np.random.default_rng(1).random((single.system.n_states, 4))
    vector.reset(options={"state": [3, 60]})
    vector.show_table(table)
    single.show_table(table)
    for state, frame in zip((3, 60), vector.render(), strict=True):
        np.testing.assert_array_equal(frame, frame_of(single, state))


def test_a_window_shows_a_table() -> None:
    env = gym.make("acl_gym/GridSearch1D-v0", render_mode="human")
    env.reset(seed=0)
    env.unwrapped.show_table(np.ones((10, 2)))
    env.step(1)
    env.close()


@pytest.mark.parametrize(
    ("table", "error", "message"),
    [
        ([[1.0, 1.0]] * 10, TypeError, "NumPy array, got list"),
        (np.ones((9, 2)), ValueError, r"shape \(10, 2\), got \(9, 2\)"),
        (np.ones((10, 4)), ValueError, r"shape \(10, 2\), got \(10, 4\)"),
        (np.full((10, 2), -1.0), ValueError, "levels >= 0"),
        (np.full((10, 2), np.nan), ValueError, "finite levels"),
        (np.full((10, 2), np.inf), ValueError, "finite levels"),
    ],
)
def test_bad_tables_are_refused(
    table: Any, error: type[Exception], message: str
) -> None:
    env = GridSearch1DEnv(render_mode="rgb_array")
    plain = frame_of(env, 3)
    with pytest.raises(error, match=message):
        env.show_table(table)
    np.testing.assert_array_equal(env.render(), plain)
