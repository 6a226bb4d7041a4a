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


def evidence(*tries: float, pairs: int = 12) -> Any:
    counted = np.zeros(pairs, np.int64)
    counted[: len(tries)] = np.rint(np.array(tries) * UNITS)
    return counted


def test_axes_take_turns_and_lone_centres_are_left_out() -> None:
    growth = Growth(True)
    enough = evidence(3.0, 3.0)  # 0.5 tries of each of 12 pairs, 0.25 for each variable
    first = growth.finer(GRID, enough, 0.2, 1_000)
    assert first is not None
    assert [line.size for line in first.centres] == [3, 1, 3]
    second = growth.finer(first, enough, 0.2, 1_000)
    assert second is not None
    assert [line.size for line in second.centres] == [3, 1, 5]
    assert growth.splits == 2
    third = growth.finer(second, enough, 0.2, 1_000)
    assert third is not None
    assert [line.size for line in third.centres] == [5, 1, 5]


def test_the_tries_of_an_average_pair_decide() -> None:
    """24 tries of 12 pairs are 2 for each, and 1 for each of two variables."""
    tries = evidence(6.0, 9.0, 9.0)
    assert Growth(True).finer(GRID, tries, 1.0, 1_000) is None
    assert Growth(True).finer(GRID, tries, 0.99, 1_000) is not None
    line = Fuzzy([[0.0, 1.0, 2.0], [0.5]])  # one variable: the other does not vary
    assert Growth(True).finer(line, tries, 1.99, 1_000) is not None
    assert Growth(True).finer(line, tries, 2.0, 1_000) is None


def test_it_stops_at_the_limit_and_where_nothing_can_grow() -> None:
    growth, enough = Growth(True), evidence(99.0)
    assert growth.finer(GRID, enough, 1.0, 8) is None  # there would be 9
    assert growth.splits == 0
    assert growth.finer(Fuzzy([[0.5]]), enough, 1.0, 100) is None
    assert growth.finer(Discrete(6), enough, 1.0, 100) is None
    assert Growth(False).finer(GRID, enough, 1.0, 100) is None


def test_it_becomes_wider_only_where_it_grows() -> None:
    box = spaces.Box(-9.0, 9.0, (1,), np.float64)
    grid, seen = Fuzzy([[0.0, 1.0]]), np.array([[3.0]])
    wide = Growth(True).wider(grid, seen, box)
    assert wide is not None
    assert wide.centres[0][-1] > 3.0
    assert Growth(False).wider(grid, seen, box) is None
    assert Growth(True).wider(Discrete(3), seen, box) is None


@pytest.mark.parametrize("on", [None, 1, "yes", np.True_])
def test_it_is_on_or_off(on: Any) -> None:
    with pytest.raises(TypeError, match="grows must be True or False, got"):
        Growth(on)


@pytest.mark.parametrize("splits", [-1, 0.5, [1], "2"])
def test_splits_from_strangers_are_checked(splits: Any) -> None:
    with pytest.raises(ValueError, match="splits must be a number >= 0"):
        Growth(True).restore(np.array(splits))


def test_what_lies_between_known_and_unknown_is_unknown() -> None:
    coarse = Fuzzy([[0.0, 1.0, 2.0]])
    table = np.array([[1.0, 5.0], [3.0, 5.0], [7.0, 5.0]])
    known = np.array([[True, True], [True, False], [False, True]])
    values, still = carried_with_known(table, known, coarse, coarse.refined(0))
    assert values[:, 0].tolist() == [1.0, 2.0, 3.0, 5.0, 7.0]
    assert still[:, 0].tolist() == [True, True, True, False, False]
    assert still[:, 1].tolist() == [True, False, False, False, True]
