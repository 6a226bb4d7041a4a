"""What partitions refuse: centres, periods, boxes, states and settings."""

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from acl_gym.partitions import Crisp, Fuzzy, partition_from_settings
from acl_gym.utils.angles import find_angles

NAN, INF = float("nan"), float("inf")
REFUSED = (TypeError, ValueError)

BAD_CENTRES = {
    "flat array": np.array([0.0, 1.0]),
    "flat list": [0.0, 1.0],
    "no variable": [],
    "number": 1.0,
    "none": None,
    "word": "abc",
    "no centre": [[0.0, 1.0], []],
    "equal": [[0.0, 1.0, 1.0]],
    "falling": [[0.0, 1.0, 0.5]],
    "nan": [[0.0, NAN, 1.0]],
    "infinite": [[0.0, INF]],
    "nested": [[[0.0, 1.0]]],
    "ragged": [[0.0, [1.0]]],
    "a hole": [[0.0, None]],
    "complex": [[0.0, 1j]],
    "complex array": [np.array([0.0, 1 + 1j])],
    "digits as strings": [["0", "1"]],
    "words": [["low", "high"]],
    "beyond all floats": [[0, 10**400]],
}


@pytest.mark.parametrize("centres", BAD_CENTRES.values(), ids=BAD_CENTRES)
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_bad_centres_are_refused(kind: Any, centres: Any) -> None:
    with pytest.raises(REFUSED, match=r"^centres(\[\d\])? must"):
        kind(centres)


def test_the_message_reports_where_centres_do_not_increase() -> None:
    with pytest.raises(
        ValueError, match=r"centres\[1\].*2 followed by 1.5.*position 2"
    ):
        Fuzzy([[0.0, 1.0], [0.0, 1.0, 2.0, 1.5]])


@pytest.mark.parametrize("centres", [[0.0, 1e-310, 2e-310], [-1.7e308, 1.7e308]])
def test_gaps_that_overflow_are_refused(centres: list[float]) -> None:
    with pytest.raises(ValueError, match=r"centres\[0\] must be further apart than"):
        Fuzzy([centres])


@pytest.mark.parametrize("centres", [[0.0, 1e-300, 2e-300], [1e308, 1.07e308]])
def test_extreme_gaps_are_right(centres: list[float]) -> None:
    between = 0.3 * centres[-2] + 0.7 * centres[-1]
    index, degree = Fuzzy([centres])([[between]])
    assert sorted(index[0]) == [len(centres) - 2, len(centres) - 1]
    np.testing.assert_allclose(np.sort(degree[0]), [0.3, 0.7], rtol=1e-9)


def test_too_many_cells_are_refused_before_they_are_made() -> None:
    with pytest.raises(ValueError, match=r"2\^31 cells, got 1000000000000"):
        Fuzzy([np.arange(10_000)] * 3)


BAD_PERIODS = {
    "none for two": [],
    "one for two": [4.0],
    "three for two": [4.0, None, None],
    "number": 4.0,
    "zero": [0.0, None],
    "negative": [-4.0, None],
    "nan": [NAN, None],
    "infinite": [INF, None],
    "equal to the span": [2.0, None],
    "less than the span": [1.5, None],
    "string": ["4", None],
    "bool": [True, None],
}


@pytest.mark.parametrize("periods", BAD_PERIODS.values(), ids=BAD_PERIODS)
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_bad_periods_are_refused(kind: Any, periods: Any) -> None:
    with pytest.raises(REFUSED, match=r"period"):
        kind([[0.0, 1.0, 2.0], [0.0, 1.0]], periods)


SQUARE = spaces.Box(-1.0, 1.0, (2,))


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(-INF, INF, (2,)),
        spaces.Box(np.array([0.0, 0.0]), np.array([1.0, INF]), dtype=np.float64),
        spaces.Box(0.0, 1.0, (2, 2)),
        spaces.Box(0.0, 1.0, ()),
        spaces.Discrete(4),
        spaces.MultiDiscrete([2, 2]),
        None,
        [[0.0, 1.0]],
    ],
    ids=str,
)
def test_bad_space_is_refused(space: Any) -> None:
    with pytest.raises(ValueError, match=r"^space must be"):
        Fuzzy.from_box(space, 3)


@pytest.mark.parametrize(
    "cells",
    [0, -1, [3, 0], [3], [3, 3, 3], [], 3.0, [3, 3.5], True, "3", "33", None, [3, "3"]],
)
def test_bad_cells_are_refused(cells: Any) -> None:
    with pytest.raises(REFUSED, match=r"^cells(\[\d\])? must be"):
        Fuzzy.from_box(SQUARE, cells)


