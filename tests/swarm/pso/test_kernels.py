"""Each kernel against its equation, compiled and as plain Python."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm.pso import kernels
from acl_gym.swarm.pso.bounds import BOUNDARIES
from tests.swarm.pso import reference

SEEDS = st.integers(0, 2**32 - 1)


def both(kernel: Any) -> tuple[Any, Any]:
    return kernel, kernel.py_func


@given(SEEDS, st.integers(1, 7), st.integers(1, 5))
def test_personal_bests_are_replaced_by_better_points(
    seed: int, n: int, d: int
) -> None:
    rng = np.random.default_rng(seed)
    values = rng.choice([0.0, 1.0, 2.0, math.inf], n)
    old = rng.choice([0.0, 1.0, 2.0, math.inf], n)
    positions, kept = rng.random((2, n, d))
    for kernel in both(kernels.remember_best):
        best_values, best_positions = old.copy(), kept.copy()
        kernel(values, positions, best_values, best_positions)
        for i in range(n):
            better = values[i] < old[i]
            assert best_values[i] == (values[i] if better else old[i])
            assert np.array_equal(best_positions[i], (positions if better else kept)[i])


@given(SEEDS, st.integers(1, 7))
def test_local_bests_are_those_heard_if_they_are_worth_something(
    seed: int, n: int
) -> None:
    rng = np.random.default_rng(seed)
    sender = rng.integers(-1, n, n)
    heard = rng.choice([-math.inf, 0.0, math.inf], n)
    for kernel in both(kernels.choose_local_best):
        chosen = np.full(n, 99)
        kernel(sender, heard, chosen)
        expected = [int(j) if j >= 0 and heard[j] != math.inf else -1 for j in sender]
        assert chosen.tolist() == expected


@given(SEEDS, st.integers(1, 7), st.integers(1, 5), st.integers(1, 9))
def test_the_input_is_6_3(seed: int, n: int, d: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    positions, personal = rng.normal(size=(2, n, d))
    heard = rng.normal(size=(m, d))
    chosen = rng.integers(-1, m, n)
    c1, c2 = rng.uniform(0, 3, (2, n))
    uniforms = rng.random((n, 2, d))
    expected = [
        reference.input_of(
            positions[i],
            personal[i],
            heard[chosen[i]] if chosen[i] >= 0 else personal[i],
            c1[i],
            c2[i],
            uniforms[i],
        )
        for i in range(n)
    ]
    for kernel in both(kernels.attract):
        u = np.empty((n, d))
        kernel(positions, personal, chosen, heard, c1, c2, uniforms, u)
        np.testing.assert_allclose(u, expected, rtol=1e-13, atol=1e-15)


@given(
    SEEDS,
    st.integers(1, 6),
    st.integers(1, 5),
    st.sampled_from(sorted(BOUNDARIES)),
    st.sampled_from(["standard", "literal"]),
    st.sampled_from([0.1, 3.0, 40.0]),
)
def test_the_motion_is_6_1_and_6_2(
    seed: int, n: int, d: int, boundary: str, order: str, speed: float
) -> None:
    """Also with many reflections, one wall, no wall, and a range without width."""
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-2, 0, d)
    upper = lower + rng.choice([0.0, 0.5, 3.0], d)
    theta = lower + (upper - lower) * rng.random((n, d))
    lower[rng.random(d) < 0.2] = -math.inf
    upper[rng.random(d) < 0.2] = math.inf
    nu, u = speed * rng.normal(size=(2, n, d))
    w = rng.uniform(-1, 1, n)
    limit = rng.choice([0.5, 10.0, math.inf], d)
    expected = [
        reference.moved(
            list(theta[i]),
            list(nu[i]),
            list(u[i]),
            w=w[i],
            lower=list(lower),
            upper=list(upper),
            boundary=boundary,
            limit=list(limit),
            order=order,
        )
        for i in range(n)
    ]
    for kernel in both(kernels.move):
        x = np.hstack([theta, nu])
        arguments = w, lower, upper, BOUNDARIES[boundary], limit, order == "literal"
        assert kernel(x, u, *arguments)
        np.testing.assert_allclose(
            x, [[*position, *velocity] for position, velocity in expected], atol=1e-11
        )
        if boundary != "none":
            assert ((x[:, :d] >= lower) & (x[:, :d] <= upper)).all()


@pytest.mark.parametrize("boundary", sorted(BOUNDARIES))
@pytest.mark.parametrize(
    ("theta", "nu", "u", "limit"),
    [
        (0.0, 1e308, 1e308, math.inf),  # the velocity
        (1e308, 1.7e308, 0.0, math.inf),  # the position
        (0.0, math.inf, -math.inf, math.inf),  # NaN
        (0.0, 0.0, math.nan, math.inf),
        (0.0, 0.0, math.nan, 1.0),
    ],
)
def test_a_state_that_is_not_finite_is_reported(
    boundary: str, theta: float, nu: float, u: float, limit: float
) -> None:
    """Whatever the bounds would make of it, and also if the row after it is in order."""
    free = np.array([-math.inf]), np.array([math.inf])
    x = np.array([[theta, nu], [0.0, 0.0]])
    for kernel in both(kernels.move):
        with np.errstate(over="ignore", invalid="ignore"):
            finite = kernel(
                x.copy(),
                np.array([[u], [0.0]]),
                np.ones(2),
                *free,
                BOUNDARIES[boundary],
                np.array([limit]),
                False,
            )
        assert not finite


@given(
    st.floats(-1e300, 1e300),
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.floats(0.0, 1e3),
)
def test_mirrors_end_and_stay_inside(
    position: float, velocity: float, lower: float, width: float
) -> None:
    """However far away the position is: 1e300 is many reflections."""
    upper = lower + width
    for kernel in both(kernels.mirror):
        found, speed = kernel(position, velocity, lower, upper)
        assert lower <= found <= upper
        assert abs(speed) == (abs(velocity) if upper > lower else 0.0)


def test_the_first_nan_is_found_and_all_are_replaced() -> None:
    for kernel in both(kernels.replace_nan):
        values = np.array([1.0, math.nan, -math.inf, math.nan])
        assert kernel(values) == 1
        assert values.tolist() == [1.0, math.inf, -math.inf, math.inf]
        assert kernel(values) == -1
