"""Range checks of the theory's arguments."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


def checked(
    name: str,
    values: ArrayLike,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
    finite: bool = True,
) -> FloatArray:
    """Return numbers as an array; a number out of range raises a ValueError."""
    array = validation.real_array(name, values, finite=finite)
    inside = (array > above) | (above == -math.inf)
    inside &= (array >= at_least) & (array <= at_most)
    inside &= (array < below) | (below == math.inf)
    if not inside.all():
        bad = float(array[~inside].flat[0])
        left = f"[{at_least:g}" if above == -math.inf else f"({above:g}"
        right = f"{below:g})" if math.isinf(at_most) else f"{at_most:g}]"
        raise ValueError(f"{name} must lie in {left}, {right}, got {bad:g}.")
    return array


def positive(name: str, values: ArrayLike) -> FloatArray:
    """Check numbers that must be > 0."""
    return checked(name, values, above=0)


def n_ants_checked(values: ArrayLike) -> FloatArray:
    """Check the number of ants M, >= 1."""
    return checked("n_ants", values, at_least=1)


def epsilon_checked(values: ArrayLike) -> FloatArray:
    """Check the exploration probability epsilon, in [0, 1]."""
    return checked("epsilon", values, at_least=0, at_most=1)


def local_decay_checked(values: ArrayLike) -> FloatArray:
    """Check the local decay gamma, in [0, 1)."""
    return checked("local_decay", values, at_least=0, below=1)


def global_decay_checked(values: ArrayLike) -> FloatArray:
    """Check the global decay rho, in (0, 1]."""
    return checked("global_decay", values, above=0, at_most=1)
