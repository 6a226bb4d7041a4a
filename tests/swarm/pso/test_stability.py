"""Stability by moment recursion: against Poli's formula, and against simulated swarms."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from acl_gym.swarm.pso import kernels
from acl_gym.swarm.pso.coefficients import constriction_coefficients
from acl_gym.swarm.pso.stability import (
    is_stable,
    largest_acceleration,
    mean_matrix,
    position_moments,
    second_moment_matrix,
    spectral_radius,
)

INERTIAS = st.floats(-0.99, 0.99)
ACCELERATIONS = st.floats(0.0, 5.0)
ORDERS = st.sampled_from(["standard", "literal"])


@given(INERTIAS)
def test_the_closed_formulas_of_c1_equal_to_c2(w: float) -> None:
    """Poli (2009) for the variances; 4 (1 + w) and 2 (1 - w) for the means."""
    poli = 24 * (1 - w * w) / (7 - 5 * w)
    assert largest_acceleration(w) == pytest.approx(poli, rel=1e-8)
    assert largest_acceleration(w, moment=1) == pytest.approx(4 * (1 + w), rel=1e-8)
    literal = largest_acceleration(w, moment=1, order="literal")
    # z^2 - (1 + w) z + (w + mean): both roots within the circle.
    assert literal == pytest.approx(2 * (1 - w), rel=1e-8)


@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-12, 2.0**-53])
def test_an_inertia_next_to_one_has_a_bound(gap: float) -> None:
    w = 1 - gap
    poli = 24 * (1 - w) * (1 + w) / (7 - 5 * w)
    assert largest_acceleration(w) == pytest.approx(poli, rel=1e-12)
    assert largest_acceleration(-w) == pytest.approx(48 * gap / 12, rel=1e-5)
    means = largest_acceleration(w, moment=1, order="literal")
    assert means == pytest.approx(2 * (1 - w), rel=1e-12)
    # To first order: 1 - w^2 = (w / 2 + square (1 + w)) t.
    literal = largest_acceleration(w, order="literal")
    assert literal == pytest.approx(2 * (1 - w) / (1 / 2 + 7 / 12), rel=1e-5)


@pytest.mark.parametrize(
    ("moment", "order", "expected"),
    [
        (1, "standard", 6.92),
        (2, "standard", 24 * (1 - 0.73**2) / (7 - 5 * 0.73)),
        (1, "literal", 0.54),
        (2, "literal", 0.4959),
    ],
)
def test_usual_swarms_at_w_073(moment: int, order: str, expected: float) -> None:
    found = largest_acceleration(0.73, moment=moment, order=order)
    assert found == pytest.approx(expected, rel=1e-4)
    for share, stable in ((0.999, True), (1.001, False)):
        c = share * found / 2
        assert is_stable(0.73, c, c, moment=moment, order=order) is stable


def test_the_defaults_are_stable_and_explode_in_the_literal_order() -> None:
    w, c = constriction_coefficients()
    assert is_stable(w, c, c)
    assert not is_stable(w, c, c, moment=1, order="literal")


def products(z: np.ndarray) -> np.ndarray:
    return np.array([z[0] * z[0], z[0] * z[1], z[1] * z[1]])


@given(INERTIAS, ACCELERATIONS, ACCELERATIONS, ORDERS, st.integers(0, 2**32 - 1))
def test_the_matrices_are_expectations_of_the_motion(
    w: float, c1: float, c2: float, order: str, seed: int
) -> None:
    """E over r1 and r2 by Gauss's rule, which is exact for polynomials."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    nodes, weights = (nodes + 1) / 2, weights / 2
    z = np.random.default_rng(seed).normal(size=2)
    mean, square = np.zeros(2), np.zeros(3)
    for r1, p1 in zip(nodes, weights, strict=True):
        for r2, p2 in zip(nodes, weights, strict=True):
            velocity = w * z[1] - (c1 * r1 + c2 * r2) * z[0]
            step = velocity if order == "standard" else z[1]
            following = np.array([z[0] + step, velocity])
            mean += p1 * p2 * following
            square += p1 * p2 * products(following)
    np.testing.assert_allclose(mean_matrix(w, c1, c2, order) @ z, mean, atol=1e-10)
    found = second_moment_matrix(w, c1, c2, order) @ products(z)
    np.testing.assert_allclose(found, square, atol=1e-9)


