from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from acl_gym.utils.boxes import declared_bounds


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int32, np.int64])
def test_no_bounds_are_infinite_whatever_the_type(kind: Any) -> None:
    low, high = declared_bounds(spaces.Box(-np.inf, np.inf, (2,), kind))
    assert low.tolist() == [-np.inf] * 2
    assert high.tolist() == [np.inf] * 2


def test_the_largest_numbers_stand_for_infinity() -> None:
    largest = np.iinfo(np.int64).max
    _, high = declared_bounds(spaces.Box(0, largest, (1,), np.int64))
    assert high.tolist() == [np.inf]
    most = np.finfo(np.float32).max
    low, _ = declared_bounds(spaces.Box(-most, 1.0, (1,), np.float32))
    assert low.tolist() == [-np.inf]


def test_bounds_that_are_values_stay() -> None:
    low, high = declared_bounds(spaces.Box(0, 255, (1,), np.uint8))
    assert (low.tolist(), high.tolist()) == ([0.0], [255.0])
    low, high = declared_bounds(spaces.Box(0, 9, (1,), np.uint64))
    assert (low.tolist(), high.tolist()) == ([0.0], [9.0])
    low, high = declared_bounds(spaces.Box(-3, 4, (1,), np.int64))
    assert (low.tolist(), high.tolist()) == ([-3.0], [4.0])
