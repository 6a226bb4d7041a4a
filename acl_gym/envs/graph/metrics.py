"""Distances between cities from their coordinates, as TSPLIB (Reinelt 1991) defines them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

Metric = Callable[[FloatArray], FloatArray]

_PI, _EARTH = 3.141592, 6378.388
"""The numbers of TSPLIB; with better ones its distances would come out differently."""


def distances_between(coordinates: FloatArray, metric: str) -> FloatArray:
    """Return the distances between all cities, `(n, n)`, with zeros on the diagonal.

    Args:
        coordinates: `(n, 2)`; for "geo" the latitude and longitude as degrees and
            minutes, DDD.MM.
        metric: a key of `METRICS`.

    Raises:
        ValueError: there is no such metric.
    """
    name = validation.one_of("metric", metric, tuple(METRICS))
    with np.errstate(over="ignore", invalid="ignore"):  # the caller refuses infinity
        distances = METRICS[name](coordinates)
    np.fill_diagonal(distances, 0.0)  # "geo" gives 1 there
    return distances


def _euclidean(coordinates: FloatArray) -> FloatArray:
    x, y = coordinates.T
    squares = np.subtract.outer(x, x)
    squares *= squares
    other = np.subtract.outer(y, y)
    other *= other
    squares += other
    return np.asarray(np.sqrt(squares, out=squares))


def _rounded(coordinates: FloatArray) -> FloatArray:
    # Half is rounded up, not to the even number.
    return np.asarray(np.floor(_euclidean(coordinates) + 0.5))


def _ceiling(coordinates: FloatArray) -> FloatArray:
    return np.asarray(np.ceil(_euclidean(coordinates)))


def _pseudo_euclidean(coordinates: FloatArray) -> FloatArray:
    # TSPLIB takes the root of the tenth of the squares, whose last bit differs from
    # that of the distance divided by the root of ten.
    x, y = coordinates.T
    squares = np.subtract.outer(x, x) ** 2 + np.subtract.outer(y, y) ** 2
    return np.asarray(np.ceil(np.sqrt(squares / 10.0)))


def _geographical(coordinates: FloatArray) -> FloatArray:
    degrees = np.trunc(coordinates)
    minutes = coordinates - degrees
    latitude, longitude = (_PI * (degrees + 5.0 * minutes / 3.0) / 180.0).T
    q1 = np.cos(np.subtract.outer(longitude, longitude))
    q2 = np.cos(np.subtract.outer(latitude, latitude))
    q3 = np.cos(np.add.outer(latitude, latitude))
    # Rounding may leave the cosine of the angle between equal places above 1.
    cosine = np.clip(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3), -1.0, 1.0)
    return np.asarray(np.floor(_EARTH * np.arccos(cosine) + 1.0))


METRICS: dict[str, Metric] = {
    "euclidean": _euclidean,
    "euc_2d": _rounded,
    "ceil_2d": _ceiling,
    "att": _pseudo_euclidean,
    "geo": _geographical,
}
"""Name -> distances: exact ones, and those of TSPLIB, which are whole numbers."""