@given(INERTIAS, ACCELERATIONS, ACCELERATIONS, ORDERS)
def test_variances_converge_only_where_means_do(
    w: float, c1: float, c2: float, order: str
) -> None:
    of_means = spectral_radius(w, c1, c2, moment=1, order=order)
    of_products = spectral_radius(w, c1, c2, moment=2, order=order)
    assert of_products >= of_means**2 - 1e-9


@given(INERTIAS, st.floats(0.0, 1.0), st.sampled_from([1, 2]), ORDERS)
def test_stable_accelerations_are_those_below_the_bound(
    w: float, share: float, moment: int, order: str
) -> None:
    bound = largest_acceleration(w, moment=moment, order=order, share=share)
    totals = bound * np.linspace(0.02, 1.98, 50)
    radii = spectral_radius(
        w, share * totals, (1 - share) * totals, moment=moment, order=order
    )
    assert (radii[:25] < 1.0).all()
    assert (radii[25:] > 1.0).all()


def test_radii_are_broadcast() -> None:
    w, c = np.array([0.0, 0.7])[:, None], np.array([0.5, 1.0, 1.5])
    found = spectral_radius(w, c, c)
    assert found.shape == (2, 3)
    assert found[1, 2] == spectral_radius(0.7, 1.5, 1.5)


def simulated(
    n: int, steps: int, order: str, seed: int, *, w: float, c1: float, c2: float
) -> np.ndarray:
    """The positions of n particles whose bests stand still, step by step: theta_pbest = 1
    and theta_lbest = -2, from theta = 3 and nu = -0.5."""
    rng = np.random.default_rng(seed)
    x = np.tile([3.0, -0.5], (n, 1))
    free = np.array([math.inf])
    u = np.empty((n, 1))
    series = [x[:, 0].copy()]
    for _ in range(steps):
        kernels.attract(
            x[:, :1].copy(),
            np.full((n, 1), 1.0),
            np.zeros(n, np.int64),
            np.full((1, 1), -2.0),
            np.full(n, c1),
            np.full(n, c2),
            rng.random((n, 2, 1)),
            u,
        )
        kernels.move(
            x, u, np.full(n, w), -free, free, kernels.NONE, free, order == "literal"
        )
        series.append(x[:, 0].copy())
    return np.array(series)


@pytest.mark.parametrize("order", ["standard", "literal"])
@pytest.mark.parametrize(
    "parameters",
    [{"w": 0.6, "c1": 1.2, "c2": 0.7}, {"w": 0.4, "c1": 0.2, "c2": 0.3}],
)
def test_simulated_swarms_have_these_moments(
    order: str, parameters: dict[str, float]
) -> None:
    """100,000 particles; five standard errors of mean and variance, estimated."""
    n, steps = 100_000, 12
    series = simulated(n, steps, order, 5, **parameters)
    found = position_moments(
        parameters["w"],
        parameters["c1"],
        parameters["c2"],
        position=3.0,
        velocity=-0.5,
        personal_best=1.0,
        local_best=-2.0,
        steps=steps,
        order=order,
    )
    means = series.mean(axis=1)
    deviations = (series - means[:, None]) ** 2
    assert (
        np.abs(means - found.mean) <= 5 * series.std(axis=1) / math.sqrt(n) + 1e-12
    ).all()
    errors = deviations.std(axis=1) / math.sqrt(n)
    assert (
        np.abs(deviations.mean(axis=1) - found.variance) <= 5 * errors + 1e-12
    ).all()


@given(st.floats(-0.8, 0.8), st.floats(0.1, 3.0), st.floats(0.1, 3.0), st.floats(-5, 5))
def test_moments_settle_where_the_theory_says(
    w: float, c1: float, c2: float, p: float
) -> None:
    """The mean at (c1 p + c2 g) / (c1 + c2), whatever w; the variance by Poli (2009)."""
    assume(spectral_radius(w, c1, c2) < 0.97)
    found = position_moments(
        w, c1, c2, position=2.0, personal_best=p, local_best=1.0, steps=2_000
    )
    centre = (c1 * p + c2) / (c1 + c2)
    assert found.mean[-1] == pytest.approx(centre, abs=1e-9)
    # Var = (1 + w) E[(a - C q)^2] / (..): the stationary solution, by linear algebra.
    matrix = second_moment_matrix(w, c1, c2)
    noise = (c1**2 * (p - centre) ** 2 + c2**2 * (1 - centre) ** 2) / 12
    stationary = np.linalg.solve(np.eye(3) - matrix, noise * np.ones(3))
    assert found.variance[-1] == pytest.approx(stationary[0], rel=1e-6, abs=1e-9)


