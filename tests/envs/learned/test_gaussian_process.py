"""Processes and their kernels against the equations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.envs.learned.expansion import Expansion, Terms
from acl_gym.envs.learned.gaussian_process import (
    MOST_TELLING,
    Posterior,
    Scales,
    certainty_of,
    log_likelihood,
    search_scales,
    spread_evenly,
)
from acl_gym.utils.typing import FloatArray
from tests.envs.learned.reference_process import evaluate, posterior

SEEDS = st.integers(0, 2**32 - 1)


def data(
    n: int, n_features: int, seed: int, noise: float = 0.01
) -> tuple[FloatArray, FloatArray, Scales]:
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-2, 2, (n, n_features))
    targets = np.sin(rows).sum(axis=1) + np.sqrt(noise) * rng.standard_normal(n)
    lengths = rng.uniform(0.5, 3.0, n_features)
    return rows, targets, Scales(float(rng.uniform(0.5, 4.0)), lengths, noise)


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 20), st.integers(1, 5), SEEDS)
def test_the_mean_is_that_of_the_equation(n: int, n_features: int, seed: int) -> None:
    rows, targets, scales = data(n, n_features, seed)
    at = np.random.default_rng(seed + 1).uniform(-3, 3, (7, n_features))
    expected, _ = posterior(rows, targets, scales, at)
    terms = Posterior(rows, targets, scales).terms(0, np.random.default_rng(0))
    found = Expansion.of([terms]).mean(at)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@settings(max_examples=10, deadline=None)
@given(st.integers(1, MOST_TELLING // 2), st.integers(1, 5), SEEDS)
def test_the_deviation_is_that_of_the_equation(
    n: int, n_features: int, seed: int
) -> None:
    """Where all points are taken into account."""
    rows, targets, scales = data(n, n_features, seed)
    at = np.random.default_rng(seed + 1).uniform(-4, 4, (7, n_features))
    _, expected = posterior(rows, targets, scales, at)
    found = certainty_of([rows], [scales]).deviation(at)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_the_deviation_of_fewer_points_is_an_upper_bound_and_close() -> None:
    rows, targets, scales = data(150, 2, 0)
    at = np.random.default_rng(1).uniform(-3, 3, (50, 2))
    _, exact = posterior(rows, targets, scales, at)
    found = certainty_of([rows], [scales]).deviation(at)[:, 0]
    assert (found >= exact - 1e-9).all()
    assert np.corrcoef(found, exact)[0, 1] > 0.95
    assert found.max() <= np.sqrt(scales.amplitude)


def test_far_from_all_data_nothing_is_known() -> None:
    rows, _, scales = data(30, 2, 0)
    far = certainty_of([rows], [scales]).deviation(np.full((1, 2), 1e3))
    assert far[0, 0] == pytest.approx(np.sqrt(scales.amplitude))


def test_errors_left_out_are_those_of_processes_fitted_without() -> None:
    rows, targets, scales = data(40, 2, 3)
    folds = np.arange(40) // 8
    found = Posterior(rows, targets, scales).errors_left_out(folds)
    for fold in range(5):
        out = folds == fold
        mean, _ = posterior(rows[~out], targets[~out], scales, rows[out])
        np.testing.assert_allclose(found[out], targets[out] - mean, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 3),
    st.integers(1, 4),
    st.lists(st.integers(0, 13), min_size=3, max_size=3),
    st.lists(st.integers(0, 9), min_size=3, max_size=3),
    SEEDS,
)
def test_the_kernel_adds_up_what_the_sum_says(
    n_outputs: int, n_features: int, bells: list[int], waves: list[int], seed: int
) -> None:
    """Outputs may have different numbers of terms, and none."""
    rng = np.random.default_rng(seed)
    outputs = [
        Terms(
            rng.uniform(0.2, 2.0, n_features),
            rng.standard_normal((n_features, bells[o])),
            rng.standard_normal((3, bells[o])),
            rng.standard_normal((n_features, waves[o])),
            rng.uniform(0, 6, waves[o]),
            rng.standard_normal((3, waves[o])),
        )
        for o in range(n_outputs)
    ]
    rows, members = rng.standard_normal((6, n_features)), rng.integers(0, 3, 6)
    found = Expansion.of(outputs).of_members(rows, members)
    for i in range(6):
        for o, each in enumerate(outputs):
            expected = evaluate(
                each.inverse_lengths,
                each.centres,
                each.bells[members[i]],
                each.directions,
                each.phases,
                each.waves[members[i]],
                rows[i],
            )
            assert found[i, o] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_row_gives_the_same_bits_in_any_company() -> None:
    rows, targets, scales = data(50, 3, 0)
    terms = Posterior(rows, targets, scales).terms(2, np.random.default_rng(0))
    expansion, known = Expansion.of([terms]), certainty_of([rows], [scales])
    for some in (slice(0, 1), slice(7, 30)):
        np.testing.assert_array_equal(
            expansion.mean(rows)[some], expansion.mean(rows[some])
        )
        np.testing.assert_array_equal(
            known.deviation(rows)[some], known.deviation(rows[some])
        )


def test_draws_have_the_mean_and_the_deviation_of_the_posterior() -> None:
    rows, targets, scales = data(12, 1, 5)
    at = np.linspace(-4, 4, 9)[:, None]
    mean, deviation = posterior(rows, targets, scales, at)
    n_draws = 1_000
    # Waves stand for the prior, the better the more there are: many sets of them.
    drawn = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        terms = Posterior(rows, targets, scales).terms(n_draws // 20, rng)
        expansion = Expansion.of([terms])
        for member in range(1, expansion.n_members):
            members = np.full(len(at), member)
            drawn.append(expansion.of_members(at, members)[:, 0])
    values = np.array(drawn)
    # Four standard errors, and a tenth for the waves.
    np.testing.assert_array_less(
        np.abs(values.mean(axis=0) - mean), 4 * deviation / np.sqrt(n_draws) + 0.1
    )
    np.testing.assert_allclose(values.std(axis=0), deviation, rtol=0.2, atol=0.05)


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 20), st.integers(1, 4), SEEDS)
def test_the_likelihood_is_that_of_scikit_learn(
    n: int, n_features: int, seed: int
) -> None:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    rows, targets, scales = data(n, n_features, seed)
    kernel = ConstantKernel(scales.amplitude) * RBF(scales.lengths)
    other = GaussianProcessRegressor(
        kernel + WhiteKernel(scales.noise), optimizer=None, alpha=1e-9
    ).fit(rows, targets)
    logarithms = np.log([scales.amplitude, *scales.lengths, scales.noise])
    expected = other.log_marginal_likelihood(other.kernel_.theta, eval_gradient=True)
    found = log_likelihood(logarithms, rows, targets)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-4, atol=1e-4)


def test_equal_rows_do_not_make_the_likelihood_singular() -> None:
    rows = np.zeros((500, 1))
    found, gradient = log_likelihood(np.log([1e4, 1.0, 1e-7]), rows, np.arange(500.0))
    assert np.isfinite(found)
    assert np.isfinite(gradient).all()


def test_inputs_of_few_values_do_not_become_cases_of_their_own() -> None:
    """There is a second top of the likelihood at lengths far below their distance."""
    rng = np.random.default_rng(0)
    rows = np.column_stack(
        [rng.uniform(-2, 2, (300, 2)), rng.integers(-1, 2, (300, 2)) * 1.2]
    )
    targets = np.exp(-(rows[:, 0] ** 2)) * rows[:, 1] + 0.1 * rows[:, 2] * rows[:, 0]
    found = search_scales(rows, targets / targets.std())
    assert found.lengths[2:].min() > 2.0


def test_the_search_finds_which_feature_matters() -> None:
    rng = np.random.default_rng(0)
    rows = rng.uniform(-2, 2, (60, 3))
    targets = np.sin(3 * rows[:, 1]) * np.sqrt(2)
    found = search_scales(rows, targets)
    assert found.lengths[1] < 1.0
    assert min(found.lengths[0], found.lengths[2]) > 10 * found.lengths[1]
    assert found.noise < 1e-3


def test_chosen_rows_are_spread_evenly() -> None:
    assert spread_evenly(3, 5).tolist() == [0, 1, 2]
    assert spread_evenly(101, 3).tolist() == [0, 50, 100]
