"""What all planners share: checks of their settings, and sweeps until convergence."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from tqdm import tqdm

from acl_gym.utils import validation


def checked_settings(
    discount: float, tolerance: float, max_iterations: int
) -> tuple[float, float, int]:
    """Return the discount, the tolerance and the limit on sweeps, validated.

    Raises:
        TypeError: one of them has the wrong type.
        ValueError: one of them is out of range.
    """
    return (
        checked_discount(discount),
        validation.number("tolerance", tolerance, above=0),
        validation.integer("max_iterations", max_iterations, at_least=1),
    )


def checked_discount(discount: float) -> float:
    """Return gamma_rl, a number in [0, 1]."""
    return validation.number("discount", discount, at_least=0, at_most=1)


def sweep_until_converged(
    sweep: Callable[[], float],
    tolerance: float,
    max_iterations: int,
    progress: str | None,
) -> tuple[int, float]:
    """Sweep until no value changes by more than `tolerance`, or the limit is reached.

    Args:
        sweep: updates all values once and returns the largest change.
        tolerance: > 0.
        max_iterations: the largest number of sweeps, >= 1.
        progress: the title of a progress bar; None shows none.

    Returns:
        The number of sweeps and the largest change in the last one.
    """
    change, iterations = np.inf, 0
    with tqdm(total=max_iterations, disable=progress is None, desc=progress) as bar:
        while change > tolerance and iterations < max_iterations:
            change = sweep()
            iterations += 1
            bar.update()
    return iterations, float(change)
