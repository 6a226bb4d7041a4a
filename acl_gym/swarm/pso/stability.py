"""When particle swarms converge: exact moments of a particle whose bests stand still.

While theta_pbest = p and theta_lbest = g do not change, the coordinates of a particle
are independent of each other, and each follows a linear recursion with the random
coefficient C = c1 r1 + c2 r2, where r1 and r2 are uniform on [0, 1]:

    nu' = w nu + c1 r1 (p - theta) + c2 r2 (g - theta)
    theta' = theta + nu'      in the standard order,
    theta' = theta + nu       in the order in which (6.1) is printed.

The means of (theta, nu) and the means of their products follow recursions with constant
matrices. A swarm is **order-1 stable** if the means converge, and **order-2 stable** if
the variances converge as well; the spectral radii of the two matrices decide. Nothing
here is sampled.

For c1 = c2 in the standard order the two conditions have closed forms: c1 + c2 <
4 (1 + w), and c1 + c2 < 24 (1 - w^2) / (7 - 5 w) (R. Poli, "Mean and variance of the
sampling distribution of particle swarm optimizers during stagnation", IEEE Transactions
on Evolutionary Computation 13, 2009), with |w| < 1 and c1 + c2 > 0 in both.

Common arguments:
    inertia: w, in [-1e6, 1e6].
    cognitive: c1, in [0, 1e6].
    social: c2, in [0, 1e6].
    order: `"standard"` or `"literal"`, see `acl_gym.swarm.pso.landscape.Landscape`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.pso.coefficients import ORDERS
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

MEAN, VARIANCE = 1 / 2, 1 / 12
"""Of a number that is uniform on [0, 1]."""

MOST = 1e6
"""The largest coefficient; squares of larger ones may not fit into a float."""


def mean_matrix(
    inertia: float, cognitive: float, social: float, order: str = "standard"
) -> FloatArray:
    """The matrix M of E[z'] = M E[z] + b for z = (theta, nu), shape `(2, 2)`."""
    fixed, random = _recursion(inertia, order)
    mean, _ = _moments_of_c(cognitive, social)
    return fixed - mean * random


def second_moment_matrix(
    inertia: float, cognitive: float, social: float, order: str = "standard"
) -> FloatArray:
    """The matrix of the recursion of E[z z^T], z = (theta, nu), where p = g = 0.

    Returns:
        It takes the vector (E[theta^2], E[theta nu], E[nu^2]) to the next one, `(3, 3)`.
    """
    fixed, random = _recursion(inertia, order)
    mean, square = _moments_of_c(cognitive, social)
    full = (
        np.kron(fixed, fixed)
        - mean * (np.kron(fixed, random) + np.kron(random, fixed))
        + square * np.kron(random, random)
    )
    # Of (theta theta, theta nu, nu theta, nu nu) the middle two are equal.
    rows = full[[0, 1, 3]]
    return np.column_stack([rows[:, 0], rows[:, 1] + rows[:, 2], rows[:, 3]])


def spectral_radius(
    inertia: ArrayLike,
    cognitive: ArrayLike,
    social: ArrayLike,
    *,
    moment: int = 2,
    order: str = "standard",
) -> FloatArray:
    """By what factor the moments grow or shrink a step, in the long run.

    Below 1 the swarm is stable of that order. The second moments bound the first: the
    radius for `moment=2` is at least the square of that for `moment=1`.

    Args:
        inertia: w.
        cognitive: c1.
        social: c2; the three are broadcast against each other.
        moment: 1, the means, or 2, the means of products.
        order: see `acl_gym.swarm.pso.stability`.

    Returns:
        The radii, in the shape of the arguments.

    Raises:
        ValueError: an argument is out of range.
    """
    make = _matrix_of(moment)
    arrays = np.broadcast_arrays(
        *(
            validation.real_array(name, values)
            for name, values in (
                ("inertia", inertia),
                ("cognitive", cognitive),
                ("social", social),
            )
        )
    )
    matrices = [
        make(float(w), float(c1), float(c2), order)
        for w, c1, c2 in zip(*(array.flat for array in arrays), strict=True)
    ]
    radii = np.abs(np.linalg.eigvals(np.array(matrices))).max(axis=-1)
    return np.asarray(radii.reshape(arrays[0].shape))


def is_stable(
    inertia: float,
    cognitive: float,
    social: float,
    *,
    moment: int = 2,
    order: str = "standard",
) -> bool:
    """Whether the moments converge, see `acl_gym.swarm.pso.stability`.

    Raises:
        TypeError: a coefficient is not a number; `spectral_radius` takes arrays.
        ValueError: an argument is out of range.
    """
    for name, value in (
        ("inertia", inertia),
        ("cognitive", cognitive),
        ("social", social),
    ):
        validation.number(name, value)
    return bool(
        spectral_radius(inertia, cognitive, social, moment=moment, order=order) < 1.0
    )


def largest_acceleration(
    inertia: float, *, moment: int = 2, order: str = "standard", share: float = 0.5
) -> float:
    """The least upper bound of c1 + c2 below which the moments converge.

    Args:
        inertia: w, in (-1, 1).
        moment: 1, the means, or 2, the means of products.
        order: see `acl_gym.swarm.pso.stability`.
        share: c1 / (c1 + c2), in [0, 1].

    Returns:
        The bound, > 0. It holds for any share of c1, in closed form; for c1 = c2 it is
        Poli's in the standard order.

    Raises:
        ValueError: an argument is out of range.
    """
    inertia = validation.number("inertia", inertia, above=-1, below=1)
    share = validation.number("share", share, at_least=0, at_most=1)
    literal = validation.one_of("order", order, ORDERS) == "literal"
    if _checked_moment(moment) == 1:
        # Both roots of the characteristic polynomial lie within the circle (Jury).
        return 2.0 * (1.0 - inertia) if literal else 4.0 * (1.0 + inertia)
    # The matrix of the second moments maps covariances to covariances, so that its
    # spectral radius is an eigenvalue, and the bound a root of det(I - M) = 0. With
    # t = c1 + c2, E[C] = t / 2 and E[C^2] = square t^2 that is, after division by t,
    #     1 - w^2 + (w / 2) t = square (1 + w) t                        standard,
    #     1 - w^2 - (w / 2) t = square t (1 + w + t / 2)                literal.
    square = VARIANCE * (share**2 + (1.0 - share) ** 2) + MEAN**2
    rest = (1.0 - inertia) * (1.0 + inertia)
    if not literal:
        return rest / (square * (1.0 + inertia) - inertia / 2.0)
    half = (square * (1.0 + inertia) + inertia / 2.0) / 2.0
    root = math.sqrt(half * half + square * rest / 2.0)
    return rest / (half + root) if half > 0.0 else 2.0 * (root - half) / square


@dataclass(frozen=True)
class Moments:
    """Of one coordinate of a particle's position, step by step.

    Attributes:
        mean: E[theta], `(steps + 1,)`.
        variance: of theta, `(steps + 1,)`.
    """

    mean: FloatArray
    variance: FloatArray


def position_moments(
    inertia: float,
    cognitive: float,
    social: float,
    *,
    position: float,
    velocity: float = 0.0,
    personal_best: float,
    local_best: float,
    steps: int,
    order: str = "standard",
) -> Moments:
    """Mean and variance of a position while the two bests stand still.

    Args:
        inertia: see `acl_gym.swarm.pso.stability`.
        cognitive: see there.
        social: see there.
        position: theta at the beginning.
        velocity: nu at the beginning.
        personal_best: p.
        local_best: g.
        steps: how many, >= 0.
        order: see `acl_gym.swarm.pso.stability`.

    Returns:
        Mean and variance at the steps 0 to `steps`.

    Raises:
        ValueError: an argument is out of range, or a moment larger than a float can hold.
        TypeError: `steps` is not an integer.
    """
    steps = validation.integer("steps", steps, at_least=0)
    fixed, random = _recursion(inertia, order)
    c1, c2 = _accelerations(cognitive, social)
    p = validation.number("personal_best", personal_best)
    g = validation.number("local_best", local_best)
    # Seen from the point to which the mean tends, and the variance on its own: squares of
    # large coordinates would hide the variance.
    total = c1 + c2
    origin = p if c2 == 0.0 else g if c1 == 0.0 else p + c2 / total * (g - p)
    mean = np.array(
        [
            validation.number("position", position) - origin,
            validation.number("velocity", velocity),
        ]
    )
    # z' = (A - (c1 r1 + c2 r2) B) z + (c1 r1 p + c2 r2 g) b with z = (theta, nu).
    receives = random[:, 0]  # which of theta and nu the attraction enters
    pulls = ((c1, p - origin), (c2, g - origin))
    step_mean = fixed - MEAN * total * random
    # 0 but for the rounding of the origin.
    drift = MEAN * (c1 * (p - origin) + c2 * (g - origin)) * receives
    noise = VARIANCE * np.outer(receives, receives)
    covariance = np.zeros((2, 2))
    means, variances = np.empty(steps + 1), np.empty(steps + 1)
    for step in range(steps + 1):
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.outer(mean, mean)
        if not (np.isfinite(squares).all() and np.isfinite(covariance).all()):
            raise ValueError(
                f"steps must be fewer than {step}, got {steps}: the moments of a swarm "
                "that is not stable are then larger than a float can hold."
            )
        means[step], variances[step] = mean[0], covariance[0, 0]
        with np.errstate(over="ignore", invalid="ignore"):
            # r1 and r2 add c_i (best_i - theta) r_i to the coordinates that receive it,
            # independently of each other and of theta.
            spread = sum(
                c * c * ((best - mean[0]) ** 2 + covariance[0, 0]) for c, best in pulls
            )
            covariance = step_mean @ covariance @ step_mean.T + spread * noise
            mean = step_mean @ mean + drift
    return Moments(means + origin, variances)


def _recursion(inertia: float, order: str) -> tuple[FloatArray, FloatArray]:
    """A and B of z' = (A - C B) z, z = (theta, nu), for p = g = 0."""
    w = validation.number("inertia", inertia, at_least=-MOST, at_most=MOST)
    if validation.one_of("order", order, ORDERS) == "standard":
        return np.array([[1.0, w], [0.0, w]]), np.array([[1.0, 0.0], [1.0, 0.0]])
    return np.array([[1.0, 1.0], [0.0, w]]), np.array([[0.0, 0.0], [1.0, 0.0]])


def _accelerations(cognitive: float, social: float) -> tuple[float, float]:
    """c1 and c2, checked."""
    return (
        validation.number("cognitive", cognitive, at_least=0, at_most=MOST),
        validation.number("social", social, at_least=0, at_most=MOST),
    )


def _moments_of_c(cognitive: float, social: float) -> tuple[float, float]:
    """E[C] and E[C^2] of C = c1 r1 + c2 r2."""
    c1, c2 = _accelerations(cognitive, social)
    mean = MEAN * (c1 + c2)
    return mean, VARIANCE * (c1 * c1 + c2 * c2) + mean * mean


def _matrix_of(moment: int) -> Callable[[float, float, float, str], FloatArray]:
    return mean_matrix if _checked_moment(moment) == 1 else second_moment_matrix


def _checked_moment(moment: Any) -> int:
    if not isinstance(moment, Real) or moment not in (1, 2):
        raise ValueError(
            f"moment must be 1, the means, or 2, the means of products, got "
            f"{validation.shown(moment)}."
        )
    return 1 if moment == 1 else 2
