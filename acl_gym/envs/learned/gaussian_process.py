"""Gaussian processes with a length scale for each feature.

The search for the scales has a likelihood of its own. With that of scikit-learn, which
the tests hold it to, a search on 200 points takes some twenty times as long, and one
search is not enough: where inputs take a few values only, many a likelihood has a second
top, at which each value is a case of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from acl_gym.envs.learned.expansion import Certainty, Terms
from acl_gym.utils.typing import FloatArray, IntArray

MOST_SEARCHED = 200
"""Points on which searches for scales begin."""

MOST_REFINED = 500
"""Points on which the best of them goes on."""

MOST_TRIED = 60
"""Steps of a search."""

MOST_POINTS = 2_000
"""Points that the posterior takes into account, evenly spread over the recording."""

MOST_TELLING = 64
"""Points from which the deviation is computed, see `Certainty`."""

N_WAVES = 128
"""Cosines that stand for a draw from the prior."""

FIRST_LENGTHS = (1.0, 3.0)
"""Of all features where searches begin, in deviations of the data."""

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
    rows: FloatArray, targets: FloatArray, begins: Sequence[Scales] = ()
) -> Scales:
    """Find the hyperparameters that make the data of one output the most likely.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n,)`, of about unit size.
        begins: where searches begin, beside those of `FIRST_LENGTHS`.
    """
    n_features = rows.shape[1]
    places = [
        Scales(1.0, np.full(n_features, length), 1e-3) for length in FIRST_LENGTHS
    ]
    best = _best_of(rows, targets, [*places, *begins], MOST_SEARCHED)
    if len(rows) > MOST_SEARCHED:
        best = _best_of(rows, targets, [best], MOST_REFINED)
    return best


def log_likelihood(
    logarithms: FloatArray, rows: FloatArray, targets: FloatArray
) -> tuple[float, FloatArray]:
    """How likely data are, and how that changes with the scales.

    Args:
        logarithms: of amplitude, lengths and noise, `(n_features + 2,)`.
        rows: features, `(n, n_features)`.
        targets: `(n,)`.

    Returns:
        The logarithm of the density of the targets, and its gradient.
    """
    amplitude, noise = np.exp(logarithms[0]), np.exp(logarithms[-1])
    scaled = rows / np.exp(logarithms[1:-1])
    bells = amplitude * _bells(scaled, scaled)
    covariance = bells.copy()
    covariance[np.diag_indices(len(rows))] += noise + _JITTER * amplitude
    factor = np.linalg.cholesky(covariance)
    weights = cho_solve((factor, True), targets)
    found = -0.5 * targets @ weights - np.log(np.diag(factor)).sum()
    found -= 0.5 * len(rows) * np.log(2.0 * np.pi)
    # With A = w w' - K^-1, the gradient in any parameter is tr(A dK) / 2.
    inner = np.outer(weights, weights) - cho_solve((factor, True), np.eye(len(rows)))
    shares = inner * bells
    gradient = np.empty_like(logarithms)
    gradient[0] = 0.5 * (shares.sum() + _JITTER * amplitude * np.trace(inner))
    # The sum over all pairs of A K (z_i - z_j)^2 / 2, z being a scaled feature.
    gradient[1:-1] = shares.sum(axis=1) @ scaled**2
    gradient[1:-1] -= (scaled * (shares @ scaled)).sum(axis=0)
    gradient[-1] = 0.5 * noise * np.trace(inner)
    return float(found), gradient


def _best_of(
    rows: FloatArray, targets: FloatArray, begins: Sequence[Scales], most: int
) -> Scales:
    """The most likely scales of several searches on so many points."""
    from scipy.optimize import minimize

    chosen = spread_evenly(len(rows), most)
    rows, targets = rows[chosen], targets[chosen]
    n_features = rows.shape[1]
    bounds = np.log([_AMPLITUDES, *[_LENGTHS] * n_features, _NOISES])

    def unlikely(logarithms: FloatArray) -> tuple[float, FloatArray]:
        found, gradient = log_likelihood(logarithms, rows, targets)
        return -found, -gradient

    best, least = begins[0], np.inf
    for begin in begins:
        logarithms = np.log([begin.amplitude, *begin.lengths, begin.noise])
        found = minimize(
            unlikely,
            np.clip(logarithms, bounds[:, 0], bounds[:, 1]),
            method="L-BFGS-B",
            jac=True,
            bounds=bounds,
            options={"maxiter": MOST_TRIED},
        )
        if found.fun < least:
            amplitude, *lengths, noise = np.exp(found.x)
            best, least = Scales(amplitude, np.array(lengths), noise), found.fun
    return best


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
"""Of the amplitude, so that no covariance is singular within rounding."""


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


def spread_evenly(count: int, most: int) -> IntArray:
    """At most so many of 0..count - 1, evenly spread."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.int64)
