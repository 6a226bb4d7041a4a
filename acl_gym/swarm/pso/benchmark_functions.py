"""Functions on which optimizers are tried: each takes `(n, d)` and returns `(n,)`.

All are 0 at their minimum. The ranges are those of D. Bratton and J. Kennedy, "Defining a
standard for particle swarm optimization" (IEEE Swarm Intelligence Symposium, 2007).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acl_gym.utils.typing import FloatArray


def sphere(points: FloatArray) -> FloatArray:
    """sum_k x_k^2: one minimum, round. Minimum at 0."""
    return np.asarray((points * points).sum(axis=1))


def rosenbrock(points: FloatArray) -> FloatArray:
    """A curved valley, in which the way to the minimum is long. Minimum at (1, .., 1).

    sum_k 100 (x_{k+1} - x_k^2)^2 + (1 - x_k)^2
    """
    left, right = points[:, :-1], points[:, 1:]
    steps = 100.0 * (right - left * left) ** 2 + (1.0 - left) ** 2
    return np.asarray(steps.sum(axis=1))


def rastrigin(points: FloatArray) -> FloatArray:
    """A bowl with a minimum at every point of whole numbers. Least of all at 0.

    sum_k x_k^2 - 10 cos(2 pi x_k) + 10
    """
    waves = points * points - 10.0 * np.cos(2.0 * np.pi * points) + 10.0
    return np.asarray(waves.sum(axis=1))


def ackley(points: FloatArray) -> FloatArray:
    """A plain with small waves and one deep hole. Minimum at 0.

    20 + e - 20 exp(-0.2 sqrt(mean_k x_k^2)) - exp(mean_k cos(2 pi x_k))
    """
    distance = np.sqrt((points * points).mean(axis=1))
    waves = np.exp(np.cos(2.0 * np.pi * points).mean(axis=1))
    return np.asarray(20.0 + np.e - 20.0 * np.exp(-0.2 * distance) - waves)


def griewank(points: FloatArray) -> FloatArray:
    """A wide bowl with many shallow waves. Minimum at 0.

    1 + sum_k x_k^2 / 4000 - prod_k cos(x_k / sqrt(k)), k = 1, .., d
    """
    roots = np.sqrt(np.arange(1.0, points.shape[1] + 1.0))
    waves = np.cos(points / roots).prod(axis=1)
    return np.asarray(1.0 + (points * points).sum(axis=1) / 4000.0 - waves)


@dataclass(frozen=True)
class BenchmarkFunction:
    """A function and where to look for its minimum.

    Attributes:
        function: of `(n, d)`, returns `(n,)`; its minimum is 0.
        largest: the search goes from minus this to this in each variable.
        minimum: each coordinate of the place of the minimum.
    """

    function: Callable[[FloatArray], FloatArray]
    largest: float
    minimum: float

    def bounds(self, d: int) -> list[tuple[float, float]]:
        """The range of each of `d` variables."""
        return [(-self.largest, self.largest)] * d


BENCHMARK_FUNCTIONS = {
    "sphere": BenchmarkFunction(sphere, 100.0, 0.0),
    "rosenbrock": BenchmarkFunction(rosenbrock, 30.0, 1.0),
    "rastrigin": BenchmarkFunction(rastrigin, 5.12, 0.0),
    "ackley": BenchmarkFunction(ackley, 32.0, 0.0),
    "griewank": BenchmarkFunction(griewank, 600.0, 0.0),
}
"""By their names."""
