"""State feedback against its equation, one observation at a time."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.envs.wrappers import StateFeedback


def by_hand(
    x: np.ndarray,
    gain: np.ndarray,
    point: np.ndarray,
    periods: dict[int, float],
    low: float,
    high: float,
) -> list[float]:
    """u = -K (x - r), clipped."""
    error = []
    for i in range(len(x)):
        apart = x[i] - point[i]
        if i in periods:
            apart = (apart + periods[i] / 2) % periods[i] - periods[i] / 2
        error.append(apart)
    inputs = [-sum(k * e for k, e in zip(row, error, strict=True)) for row in gain]
    return [min(max(u, low), high) for u in inputs]


@given(st.integers(0, 2**32), st.integers(1, 3), st.integers(1, 4), st.integers(1, 5))
def test_it_is_its_equation(seed: int, m: int, d: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    x, gain, point = (
        rng.normal(size=(n, d)),
        rng.normal(size=(m, d)),
        rng.normal(size=d),
    )
    periods = {d - 1: 1.5}
    limits: Any = {"circular": periods, "low": -1.0, "high": 0.5}
    expected = [by_hand(row, gain, point, periods, -1.0, 0.5) for row in x]
    rows = np.tile(np.concatenate([gain.ravel(), point]), (n, 1))
    for controller, parameters in (
        (StateFeedback(gain, point, **limits), None),
        (StateFeedback(gain, **limits), rows[:, m * d :]),
        (StateFeedback(set_point=point, n_inputs=m, **limits), rows[:, : m * d]),
        (StateFeedback(n_inputs=m, **limits), rows),
    ):
        np.testing.assert_allclose(
            controller(x, parameters), expected, rtol=1e-12, atol=1e-12
        )


def test_each_observation_has_its_own_parameters() -> None:
    controller = StateFeedback(set_point=[0.0, 0.0])
    inputs = controller(np.array([[1.0, 2.0], [1.0, 2.0]]), [[1.0, 0.0], [0.0, -1.0]])
    assert inputs.tolist() == [[-1.0], [2.0]]


def test_the_error_of_an_angle_is_taken_the_short_way() -> None:
    controller = StateFeedback([1.0, 0.0], [0.1, 0.0], circular=[0])
    inputs = controller(np.array([[2 * math.pi - 0.1, 0.0]]))
    assert inputs[0, 0] == pytest.approx(0.2)


def test_what_it_is_given_stays_as_it_is() -> None:
    seen = np.array([[0.5, 0.5]])
    StateFeedback([1.0, 1.0], [0.1, 0.1], circular=[0])(seen)
    assert seen.tolist() == [[0.5, 0.5]]


def test_equal_ones_are_equal_and_can_be_pickled() -> None:
    one = StateFeedback([[1, 2]], set_point=[0, 1], circular={0: 3.0}, high=2)
    same = StateFeedback([1.0, 2.0], set_point=[0.0, 1.0], circular={0: 3}, high=[2.0])
    assert one == same == pickle.loads(pickle.dumps(one))
    assert hash(one) == hash(same)
    assert one != StateFeedback([[1, 2]], set_point=[0, 1], circular=[0], high=2)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"gain": [1.0, math.nan]}, ValueError, "gain must be an array of finite"),
        ({"gain": np.ones((1, 1, 1))}, ValueError, "gain must have shape"),
        ({"gain": "a"}, ValueError, "gain must be an array"),
        ({"set_point": [[1.0]]}, ValueError, "set_point must be an array of 1 axes"),
        ({"gain": [1, 2], "set_point": [1]}, ValueError, "2 variables .* got 1"),
        ({"circular": [0.5]}, TypeError, "circular must be an integer"),
        ({"circular": 3}, TypeError, "circular must hold numbers of variables"),
        ({"circular": [0, 0]}, ValueError, "different variables, got"),
        ({"gain": [1, 2], "circular": [2]}, ValueError, r"of 0..1, got \[2\]"),
        ({"circular": {0: 0.0}}, ValueError, "the period must lie in"),
        ({"low": 1, "high": 0}, ValueError, "low must not exceed high"),
        ({"low": [1, 2]}, ValueError, "low must be a number, or one for each of 1"),
        ({"high": math.inf}, ValueError, "high must be an array of finite"),
        ({"n_inputs": 0}, ValueError, "n_inputs must be at least 1"),
    ],
)
def test_bad_arguments(arguments: Any, error: Any, words: str) -> None:
    with pytest.raises(error, match=words):
        StateFeedback(**arguments)


@pytest.mark.parametrize(
    ("controller", "seen", "parameters", "words"),
    [
        (StateFeedback([1.0, 0.0], [0.0, 0.0]), [[1.0]], None, "must have 2 variables"),
        (StateFeedback([1.0], [0.0]), [1.0], None, r"rows of variables, \(n, d\)"),
        (StateFeedback([1.0], [0.0]), [[1.0]], [[1.0]], "rows of 0 numbers.* given"),
        (StateFeedback([1.0]), [[1.0]], None, r"rows of 1 numbers.*: 1 set points"),
        (StateFeedback(), [[1.0]], [[1.0]], "2 numbers.*1 x 1 gains and 1 set points"),
        (StateFeedback(circular=[1]), [[1.0]], [[1.0, 1.0]], r"0..0 .* got \[1\]"),
    ],
)
def test_what_does_not_fit(
    controller: StateFeedback, seen: Any, parameters: Any, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        controller(seen, parameters)


def test_what_are_no_numbers_is_refused() -> None:
    with pytest.raises(
        ValueError, match="observations must be an array of real numbers"
    ):
        StateFeedback([1.0, 0.0], [0.0, 0.0])([["a", "b"]])
    with pytest.raises(ValueError, match="parameters must be an array of real numbers"):
        StateFeedback(set_point=[0.0, 0.0])([[1.0, 2.0]], [["a", "b"]])
    with pytest.raises(ValueError, match="n_inputs must be at most 1000"):
        StateFeedback(set_point=[0.0, 0.0], n_inputs=10**12)
