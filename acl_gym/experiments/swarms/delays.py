"""Whether a swarm at rest stays at rest when its messages are late: linear theory."""

from __future__ import annotations

import numpy as np

from acl_gym.swarm.aggregation import BoundedRepulsion
from acl_gym.swarm.rows import checked_positions
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


def growth_of_disturbances(
    positions: FloatArray,
    time_step: float,
    delay: int,
    interaction: BoundedRepulsion | None = None,
) -> float:
    """The factor by which a small disturbance of a resting swarm grows in a step, at most.

    Agents that know where they are, and hear where others were `delay` steps ago, move by

        x_i(k + 1) = x_i(k) + h sum_j g(x_i(k) - x_j(k - delay)),

    with g of (6.5) and the time step h. Near rest a disturbance d obeys

        d_i(k + 1) = d_i(k) + h sum_j Dg_ij (d_i(k) - d_j(k - delay)),

    with the derivatives Dg_ij of g at x_i - x_j. The factor is the spectral radius of this
    map. It is never below 1, because a swarm at rest may be moved as a whole.

    Args:
        positions: of the agents at rest, who all hear each other, `(n, dim)`.
        time_step: h, s, > 0.
        delay: steps, >= 0.
        interaction: g, with one value of each parameter for all agents; None takes
            `BoundedRepulsion()`.

    Raises:
        ValueError: an argument is out of range.
    """
    x = checked_positions(positions)
    h = validation.number("time_step", time_step, above=0)
    delay = validation.integer("delay", delay, at_least=0)
    slopes = _slopes(x, BoundedRepulsion() if interaction is None else interaction)
    n, dim = x.shape
    size = n * dim
    own = np.zeros((n, n, dim, dim))
    own[np.arange(n), np.arange(n)] = slopes.sum(axis=1)
    # The state holds the disturbances of this step and of the `delay` steps before it.
    step = np.eye((delay + 1) * size, k=-size)
    step[:size, :size] += np.eye(size) + h * _as_matrix(own)
    step[:size, delay * size :] -= h * _as_matrix(slopes)
    return float(np.abs(np.linalg.eigvals(step)).max())


def _slopes(x: FloatArray, interaction: BoundedRepulsion) -> FloatArray:
    """Dg at x_i - x_j, `(n, n, dim, dim)`; 0 where i = j, since agents ignore themselves."""
    n, dim = x.shape
    y = x[:, None] - x[None]
    square = np.square(y).sum(axis=-1)[..., None, None]
    repulsion = interaction.repulsion * np.exp(-square / interaction.spread)
    outer = y[..., :, None] * y[..., None, :]
    slopes = (repulsion - interaction.attraction) * np.eye(dim)
    slopes = slopes - 2.0 / interaction.spread * repulsion * outer
    slopes[np.arange(n), np.arange(n)] = 0.0
    return np.asarray(slopes)


def _as_matrix(blocks: FloatArray) -> FloatArray:
    """A matrix of blocks, `(n, n, dim, dim)`, as one of `(n dim, n dim)`."""
    n, _, dim, _ = blocks.shape
    return np.asarray(blocks.transpose(0, 2, 1, 3).reshape(n * dim, n * dim))