@pytest.mark.parametrize(
    "circular", [[2], [-1], [0, 5], [0.5], "0", ["theta"], [0, "theta", 3], 0, [None]]
)
def test_bad_circular_is_refused(circular: Any) -> None:
    with pytest.raises(REFUSED, match=r"^circular must hold"):
        Fuzzy.from_box(SQUARE, 3, circular=circular)


@pytest.mark.parametrize(
    ("axis", "centres"),
    [
        (2, [0.5]),
        (-1, [0.5]),
        (0, [NAN]),
        (0, [INF]),
        (0, [-1.0, 3.0]),  # as far apart as the period
        (0, ["low"]),
        (0, ["0.5"]),
        ("0", [0.5]),
    ],
)
def test_bad_refinement_is_refused(axis: Any, centres: Any) -> None:
    partition = Fuzzy([[0.0, 1.0], [0.0, 2.0]], [4.0, None])
    with pytest.raises(REFUSED, match=r"^(axis|centres(\[\d\])?) must"):
        partition.refine(axis, centres)


BAD_STATES = {
    "one state": [0.0, 0.0],
    "number": 0.0,
    "nothing": [],
    "too many variables": [[0.0, 0.0, 0.0]],
    "too few variables": [[0.0]],
    "three axes": [[[0.0, 0.0]]],
    "nan": [[0.0, 0.0], [0.0, NAN]],
    "infinite": [[0.0, 0.0], [-INF, 0.0]],
    "float32 nan": np.array([[0.0, 0.0], [NAN, 0.0]], dtype=np.float32),
    "strings": [["0", "0"]],
    "bools": [[True, False]],
    "complex": [[0.0, 1j]],
    "none": [[None, 0.0]],
    "ragged": [[0.0, 0.0], [0.0]],
}


@pytest.mark.parametrize("states", BAD_STATES.values(), ids=BAD_STATES)
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_bad_states_are_refused(kind: Any, states: Any) -> None:
    partition = kind([[0.0, 1.0], [0.0, 2.0]], [3.0, None])
    with pytest.raises(ValueError, match=r"^states must"):
        partition(states)


def test_message_names_the_row_that_is_not_finite() -> None:
    with pytest.raises(ValueError, match=r"\[0.0, nan\] in row 1\b"):
        Fuzzy([[0.0, 1.0]] * 2)([[0.0, 0.0], [0.0, NAN], [NAN, 0.0]])


def test_no_states_have_no_cells() -> None:
    index, degree = Fuzzy([[0.0, 1.0]] * 2)(np.empty((0, 2)))
    assert index.shape == degree.shape == (0, 4)


@pytest.mark.parametrize(
    "settings",
    [
        None,
        {},
        [],
        "Fuzzy",
        {"type": "Tiles", "centres": [[0, 1]], "periods": [None]},
        {"type": ["Fuzzy"], "centres": [[0, 1]], "periods": [None]},
        {"type": "Fuzzy", "periods": [None]},
        {"type": "Fuzzy", "centres": [[0, 1]]},
        {"type": "Fuzzy", "centres": 3, "periods": [None]},
        {"type": "Fuzzy", "centres": [[0, 1]], "periods": ["long"]},
        {"type": "Fuzzy", "centres": [[0, 1]], "periods": 3},
        {"type": "Fuzzy", "centres": [[1, 0]], "periods": [None]},
    ],
    ids=str,
)
def test_settings_of_something_else_are_refused(settings: Any) -> None:
    with pytest.raises(ValueError, match=r"^(settings|centres(\[0\])?|periods) must"):
        partition_from_settings(settings)


def test_cosines_that_are_huge_are_taken_and_infinite_ones_refused() -> None:
    """Their sum overflows, or is no number; neither is an angle's fault."""
    grid = Fuzzy([[-2.0, 0.0, 2.0]], angles=[(0, 1)])
    index, _ = grid([[1e308, 1.7e308]])
    assert index.tolist() == grid([[1.0, 1.7]])[0].tolist()
    with pytest.raises(ValueError, match=r"states must be finite, got \[inf, -inf\]"):
        grid([[np.inf, -np.inf]])
    angle = np.arange(10.0)
    seen = np.column_stack([np.cos(angle), np.sin(angle), np.tile([1e300, -1e300], 5)])
    assert find_angles(seen) == [(0, 1)]
