"""What pictures of tours show."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym.envs.graph import TravellingSalesmanInstance
from acl_gym.envs.graph.pictures import places_of, strongest_arcs
from acl_gym.envs.graph.travelling_salesman import (
    TravellingSalesmanEnv,
    TravellingSalesmanVectorEnv,
)
from acl_gym.envs.graph.travelling_salesman.painter import tour_so_far
from tests.envs.systems import tour_state

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
TOUR_BLUE, FIRST_GREEN, ANT_ORANGE = (0, 114, 178), (0, 158, 115), (213, 94, 0)


def pixels(frame: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Rows and columns of the pixels of a colour."""
    return np.argwhere((frame == colour).all(axis=2))


def frame_after(*cities: int, table: np.ndarray | None = None) -> np.ndarray:
    pytest.importorskip("pygame")
    env = TravellingSalesmanEnv("rgb_array", coordinates=SQUARE, start=0)
    env.show_table(table)
    env.reset()
    for city in cities:
        env.step(city)
    frame = env.render()
    assert frame is not None
    return frame


def test_the_ant_is_at_its_city_and_y_grows_upwards() -> None:
    frame = frame_after(1, 2)
    row, column = pixels(frame, ANT_ORANGE).mean(axis=0)
    assert row < 60
    assert column > 420
    row, column = pixels(frame, FIRST_GREEN).mean(axis=0)
    assert row > 420
    assert column < 60


def test_the_tour_so_far_is_drawn() -> None:
    assert not pixels(frame_after(), TOUR_BLUE).size
    one, all_four = (
        pixels(frame_after(1), TOUR_BLUE),
        pixels(frame_after(1, 2, 3, 0), TOUR_BLUE),
    )
    assert (one[:, 0] > 420).all()  # the lower side only
    # Four sides of one length.
    assert len(all_four) == pytest.approx(4 * len(one), rel=0.05)


def test_pheromone_is_drawn_below_the_tour() -> None:
    table = np.full((4, 4), 0.1)
    table[0, 2] = 1.0  # the diagonal of the square
    table[0, 1] = 0.9  # below the tour
    plain, shown = frame_after(1), frame_after(1, table=table)
    middle = slice(230, 250)
    assert (plain[middle, middle] == 255).all()
    assert shown[middle, middle].min() < 200
    np.testing.assert_array_equal(pixels(plain, TOUR_BLUE), pixels(shown, TOUR_BLUE))


@pytest.mark.parametrize(
    ("table", "error", "message"),
    [
        ([[1.0]], TypeError, "must be a NumPy array, got list"),
        (np.ones((3, 4)), ValueError, r"shape \(4, 4\), got .* of shape \(3, 4\)"),
        (np.full((4, 4), -1.0), ValueError, "finite levels >= 0"),
        (np.full((4, 4), np.nan), ValueError, "finite levels >= 0"),
        (np.full((4, 4), "a"), ValueError, "a row and a column for each city"),
    ],
)
def test_tables_that_cannot_be_drawn(
    table: Any, error: type[Exception], message: str
) -> None:
    for kind in (TravellingSalesmanEnv, TravellingSalesmanVectorEnv):
        with pytest.raises(error, match=message):
            kind(coordinates=SQUARE, render_mode="rgb_array").show_table(table)


@pytest.mark.parametrize(
    "given",
    [
        {"distances": [[0, 1], [1, 0]]},
        {"coordinates": [[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]},
        {"coordinates": [[0.0, 0.0], [1e150, 0.0]]},
        {"instance": "pr2392"},
    ],
)
def test_every_instance_can_be_drawn(given: dict[str, Any]) -> None:
    pytest.importorskip("pygame")
    env = gym.make("acl_gym/TravellingSalesman-v0", render_mode="rgb_array", **given)
    env.reset(options={"state": 0})
    env.step(1)
    frame: Any = env.render()
    assert pixels(frame, ANT_ORANGE).size


def test_cities_without_places_lie_on_a_circle() -> None:
    instance = TravellingSalesmanInstance.from_distances(np.ones((5, 5)))
    places = places_of(instance)
    np.testing.assert_allclose(np.hypot(*places.T), 1.0)
    assert len(np.unique(places.round(6), axis=0)) == 5


def test_the_order_of_a_tour_is_that_of_the_ranks() -> None:
    for visited in ((2,), (2, 0), (2, 0, 3, 1)):
        state = np.array(tour_state(*visited, n_cities=4))
        assert tour_so_far(state).tolist() == list(visited)
    closed = np.array(tour_state(2, 0, 3, 1, n_cities=4))
    closed[0], closed[2] = 2, 4
    assert tour_so_far(closed).tolist() == [2, 0, 3, 1, 2]


def test_the_strongest_arcs() -> None:
    rng = np.random.default_rng(0)
    levels = rng.random((30, 30))
    np.fill_diagonal(levels, 100.0)
    arcs, shares = strongest_arcs(levels)
    assert (arcs[:, 0] != arcs[:, 1]).all()
    assert np.bincount(arcs[:, 0], minlength=30).max() == 8
    assert shares[-1] == 1.0
    assert (np.diff(shares) >= 0.0).all()
    for city in range(30):
        row = np.where(np.arange(30) == city, -1.0, levels[city])
        heads = arcs[arcs[:, 0] == city, 1]
        assert set(heads) == set(np.argsort(row)[-8:])
    few, _ = strongest_arcs(np.array([[0.0, 1.0], [2.0, 0.0]]))
    assert few.tolist() == [[1, 0]]  # the weaker one is the lowest of all
    assert not strongest_arcs(np.ones((4, 4)))[0].size