def test_moments_do_not_depend_on_where_zero_is() -> None:
    here, there = (
        position_moments(
            0.7,
            1.4,
            1.2,
            position=3.0 + offset,
            personal_best=1.0 + offset,
            local_best=-2.0 + offset,
            steps=50,
        )
        for offset in (0.0, 2.0**40)
    )
    np.testing.assert_allclose(there.mean - 2.0**40, here.mean, atol=1e-3)
    np.testing.assert_allclose(there.variance, here.variance, rtol=1e-12)


@pytest.mark.parametrize("order", ["standard", "literal"])
@pytest.mark.parametrize("far", [-2.0, 1e7, 1e100])
def test_a_best_that_does_not_attract_does_not_count(order: str, far: float) -> None:
    """With one best alone, the second moments follow a recursion in exact fractions."""
    w, c, steps = Fraction(7, 10), Fraction(1, 2), 30
    first, wanted = Fraction(-1), [0.0]  # theta seen from the best
    square, product, velocity, nu = Fraction(1), Fraction(0), Fraction(0), Fraction(0)
    mean_c, mean_cc = c / 2, c * c / 3
    for _ in range(steps):
        # nu' = w nu - C theta; theta' = theta + nu' or theta + nu.
        new = (
            w * w * velocity - 2 * w * mean_c * product + mean_cc * square,
            w * product - mean_c * square,
            w * velocity - mean_c * product,
        )
        nu_next = w * nu - mean_c * first
        if order == "standard":
            square = square + 2 * new[1] + new[0]
            product, velocity, first = new[1] + new[0], new[0], first + nu_next
        else:
            square, product = square + 2 * product + velocity, new[1] + new[2]
            velocity, first = new[0], first + nu
        nu = nu_next
        wanted.append(float(square - first * first))
    for bests in ((1.0, far), (far, 1.0)):
        c1, c2 = (0.5, 0.0) if bests[0] == 1.0 else (0.0, 0.5)
        found = position_moments(
            0.7,
            c1,
            c2,
            position=0.0,
            personal_best=bests[0],
            local_best=bests[1],
            steps=steps,
            order=order,
        )
        np.testing.assert_allclose(found.variance, wanted, rtol=1e-11)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: largest_acceleration(1.0), ValueError, "inertia must lie in"),
        (lambda: largest_acceleration(0.5, moment=3), ValueError, "moment must be 1"),
        (
            lambda: is_stable(0.7, 1, 1, moment=np.array([1, 2])),
            ValueError,
            "moment must be 1",
        ),
        (lambda: is_stable([0.7, 0.8], 1, 1), TypeError, "inertia must be a real"),
        (
            lambda: largest_acceleration(0.5, order="new"),
            ValueError,
            "order must be one",
        ),
        (lambda: largest_acceleration(0.5, share=1.5), ValueError, "share must lie in"),
        (lambda: spectral_radius(0.5, -1.0, 1.0), ValueError, "cognitive must lie in"),
        (lambda: spectral_radius(math.nan, 1.0, 1.0), ValueError, "inertia"),
        (lambda: spectral_radius(1e7, 1.0, 1.0), ValueError, "inertia must lie in"),
        (lambda: is_stable(0.5, 1.0, 1e7), ValueError, "social must lie in"),
        (
            lambda: position_moments(
                9, 1, 1, position=1, personal_best=0, local_best=0, steps=1_000
            ),
            ValueError,
            r"steps must be fewer than \d\d\d, got 1000",
        ),
        (lambda: spectral_radius([0.5, 0.6], [1, 2, 3], 1.0), ValueError, "shape"),
        (
            lambda: position_moments(
                0.5, 1, 1, position=0, personal_best=0, local_best=0, steps=-1
            ),
            ValueError,
            "steps must be at least 0",
        ),
    ],
)
def test_bad_arguments_are_refused(call: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_constriction() -> None:
    """As printed everywhere, but computed."""
    w, c = constriction_coefficients()
    assert round(w, 6) == 0.729844
    assert round(c, 6) == 1.496180
    # chi = 2 / |2 - phi - sqrt(phi^2 - 4 phi)|
    w, c = constriction_coefficients(5.0)
    assert w == pytest.approx(2 / abs(2 - 5 - math.sqrt(5)))
    assert c == pytest.approx(2.5 * w)
    for bad in (4.0, math.nan, 1e200):
        with pytest.raises(ValueError, match=r"phi must lie in \(4, 1e6\]"):
            constriction_coefficients(bad)
