"""When partitions grow, and what is known of a grown one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from acl_gym import Crisp, Discrete, Fuzzy
from acl_gym.agents.growth import Growth, carried_with_known
from acl_gym.colony.memory import UNITS

GRID = Crisp([[0.0, 1.0], [0.5], [0.0, 1.0, 2.0]])  # 6 cells


LEVELS = np.zeros((6, 2))


def evidence(*tries: float, pairs: int = 12) -> Any:
    counted = np.zeros(pairs, np.int64)
    counted[: len(tries)] = np.rint(np.array(tries) * UNITS)
    return counted


def of_cells(tries: Any) -> Any:
    """Evidence of a grid of so many tries a cell, all of the first of two actions."""
    counted = np.stack([tries, np.zeros_like(tries)], axis=-1)
    return np.rint(counted * UNITS).astype(np.int64).ravel()


def test_axes_take_turns_and_lone_centres_are_left_out() -> None:
    growth, grid, sizes = Growth(True), GRID, []
    for _ in range(3):
        # 0.5 tries of each pair, 0.25 for each variable that varies.
        tries = np.full(grid.n_cells * 2, 0.5 * UNITS)
        levels = np.zeros((grid.n_cells, 2))
        finer = growth.finer(grid, tries.astype(np.int64), levels, 0.2, 1_000)
        assert finer is not None
        grid = finer
        sizes.append([line.size for line in grid.centres])
    assert sizes == [[3, 1, 3], [3, 1, 5], [5, 1, 5]]
    assert growth.turn == 3


def test_the_tries_of_an_average_pair_decide() -> None:
    """24 tries of 12 pairs are 2 for each, and 1 for each of two variables."""
    tries, growth = evidence(6.0, 9.0, 9.0), Growth(True, "everywhere")
    assert growth.finer(GRID, tries, LEVELS, 1.0, 1_000) is None
    assert growth.finer(GRID, tries, LEVELS, 0.99, 1_000) is not None
    line = Fuzzy([[0.0, 1.0, 2.0], [0.5]])  # one variable: the other does not vary
    of_line = evidence(6.0, 3.0, 3.0, pairs=6), np.zeros((3, 2))
    assert growth.finer(line, *of_line, 1.99, 1_000) is not None
    assert growth.finer(line, *of_line, 2.0, 1_000) is None


CROWDED = np.zeros((6, 3))
"""Tries of 6 x 3 cells, a hundred in all, and so 2.8 of each of 36 pairs.

