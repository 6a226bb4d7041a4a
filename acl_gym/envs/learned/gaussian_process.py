"""Gaussian processes with a length scale for each feature, fitted by scikit-learn."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from acl_gym.envs.learned.expansion import Certainty, Terms
from acl_gym.utils.typing import FloatArray, IntArray

MOST_SEARCHED = 200
"""Points on which the length scales are searched for."""

MOST_TRIED = 60
"""Steps of that search."""

MOST_POINTS = 2_000
"""Points that the posterior takes into account, evenly spread over the recording."""

MOST_TELLING = 64
"""Points from which the deviation is computed, see `Certainty`."""

N_WAVES = 128
"""Cosines that stand for a draw from the prior."""

_AMPLITUDES, _LENGTHS, _NOISES = (1e-3, 1e4), (5e-2, 1e3), (1e-7, 1.0)
"""Ranges that are searched, in units of deviations of the data."""


@dataclass(frozen=True)
class Scales:
    """The hyperparameters of one output.

    Attributes:
        amplitude: prior variance, in units of the variance of the data.
        lengths: of the features, `(n_features,)`.
        noise: variance of the noise.
    """

    amplitude: float
    lengths: FloatArray
    noise: float


def search_scales(
    rows: FloatArray, targets: FloatArray, begins: Sequence[Scales]
) -> Scales:
    """Find the hyperparameters that make the data of one output the most likely.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n,)`, of about unit size.
        begins: where to begin searches, of which the best result is taken.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor

    chosen = spread_evenly(len(rows), MOST_SEARCHED)
    best, most = begins[0], -np.inf
    for begin in begins:
        with warnings.catch_warnings():
            # A length at the end of its range means that the feature does not matter.
            warnings.simplefilter("ignore", ConvergenceWarning)
            fitted = GaussianProcessRegressor(_kernel(begin), optimizer=_climb).fit(
                rows[chosen], targets[chosen]
            )
        likelihood = float(fitted.log_marginal_likelihood_value_)
        if likelihood > most:
            bell, white = fitted.kernel_.k1, fitted.kernel_.k2
            lengths = np.broadcast_to(bell.k2.length_scale, rows.shape[1])
            best, most = (
                Scales(
                    float(bell.k1.constant_value),
                    np.array(lengths, dtype=np.float64),
                    float(white.noise_level),
                ),
                likelihood,
            )
    return best


def first_scales(n_features: int) -> Scales:
    """Where a search begins of which nothing is known."""
    return Scales(1.0, np.full(n_features, 2.0), 1e-3)


class Posterior:
    """A Gaussian process of one output given all data, or `MOST_POINTS` of them.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n,)`.
        scales: its hyperparameters.

    Attributes:
        kept: the numbers of the rows that are taken into account.
    """

    def __init__(self, rows: FloatArray, targets: FloatArray, scales: Scales) -> None:
        self.kept = spread_evenly(len(rows), MOST_POINTS)
        self.scales = scales
        self.rows, self._targets = rows[self.kept], targets[self.kept]
        scaled = self.rows / scales.lengths
        covariance = scales.amplitude * _bells(scaled, scaled)
        nugget = scales.noise + _JITTER * scales.amplitude
        covariance[np.diag_indices(len(scaled))] += nugget
        self._factor = cho_factor(covariance, lower=True)
        self._weights = cho_solve(self._factor, self._targets)

    def errors_left_out(self, folds: IntArray) -> FloatArray:
        """By how much each point is missed by the process that does not know its fold.

        With W = K^-1, the errors of a fold are (W_ff)^-1 (W y)_f, without fitting again.

        Args:
            folds: the number of the fold of each row, `(n,)`.

        Returns:
            `(n_kept,)`, in the order of the points that are kept.
        """
        of_kept = folds[self.kept]
        errors = np.empty(self.kept.size)
        inverse = cho_solve(self._factor, np.eye(self.kept.size))
        for fold in np.unique(of_kept):
            rows = np.flatnonzero(of_kept == fold)
            block = inverse[np.ix_(rows, rows)]
            errors[rows] = np.linalg.solve(block, self._weights[rows])
        return errors

    def terms(self, n_draws: int, rng: np.random.Generator) -> Terms:
        """The mean, and draws from the posterior.

        A draw is one from the prior, a sum of random waves, which the data then correct
        (Matheron's rule).

        Args:
            n_draws: how many, >= 0.
            rng: draws them.
        """
        each, n_features = self.scales, self.rows.shape[1]
        n_waves = N_WAVES if n_draws else 0
        directions = rng.standard_normal((n_features, n_waves))
        phases = rng.uniform(0.0, 2.0 * np.pi, n_waves)
        basis = np.cos(self.rows / each.lengths @ directions + phases)
        bells, waves = [self._weights], [np.zeros(n_waves)]
        for _ in range(n_draws):
            size = np.sqrt(2.0 * each.amplitude / n_waves)
            wave = size * rng.standard_normal(n_waves)
            noise = np.sqrt(each.noise) * rng.standard_normal(len(self.rows))
            missed = self._targets - basis @ wave - noise
            bells.append(cho_solve(self._factor, missed))
            waves.append(wave)
        return Terms(
            1.0 / each.lengths,
            (self.rows / each.lengths).T,
            each.amplitude * np.array(bells),
            directions,
            phases,
            np.array(waves),
        )


def certainty_of(rows: Sequence[FloatArray], scales: Sequence[Scales]) -> Certainty:
    """What processes with these scales know, given the rows of each output."""
    points, whitening = [], []
    for known, each in zip(rows, scales, strict=True):
        scaled = known[spread_evenly(len(known), MOST_POINTS)] / each.lengths
        noise = each.noise / each.amplitude
        most = min(MOST_TELLING, len(scaled))
        telling = scaled[_most_telling(scaled, noise, most)]
        covariance = _bells(telling, telling)
        covariance[np.diag_indices(most)] += noise + _JITTER
        factor = np.linalg.cholesky(covariance)
        inverse = solve_triangular(factor, np.eye(most), lower=True)
        more = MOST_TELLING - most  # points that explain nothing
        points.append(np.pad(telling.T, [(0, 0), (0, more)]))
        whitening.append(np.pad(inverse.T, (0, more)))
    return Certainty(
        np.array([1.0 / each.lengths for each in scales]),
        np.array(points),
        np.array(whitening),
        np.sqrt([each.amplitude for each in scales]),
    )


_JITTER = 1e-9


def _most_telling(scaled: FloatArray, noise: float, most: int) -> IntArray:
    """Points of which each is the least certain given those before (pivoted Cholesky)."""
    left = np.ones(len(scaled))
    known = np.zeros((most, len(scaled)))
    chosen = np.empty(most, np.int64)
    free = np.ones(len(scaled), np.bool_)
    for number in range(most):
        best = int(np.argmax(np.where(free, left, -np.inf)))
        chosen[number], free[best] = best, False
        near = _bells(scaled[best : best + 1], scaled)[0]
        near -= known[:number, best] @ known[:number]
        size = np.sqrt(max(left[best], 0.0) + noise + _JITTER)
        known[number] = near / size
        left = left - known[number] ** 2
    return chosen


def _bells(one: FloatArray, other: FloatArray) -> FloatArray:
    """exp(-|a - b|^2 / 2) of all pairs."""
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1)
    return np.asarray(np.exp(np.minimum(one @ other.T - 0.5 * squares, 0.0)))


def _kernel(begin: Scales) -> Any:
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    clip = np.clip
    return ConstantKernel(clip(begin.amplitude, *_AMPLITUDES), _AMPLITUDES) * RBF(
        clip(begin.lengths, *_LENGTHS), _LENGTHS
    ) + WhiteKernel(clip(begin.noise, *_NOISES), _NOISES)


def _climb(likelihood: Any, begin: FloatArray, bounds: FloatArray) -> Any:
    """Search as scikit-learn does, but not for ever."""
    from scipy.optimize import minimize

    found = minimize(
        likelihood,
        begin,
        method="L-BFGS-B",
        jac=True,
        bounds=bounds,
        options={"maxiter": MOST_TRIED},
    )
    return found.x, found.fun


def spread_evenly(count: int, most: int) -> IntArray:
    """At most so many of 0..count - 1, evenly spread."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.int64)
