"""Inertia and acceleration: the constriction coefficients, and checks of all three."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.rows import per_agent
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

ORDERS = ("standard", "literal")
"""Whether a particle moves with its new velocity, or, as (6.1) has it, with the old."""


def constriction_coefficients(phi: float = 4.1) -> tuple[float, float]:
    """Inertia and acceleration with which a swarm contracts (Clerc and Kennedy, 2002).

    A velocity chi (nu + phi_1 (..) + phi_2 (..)) with phi = phi_1 + phi_2 > 4 and
    chi = 2 / |2 - phi - sqrt(phi^2 - 4 phi)| is that of (6.2) with w = chi and
    c1 = c2 = chi phi / 2.

    Args:
        phi: in (4, 1e6]; the larger, the sooner the swarm contracts.

    Returns:
        w and c1 = c2; for phi = 4.1 they are 0.729844 and 1.496180.

    Raises:
        TypeError: phi is no number.
        ValueError: it is out of range.
    """
    phi = validation.number("phi", phi, above=4, at_most=1e6)
    chi = 2.0 / (phi - 2.0 + math.sqrt(phi * phi - 4.0 * phi))
    return chi, chi * phi / 2.0


INERTIA, ACCELERATION = constriction_coefficients()
"""w and c1 = c2, the defaults."""

Inertia = ArrayLike | Callable[[int], ArrayLike]
"""w: a number, one for each particle, or a function of the iteration k = 0, 1, ..."""


def of_each_particle(
    name: str, values: Any, n: int, *, at_least: float = -math.inf
) -> FloatArray:
    """Return a parameter as one finite number for each particle, `(n,)`.

    Args:
        name: what the parameter is called in the error message.
        values: a number, or `(n,)` numbers (Definition 6.8).
        n: number of particles.
        at_least: the least that is allowed.

    Raises:
        ValueError: `values` are neither, or out of range.
    """
    shape = np.shape(validation.real_array(name, values, finite=False))
    if shape not in ((), (n,)):
        raise ValueError(
            f"{name} must be a number, or one for each of the {n} particles, got an "
            f"array of shape {shape}."
        )
    array = per_agent(name, values, n, at_least=at_least, below=math.inf)
    return np.full(n, array)
