"""What all agents that an agent hears do to it: the sum of the interactions (6.5)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.aggregation import kernels
from acl_gym.swarm.aggregation.interaction import Interaction, check_interaction
from acl_gym.swarm.cells import MOST_AXES, sort_into_cells, squared_reaches
from acl_gym.swarm.links import Links
from acl_gym.swarm.rows import checked_positions, per_agent
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
            or `interaction` is for another number of agents.
    """
    if not isinstance(links, Links):
        raise TypeError(
            "links must be Links, such as Links.everyone(n), got "
            f"{validation.shown(links)}."
        )
    check_interaction(interaction)
    own = checked_positions(own, links.n)
    heard = checked_positions(heard, links.n)
    if own.shape != heard.shape:
        raise ValueError(
            f"heard must have {own.shape[1]} coordinates for each agent, as own has, "
            f"got {heard.shape[1]}; let all agents send positions in one space."
        )
    law = tuple(interaction.coefficients(links.n))
    force = np.empty_like(own)
    shared = threads.worth_it(links.n)
    if links.is_implicit:
        turned = np.ascontiguousarray(own.T), np.ascontiguousarray(heard.T)
        add = kernels.sum_everyone_in_parallel if shared else kernels.sum_everyone
        add(*turned, law, force)
    else:
        over = kernels.sum_links_in_parallel if shared else kernels.sum_links
        over(own, heard, *links.csr(), law, force)
    return force


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
        ValueError: a position is not a finite number, the radius is out of range, or
            parameters are for another number of agents.
    """
    check_interaction(interaction)
    x = checked_positions(positions)
    n, dim = x.shape
    sigma = per_agent("radius", radius, n, infinite=True, above=0)
    largest = float(sigma.max())
    if largest == math.inf and sigma.min() == math.inf:
        return forces_over_links(x, x, Links.everyone(n), interaction)
    if dim > MOST_AXES:
        raise ValueError(
            f"positions must have 1 to {MOST_AXES} coordinates where there is a radius, "
            f"got {dim}; use forces_over_links with the links of a channel."
        )
    law = tuple(interaction.coefficients(n))
    reaches = squared_reaches(np.array(np.broadcast_to(sigma, n)))
    force = np.empty_like(x)
    cells = sort_into_cells(x, largest)
    shared = threads.worth_it(n)
    add = kernels.sum_radius_in_parallel if shared else kernels.sum_radius
    add(cells, reaches, law, force)
    return force
