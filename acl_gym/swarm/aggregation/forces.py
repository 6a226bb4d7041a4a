"""What all agents that an agent hears do to it: the sum of the interactions (6.5)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.aggregation import kernels
from acl_gym.swarm.aggregation.interaction import Interaction, coefficients_of
from acl_gym.swarm.cells import MOST_AXES, sort_into_cells, squared_reaches
from acl_gym.swarm.links import Links
from acl_gym.swarm.rows import all_finite, checked_positions, checked_rows, per_agent
from acl_gym.swarm.topologies import Radius
from acl_gym.utils import threads, validation
from acl_gym.utils.typing import FloatArray


def forces_over_links(
    own: FloatArray, heard: FloatArray, links: Links, interaction: Interaction
) -> FloatArray:
    """The sum over j in N_i of g(x_i - x_j), (6.5), for each agent i.

    Where everyone hears everyone, no links are written out: the sum takes O(n^2) time
    and O(n) memory.

    Args:
        own: x_i of each agent as it observes it, `(n, dim)`.
        heard: x_j as agent j has sent it, `(n, dim)`.
        links: who hears whom; links from an agent to itself do not count.
        interaction: g.

    Returns:
        `(n, dim)`; 0 for agents that hear nobody.

    Raises:
        TypeError: `links` or `interaction` is of the wrong kind.
        ValueError: there is not one position for each agent of `links`, one is not a
            finite number, own positions and heard ones have different numbers of axes,
            `interaction` is for another number of agents, or a sum is not finite.
    """
    if not isinstance(links, Links):
        raise TypeError(
            "links must be Links, such as Links.everyone(n), got "
            f"{validation.shown(links)}."
        )
    law = coefficients_of(interaction, links.n)
    own = checked_positions(own, links.n)
    heard = checked_positions(heard, links.n)
    if own.shape != heard.shape:
        raise ValueError(
            f"heard must have {own.shape[1]} coordinates for each agent, as own has, "
            f"got {heard.shape[1]}; let all agents send positions in one space."
        )
    if law is None:
        return _checked(_summed_by_numpy(own, heard, links, interaction))
    force = np.empty_like(own)
    shared = threads.worth_it(links.n)
    if links.is_implicit:
        turned = np.ascontiguousarray(own.T), np.ascontiguousarray(heard.T)
        add = kernels.sum_everyone_in_parallel if shared else kernels.sum_everyone
        add(*turned, tuple(law), force)
    else:
        over = kernels.sum_links_in_parallel if shared else kernels.sum_links
        over(own, heard, *links.csr(), tuple(law), force)
    return _checked(force)


def forces_within(
    positions: ArrayLike, interaction: Interaction, radius: ArrayLike = math.inf
) -> FloatArray:
    """The sum over j with |x_i - x_j| < sigma_i of g(x_i - x_j), for each agent i.

    The same as `forces_over_links` with the links of a `Radius` channel, but faster: a
    grid of cells finds the neighbours, and no links are made. The time grows linearly
    with the number of agents at a constant density.

    Args:
        positions: x_i, `(n, dim)`.
        interaction: g.
        radius: sigma, the sensing radius, > 0, a number or one for each agent; infinity
            lets everyone hear everyone.

    Returns:
        `(n, dim)`.

    Raises:
        TypeError: `interaction` is of the wrong kind.
        ValueError: a position is not a finite number, the radius is out of range,
            parameters are for another number of agents, or a sum is not finite.
    """
    x = checked_positions(positions)
    n, dim = x.shape
    law = coefficients_of(interaction, n)
    sigma = per_agent("radius", radius, n, infinite=True, above=0)
    largest = float(sigma.max())
    if largest == math.inf and sigma.min() == math.inf:
        return forces_over_links(x, x, Links.everyone(n), interaction)
    if dim > MOST_AXES:
        raise ValueError(
            f"positions must have 1 to {MOST_AXES} coordinates where there is a radius, "
            f"got {dim}; use forces_over_links with the links of a channel."
        )
    if law is None:
        return forces_over_links(
            x, x, Radius(sigma, include_self=False).links(x), interaction
        )
    reaches = squared_reaches(np.array(np.broadcast_to(sigma, n)))
    force = np.empty_like(x)
    cells = sort_into_cells(x, largest)
    shared = threads.worth_it(n)
    add = kernels.sum_radius_in_parallel if shared else kernels.sum_radius
    add(cells, reaches, tuple(law), force)
    return _checked(force)


def _summed_by_numpy(
    own: FloatArray, heard: FloatArray, links: Links, interaction: Interaction
) -> FloatArray:
    """What `forces_over_links` returns, for an interaction that no kernel sums.

    g is called once for the first sender of all receivers, once for the second, and so
    on, so that it always has a row for each agent, as parameters that are arrays need,
    and that the sum is in the order of the senders' numbers. The time is O(n) for each
    link of the agent that hears most.
    """
    n, force = links.n, np.zeros_like(own)
    name = f"what {type(interaction).__name__} returns"
    if links.is_implicit:
        for j in range(n):
            y = own - heard[j]
            y[j] = 0.0  # g(0) = 0: nobody acts on itself
            force += _row_by_row(name, interaction(y), y)
        return force
    sender, offsets = links.csr()
    degrees = np.diff(offsets)
    for k in range(int(degrees.max())):
        hearing = np.flatnonzero(degrees > k)
        by = sender[offsets[hearing] + k]
        y = np.zeros_like(own)
        y[hearing] = own[hearing] - heard[by]
        y[hearing[by == hearing]] = 0.0
        force += _row_by_row(name, interaction(y), y)
    return force


def _row_by_row(name: str, values: Any, y: FloatArray) -> FloatArray:
    """Values of g, which are 0 where y is 0, also if a subclass calls that otherwise."""
    rows = checked_rows(name, values, y.shape)
    return np.where(np.any(y, axis=1, keepdims=True), rows, 0.0)


def _checked(force: FloatArray) -> FloatArray:
    """Check that sums are finite."""
    if not all_finite(force):
        agent = int(np.flatnonzero(~np.isfinite(force).all(axis=1))[0])
        raise ValueError(
            f"the sum of interactions must be finite, got {force[agent]} for agent "
            f"{agent}: agents may have come too close for b / r^2; move them apart, take "
            "a smaller time_step, or the bounded repulsion."
        )
    return force
