"""The benchmark functions against their formulas, one variable at a time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm.pso.benchmark_functions import BENCHMARK_FUNCTIONS


def sphere(x: Sequence[float]) -> float:
    return sum(v**2 for v in x)


def rosenbrock(x: Sequence[float]) -> float:
    return sum(100 * (b - a**2) ** 2 + (1 - a) ** 2 for a, b in itertools.pairwise(x))


def rastrigin(x: Sequence[float]) -> float:
    return sum(v**2 - 10 * math.cos(2 * math.pi * v) + 10 for v in x)


def ackley(x: Sequence[float]) -> float:
    d = len(x)
    distance = math.sqrt(sum(v**2 for v in x) / d)
    waves = sum(math.cos(2 * math.pi * v) for v in x) / d
    return 20 + math.e - 20 * math.exp(-0.2 * distance) - math.exp(waves)


def griewank(x: Sequence[float]) -> float:
    waves = math.prod(math.cos(v / math.sqrt(k)) for k, v in enumerate(x, 1))
    return 1 + sum(v**2 for v in x) / 4000 - waves


FORMULAS = {
    each.__name__: each for each in (sphere, rosenbrock, rastrigin, ackley, griewank)
}


@pytest.mark.parametrize("name", FORMULAS)
@given(st.lists(st.lists(st.floats(-30, 30), min_size=3, max_size=3), min_size=1))
def test_values_are_those_of_the_formula(name: str, points: list[list[float]]) -> None:
    found = BENCHMARK_FUNCTIONS[name].function(np.array(points))
    expected = [FORMULAS[name](point) for point in points]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", BENCHMARK_FUNCTIONS)
@pytest.mark.parametrize("d", [1, 2, 30])
def test_the_minimum_is_0_and_within_the_bounds(name: str, d: int) -> None:
    each = BENCHMARK_FUNCTIONS[name]
    at = np.full((1, d), each.minimum)
    assert each.function(at).shape == (1,)
    assert each.function(at)[0] == pytest.approx(0.0, abs=1e-14)
    lower, upper = np.array(each.bounds(d)).T
    assert ((lower < at) & (at < upper)).all()
    points = np.random.default_rng(0).uniform(lower, upper, (1_000, d))
    assert (each.function(points) >= 0.0).all()


def test_all_are_named() -> None:
    assert set(BENCHMARK_FUNCTIONS) == set(FORMULAS)