In the six pairs of each of the rows 2 and 3 there are 8.3, also on the average of both. On
that of other rows or columns and their neighbours there are at most 4.2.
"""
CROWDED[2, 1] = CROWDED[3, 1] = 50.0


@pytest.mark.parametrize(
    ("where", "enough", "halved"),
    [
        ("tried", 1.38, 5),  # 2.8 > 2 * 1.38: all
        ("tried", 1.40, 1),  # 8.3 > 2 * 2 * 1.4
        ("tried", 2.08, 1),
        ("tried", 2.09, 0),
        ("everywhere", 1.38, 5),
        ("everywhere", 1.40, 0),
    ],
)
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_what_was_tried_twice_as_often_is_halved_sooner(
    kind: type[Crisp | Fuzzy], where: str, enough: float, halved: int
) -> None:
    grid, growth = kind([np.arange(6.0), np.arange(3.0)]), Growth(True, where)
    given = of_cells(CROWDED), np.zeros((18, 2)), enough
    finer = growth.finer(grid, *given, 1_000)
    assert growth.turn == int(halved > 0)
    if halved == 0:
        assert finer is None
        return
    assert finer is not None
    assert finer.centres[0].size == 6 + halved
    assert 2.5 in finer.centres[0]
    assert finer.centres[1].size == 3
    fits = 3 * (6 + halved)
    assert Growth(True, where).finer(grid, *given, fits) is not None
    assert Growth(True, where).finer(grid, *given, fits - 1) is None or halved > 1


@pytest.mark.parametrize("where", ["tried", "varied"])
def test_states_that_are_always_the_same_are_not_closed_in_for_ever(where: str) -> None:
    """As of a start that all episodes share: 0.3, in a range of 1."""
    state, growth = np.full((1_000, 1), 0.3), Growth(True, where)
    grid = Fuzzy([np.linspace(0.0, 1.0, 9)])
    for _ in range(100):
        tries = np.zeros(grid.n_cells)
        index, degree = grid(state)
        np.add.at(tries, index, degree)
        levels = np.eye(2)[np.arange(grid.n_cells) % 2]  # the policy varies everywhere
        # 250 of each pair on both sides of the state's interval; 56 or fewer on average.
        finer = growth.finer(grid, of_cells(tries), levels, 100.0, 10**6)
        if finer is None:
            break
        grid = finer
    assert finer is None
    assert 1e-4 < np.diff(grid.centres[0]).min() <= 2.0**-10


def test_cells_that_rounding_cannot_tell_apart_are_not_halved() -> None:
    grid = Fuzzy([[1.0, np.nextafter(1.0, 2.0), 2.0]])
    finer = Growth(True).finer(grid, of_cells(np.full(3, 50.0)), np.eye(3, 2), 1.0, 99)
    assert finer is not None
    assert finer.centres[0].size == 4  # between the last two only


def test_a_circle_is_closed_by_an_interval() -> None:
    grid = Fuzzy([np.arange(6.0)], [6.0])
    tries = of_cells(np.array([50.0, 0.0, 0.0, 0.0, 0.0, 50.0]))
    # 25 of each pair on both sides of the last interval, 8.3 on the average.
    finer = Growth(True).finer(grid, tries, np.zeros((6, 2)), 12.4, 1_000)
    assert finer is not None
    assert finer.centres[0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.5]


@pytest.mark.parametrize(
    ("best", "halved"),
    [
        ([0, 0, 0, 1, 1, 1], [2.5]),
        ([0, 0, 1, 1, 0, 0], [1.5]),  # half of it suffices
        ([0, 0, 0, 0, 0, 0], []),
        ([1, 0, 0, 0, 0, 1], []),  # it varies where nothing was tried
    ],
)
def test_cells_may_be_halved_where_the_policy_varies(
    best: list[int], halved: list[float]
) -> None:
    """Tries of 10 in four of six cells: 5 of each pair there, 3.3 on the average."""
    grid, growth = Fuzzy([np.arange(6.0)]), Growth(True, "varied")
    tries = of_cells(np.array([0.0, 10.0, 10.0, 10.0, 10.0, 0.0]))
    levels = np.eye(2)[best]
    finer = growth.finer(grid, tries, levels, 4.9, 1_000)
    added = [] if finer is None else np.setdiff1d(finer.centres[0], grid.centres[0])
    assert list(added) == halved
    assert Growth(True, "varied").finer(grid, tries, levels, 5.0, 1_000) is None


def test_the_policy_varies_most_where_much_was_tried() -> None:
    """The fewest intervals with half of what varies: 40 + 38 of 40 + 38 + 36 + 34."""
    grid = Fuzzy([np.arange(6.0)])
    tries = of_cells(np.array([40.0, 42.0, 38.0, 36.0, 34.0, 0.0]))
    levels = np.eye(2)[[0, 1, 0, 1, 0, 0]]  # 15.8 tries of each pair on the average
    finer = Growth(True, "varied").finer(grid, tries, levels, 16.0, 1_000)
    assert finer is not None
    assert np.setdiff1d(finer.centres[0], grid.centres[0]).tolist() == [0.5, 1.5]


def test_it_stops_at_the_limit_and_where_nothing_can_grow() -> None:
    growth, enough = Growth(True), evidence(99.0)
    assert growth.finer(GRID, enough, LEVELS, 1.0, 8) is None  # there would be 9 or 10
    assert growth.turn == 0
    growth.turn = 1  # that of the last variable, which does not fit
    other = growth.finer(GRID, enough, LEVELS, 1.0, 9)
    assert other is not None
    assert (other.n_cells, growth.turn) == (9, 3)
    assert growth.finer(Fuzzy([[0.5]]), evidence(9.0, pairs=2), LEVELS, 1.0, 9) is None
    assert growth.finer(Discrete(6), enough, LEVELS, 1.0, 100) is None
    assert Growth(False).finer(GRID, enough, LEVELS, 1.0, 100) is None


def test_the_limit_is_told_once(caplog: Any) -> None:
    growth, enough = Growth(True), evidence(99.0)
    with caplog.at_level("INFO", "acl_gym"):
        for limit in (7, 7, 8):
            assert growth.finer(GRID, enough, LEVELS, 1.0, limit) is None
    told = [record.getMessage() for record in caplog.records]
    assert [message.split("max_cells is ")[1][0] for message in told] == ["7", "8"]
    assert "has 6 cells" in told[0]


def test_it_becomes_wider_only_where_it_grows() -> None:
    box = spaces.Box(-9.0, 9.0, (1,), np.float64)
    grid, seen = Fuzzy([[0.0, 1.0]]), np.array([[3.0]])
    wide = Growth(True).wider(grid, seen, box, 99)
    assert wide is not None
    assert wide.centres[0][-1] > 3.0
    assert Growth(False).wider(grid, seen, box, 99) is None
    assert Growth(True).wider(Discrete(3), seen, box, 99) is None


@pytest.mark.parametrize("on", [None, 1, "yes"])
def test_it_is_on_or_off(on: Any) -> None:
    with pytest.raises(TypeError, match="grows must be True or False, got"):
        Growth(on)


@pytest.mark.parametrize("where", ["nowhere", None, 1])
def test_it_becomes_finer_in_some_place(where: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="grows_where must be one of"):
        Growth(True, where)


@pytest.mark.parametrize("turn", [-1, 0.5, [1], "2"])
def test_turns_from_strangers_are_checked(turn: Any) -> None:
    with pytest.raises(ValueError, match="growth_turn must be a number >= 0"):
        Growth(True).restore(np.array(turn))


def test_what_lies_between_known_and_unknown_is_unknown() -> None:
    coarse = Fuzzy([[0.0, 1.0, 2.0]])
    table = np.array([[1.0, 5.0], [3.0, 5.0], [7.0, 5.0]])
    known = np.array([[True, True], [True, False], [False, True]])
    values, still = carried_with_known(table, known, coarse, coarse.refined(0))
    assert values[:, 0].tolist() == [1.0, 2.0, 3.0, 5.0, 7.0]
    assert still[:, 0].tolist() == [True, True, True, False, False]
    assert still[:, 1].tolist() == [True, False, False, False, True]
