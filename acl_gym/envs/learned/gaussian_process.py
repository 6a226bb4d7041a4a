"""Gaussian processes with a length scale for each feature, fitted by scikit-learn."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from acl_gym.envs.learned.expansion import Certainty, Expansion, padded
from acl_gym.utils.typing import FloatArray, IntArray

MOST_SEARCHED = 200
"""Points on which the length scales are searched for."""

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
    rows: FloatArray, targets: FloatArray, begin: list[Scales] | None = None
) -> list[Scales]:
    """Find the hyperparameters of each output that make the data most likely.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n, n_outputs)`, of about unit size.
        begin: where to begin the search, such as the result for fewer data.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor

    chosen = spread_evenly(len(rows), MOST_SEARCHED)
    found = []
    for output in range(targets.shape[1]):
        first = None if begin is None else begin[output]
        with warnings.catch_warnings():
            # A length at the end of its range means that the feature does not matter.
            warnings.simplefilter("ignore", ConvergenceWarning)
            fitted = GaussianProcessRegressor(_kernel(first, rows.shape[1])).fit(
                rows[chosen], targets[chosen, output]
            )
        bell, white = fitted.kernel_.k1, fitted.kernel_.k2
        lengths = np.broadcast_to(bell.k2.length_scale, rows.shape[1])
        found.append(
            Scales(
                float(bell.k1.constant_value),
                np.array(lengths, dtype=np.float64),
                float(white.noise_level),
            )
        )
    return found


class Posterior:
    """A Gaussian process given all data, or `MOST_POINTS` of them.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n, n_outputs)`.
        scales: of each output.
    """

    def __init__(
        self, rows: FloatArray, targets: FloatArray, scales: list[Scales]
    ) -> None:
        self.kept = spread_evenly(len(rows), MOST_POINTS)
        self._rows, self._targets, self._scales = rows, targets, scales
        kept = rows[self.kept]
        self._factors = [
            cho_factor(_covariance(kept, each), lower=True) for each in scales
        ]
        self._weights = [
            cho_solve(factor, targets[self.kept, output])
            for output, factor in enumerate(self._factors)
        ]

    def errors_left_out(self, folds: IntArray) -> FloatArray:
        """By how much each point is missed by the process that does not know its fold.

        With W = K^-1, the errors of a fold are (W_ff)^-1 (W y)_f, without fitting again.

        Args:
            folds: the number of the fold of each point, `(n,)`.

        Returns:
            `(n_kept, n_outputs)`, in the order of the points that are kept.
        """
        of_kept = folds[self.kept]
        errors = np.empty((self.kept.size, len(self._scales)))
        for output, factor in enumerate(self._factors):
            inverse = cho_solve(factor, np.eye(self.kept.size))
            for fold in np.unique(of_kept):
                rows = np.flatnonzero(of_kept == fold)
                block = inverse[np.ix_(rows, rows)]
                errors[rows, output] = np.linalg.solve(
                    block, self._weights[output][rows]
                )
        return errors

    def expansion(self, n_draws: int = 0, seed: int = 0) -> Expansion:
        """The mean, and draws from the posterior.

        A draw is one from the prior, a sum of random waves, which the data then correct
        (Matheron's rule).

        Args:
            n_draws: how many, >= 0.
            seed: of the draws.
        """
        kept, rng = self._rows[self.kept], np.random.default_rng(seed)
        n_waves = N_WAVES if n_draws else 0
        bells, waves = [], []
        directions, phases = [], []
        for output, each in enumerate(self._scales):
            weights = [self._weights[output]]
            of_waves = [np.zeros(n_waves)]
            direction = rng.standard_normal((kept.shape[1], n_waves))
            phase = rng.uniform(0.0, 2.0 * np.pi, n_waves)
            basis = np.cos(kept / each.lengths @ direction + phase)
            for _ in range(n_draws):
                size = np.sqrt(2.0 * each.amplitude / n_waves)
                wave = size * rng.standard_normal(n_waves)
                noise = np.sqrt(each.noise) * rng.standard_normal(len(kept))
                missed = self._targets[self.kept, output] - basis @ wave - noise
                weights.append(cho_solve(self._factors[output], missed))
                of_waves.append(wave)
            bells.append(each.amplitude * np.array(weights))
            waves.append(np.array(of_waves))
            directions.append(direction)
            phases.append(phase)
        inverse = np.array([1.0 / each.lengths for each in self._scales])
        centres = np.array([(kept * row).T for row in inverse])
        return Expansion(
            inverse,
            padded(centres),
            padded(np.array(bells).transpose(1, 0, 2)),
            padded(np.array(directions)),
            padded(np.array(phases)),
            padded(np.array(waves).transpose(1, 0, 2)),
        )

    def certainty(self) -> Certainty:
        """What is known where."""
        return certainty_of(self._rows, self._scales)


def certainty_of(rows: FloatArray, scales: list[Scales]) -> Certainty:
    """What processes with these scales know, given points `(n, n_features)`."""
    rows = rows[spread_evenly(len(rows), MOST_POINTS)]
    most = min(MOST_TELLING, len(rows))
    points, whitening = [], []
    for each in scales:
        scaled = rows / each.lengths
        chosen = _most_telling(scaled, each.noise / each.amplitude, most)
        telling = scaled[chosen]
        covariance = _bells(telling, telling)
        covariance[np.diag_indices(most)] += each.noise / each.amplitude + _JITTER
        factor = np.linalg.cholesky(covariance)
        points.append(telling.T)
        whitening.append(solve_triangular(factor, np.eye(most), lower=True).T)
    return Certainty(
        np.array([1.0 / each.lengths for each in scales]),
        padded(np.array(points)),
        padded(_padded_square(np.array(whitening))),
        np.sqrt([each.amplitude for each in scales]),
    )


_JITTER = 1e-9


def _padded_square(matrices: FloatArray) -> FloatArray:
    """Rows of zeros added, as many as `padded` adds columns."""
    return padded(matrices.transpose(0, 2, 1)).transpose(0, 2, 1)


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


def _covariance(rows: FloatArray, scales: Scales) -> FloatArray:
    scaled = rows / scales.lengths
    covariance = scales.amplitude * _bells(scaled, scaled)
    covariance[np.diag_indices(len(rows))] += scales.noise + _JITTER * scales.amplitude
    return covariance


def _bells(one: FloatArray, other: FloatArray) -> FloatArray:
    """exp(-|a - b|^2 / 2) of all pairs."""
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1)
    return np.asarray(np.exp(np.minimum(one @ other.T - 0.5 * squares, 0.0)))


def _kernel(begin: Scales | None, n_features: int) -> Any:
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    if begin is None:
        begin = Scales(1.0, np.full(n_features, 2.0), 1e-3)
    clip = np.clip
    return ConstantKernel(clip(begin.amplitude, *_AMPLITUDES), _AMPLITUDES) * RBF(
        clip(begin.lengths, *_LENGTHS), _LENGTHS
    ) + WhiteKernel(clip(begin.noise, *_NOISES), _NOISES)


def spread_evenly(count: int, most: int) -> IntArray:
    """At most so many of 0..count - 1, evenly spread."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.int64)
