"""Gaussian processes written from their equations, one point after the other."""

from __future__ import annotations

import math

import numpy as np

from acl_gym.envs.learned.gaussian_process import Scales
from acl_gym.utils.typing import FloatArray


def covariance(one: FloatArray, other: FloatArray, scales: Scales) -> FloatArray:
    """k(a, b) = amplitude exp(-sum_f ((a_f - b_f) / l_f)^2 / 2)."""
    found = np.empty((len(one), len(other)))
    for i, a in enumerate(one):
        for j, b in enumerate(other):
            total = 0.0
            for f, length in enumerate(scales.lengths):
                total += ((a[f] - b[f]) / length) ** 2
            found[i, j] = scales.amplitude * math.exp(-total / 2)
    return found


def posterior(
    rows: FloatArray, targets: FloatArray, scales: Scales, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean K* K^-1 y and deviation of f at some points."""
    own = covariance(rows, rows, scales) + scales.noise * np.eye(len(rows))
    across = covariance(at, rows, scales)
    inverse = np.linalg.inv(own)
    mean = across @ inverse @ targets
    variance = scales.amplitude - np.diag(across @ inverse @ across.T)
    return mean, np.sqrt(np.maximum(variance, 0.0))


def evaluate(
    inverse_lengths: FloatArray,
    centres: FloatArray,
    bells: FloatArray,
    directions: FloatArray,
    phases: FloatArray,
    waves: FloatArray,
    row: FloatArray,
) -> float:
    """One output of one member at one row, see `Expansion`."""
    z = [x * w for x, w in zip(row, inverse_lengths, strict=True)]
    total = 0.0
    for j, weight in enumerate(bells):
        square = sum((a - b) ** 2 for a, b in zip(z, centres[:, j], strict=True))
        total += weight * math.exp(-square / 2)
    for q, weight in enumerate(waves):
        angle = sum(a * b for a, b in zip(z, directions[:, q], strict=True))
        total += weight * math.cos(angle + phases[q])
    return total
