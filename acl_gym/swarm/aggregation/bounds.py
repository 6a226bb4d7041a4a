"""What is known exactly of aggregating swarms in which everyone hears everyone.

After Gazi and Passino, "Stability analysis of swarms" (2003) and "A class of attractions
and repulsions for stable swarm aggregations" (2004). At an equilibrium of the bounded
repulsion, (6.5) summed over all agents gives a M (x_i - centre) = b sum_j y exp(-r^2 / c),
and r exp(-r^2 / c) <= sqrt(c / 2) e^(-1/2), r^2 exp(-r^2 / c) <= c / e. With the unbounded
repulsion the sum of squares obeys a linear differential equation, at all times.

Common arguments, numbers or arrays that broadcast:
    n_agents: M, >= 1.
    attraction: a, > 0.
    repulsion: b, >= 0.
    spread: c, > 0.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


@np.errstate(over="ignore")
def size_bound(
    n_agents: ArrayLike, attraction: ArrayLike, repulsion: ArrayLike, spread: ArrayLike
) -> FloatArray:
    """No agent rests farther from the centre: (b / a) sqrt(c / 2) e^(-1/2) (M - 1) / M.

    For the bounded repulsion. See `acl_gym.swarm.aggregation.bounds` for the arguments.
    """
    m, a, b = _checked(n_agents, attraction, repulsion)
    c = _positive("spread", spread)
    _same_shape(n_agents=m, attraction=a, repulsion=b, spread=c)
    # In this order 0 is not multiplied by what overflows.
    share = math.sqrt(0.5) * math.exp(-0.5) * ((m - 1.0) / m)
    return np.asarray(share * b / a * np.sqrt(c))


@np.errstate(over="ignore")
def rms_bound(
    n_agents: ArrayLike, attraction: ArrayLike, repulsion: ArrayLike, spread: ArrayLike
) -> FloatArray:
    """No swarm rests at a larger root mean square distance from its centre.

    sqrt((M - 1) b c / (2 a e M)), for the bounded repulsion. See
    `acl_gym.swarm.aggregation.bounds` for the arguments.
    """
    m, a, b = _checked(n_agents, attraction, repulsion)
    c = _positive("spread", spread)
    _same_shape(n_agents=m, attraction=a, repulsion=b, spread=c)
    share = np.sqrt((m - 1.0) / m / (2.0 * math.e))
    return np.asarray(share * np.sqrt(b) * np.sqrt(c) / np.sqrt(a))


@np.errstate(over="ignore")
def resting_sum_of_squares(
    n_agents: ArrayLike, attraction: ArrayLike, repulsion: ArrayLike
) -> FloatArray:
    """S_inf = b (M - 1) / (2 a), which the sum of squares tends to.

    For the unbounded repulsion, and S = sum_i |x_i - centre|^2. See
    `acl_gym.swarm.aggregation.bounds` for the arguments.
    """
    m, a, b = _checked(n_agents, attraction, repulsion)
    return np.asarray(b * (0.5 * (m - 1.0)) / a)


@np.errstate(over="ignore")
def sum_of_squares(
    time: ArrayLike,
    initial: ArrayLike,
    n_agents: ArrayLike,
    attraction: ArrayLike,
    repulsion: ArrayLike,
) -> FloatArray:
    """S(t) = S_inf + (S(0) - S_inf) e^(-2 a M t), for the unbounded repulsion.

    From dS/dt = 2 sum_i (x_i - centre)' u_i, in which each pair of agents contributes
    2 y' g(y) = 2 (b - a r^2), and the r^2 of all pairs add up to M S. It holds for any
    positions, as long as no two agents are in one place.

    Args:
        time: t, s, >= 0.
        initial: S(0), the sum of |x_i - centre|^2, >= 0.
        n_agents: see `acl_gym.swarm.aggregation.bounds`.
        attraction: see there.
        repulsion: see there.
    """
    m, a, _ = _checked(n_agents, attraction, repulsion)
    end = resting_sum_of_squares(n_agents, attraction, repulsion)
    t = _at_least("time", time, 0.0)
    start = _at_least("initial", initial, 0.0)
    _same_shape(time=t, initial=start, n_agents=m, attraction=a)
    _same_shape(time=t, initial=start, repulsion=end)
    return np.asarray(end + (start - end) * np.exp(-2.0 * a * m * t))


def _same_shape(**values: FloatArray) -> None:
    """Check that arguments broadcast.

    Raises:
        ValueError: they do not.
    """
    try:
        np.broadcast_shapes(*(each.shape for each in values.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {each.shape}" for name, each in values.items())
        raise ValueError(
            f"arguments must be numbers or arrays of one shape, got {shapes}."
        ) from None


def _checked(
    n_agents: ArrayLike, attraction: ArrayLike, repulsion: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    m = _at_least("n_agents", n_agents, 1.0)
    a = _positive("attraction", attraction)
    b = _at_least("repulsion", repulsion, 0.0)
    _same_shape(n_agents=m, attraction=a, repulsion=b)
    return m, a, b


def _positive(name: str, values: ArrayLike) -> FloatArray:
    array = validation.real_array(name, values)
    if (array <= 0).any():
        raise ValueError(f"{name} must be > 0, got {array.min():g}.")
    return array


def _at_least(name: str, values: ArrayLike, least: float) -> FloatArray:
    array = validation.real_array(name, values)
    if (array < least).any():
        raise ValueError(f"{name} must be >= {least:g}, got {array.min():g}.")
    return array
