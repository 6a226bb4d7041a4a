"""The exponential function against NumPy's; the sine is tested with the pendulum."""

import math

import numpy as np
import pytest
from numba import njit

from acl_gym.utils.fast_math import _power_of_two, exponential


@njit
def exponentials(x: np.ndarray, result: np.ndarray) -> None:
    for i in range(x.size):
        result[i] = exponential(x[i])


@njit
def powers(rounded: np.ndarray, result: np.ndarray) -> None:
    for i in range(rounded.size):
        result[i] = _power_of_two(rounded[i])


def ours(x: np.ndarray) -> np.ndarray:
    result = np.full(x.size, np.nan)
    exponentials(x, result)
    return result


@pytest.mark.parametrize(("low", "high"), [(-708.0, 0.0), (-40.0, 0.0), (-1.0, 1.0)])
def test_exponential_is_that_of_numpy(low: float, high: float) -> None:
    rng = np.random.default_rng(3)
    x = np.concatenate([rng.uniform(low, high, 100_000), np.linspace(low, high, 999)])
    np.testing.assert_allclose(ours(x), np.exp(x), rtol=1e-15, atol=0.0)
    plain = [exponential.py_func(value) for value in x[:2000]]
    np.testing.assert_allclose(plain, np.exp(x[:2000]), rtol=1e-15, atol=0.0)


def test_exponential_where_its_argument_is_reduced() -> None:
    # Half-way between two multiples of log 2 the series has the longest way to go.
    middle = (np.arange(-1021, 1021) + 0.5) * math.log(2.0)
    x = np.concatenate([np.nextafter(middle, -1e9), middle, np.nextafter(middle, 1e9)])
    np.testing.assert_allclose(ours(x), np.exp(x), rtol=1e-15, atol=0.0)


def test_exponential_grows_to_the_end_of_its_range() -> None:
    x = np.linspace(0.0, 708.0, 10_001)
    np.testing.assert_allclose(ours(x), np.exp(x), rtol=1e-15, atol=0.0)


def test_exact_values() -> None:
    x = np.array([0.0, -0.0, np.nextafter(-708.0, -800.0), -745.2, -1e300, -np.inf])
    expected = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert ours(x).tolist() == expected
    assert [exponential.py_func(value) for value in x] == expected


def test_a_power_of_two_is_the_same_compiled_and_not() -> None:
    rounded = 1.5 * 2.0**52 + np.arange(-1021.0, 1023.0)
    result = np.empty_like(rounded)
    powers(rounded, result)
    assert result.tolist() == [_power_of_two(value) for value in rounded]
    assert result.tolist() == np.exp2(np.arange(-1021.0, 1023.0)).tolist()
