"""The swarm in continuous time, (6.4): what small time steps tend to."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.aggregation.forces import forces_over_links
from acl_gym.swarm.aggregation.interaction import (
    Interaction,
    check_interaction,
    coefficients_of,
)
from acl_gym.swarm.aggregation.kernels import UNBOUNDED
from acl_gym.swarm.aggregation.profiles import Profile, checked_gradient
from acl_gym.swarm.links import Links
from acl_gym.swarm.rows import checked_positions
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


def flow(
    positions: ArrayLike,
    interaction: Interaction,
    times: ArrayLike,
    profile: Profile | None = None,
    *,
    links: Links | None = None,
    tolerance: float = 1e-10,
    most_evaluations: int = 100_000,
) -> FloatArray:
    """Solve dx_i/dt = sum_j g(x_i - x_j) - grad sigma(x_i) of kinematic particles.

    With the explicit Runge-Kutta method of order 8 (DOP853) of SciPy. What is known of
    swarms in theory concerns these solutions; `run` moves agents in finite steps.

    Args:
        positions: at time 0, `(n, dim)`.
        interaction: g.
        times: when to return the positions, s, >= 0, in ascending order; equal ones
            give equal positions.
        profile: sigma; None: there is none.
        links: who hears whom, all the time; None: everyone.
        tolerance: of the solution, relative (1e-13 or more) and absolute, in [1e-15, 1].
        most_evaluations: how often the right-hand side may be computed, >= 1. It takes
            about 11 a M T evaluations to reach the time T, because a swarm at rest is
            stiff.

    Returns:
        The positions at these times, `(len(times), n, dim)`.

    Raises:
        TypeError: an argument is of the wrong kind.
        ValueError: an argument is out of range, or there is no solution, because
            `UnboundedRepulsion` acts between two agents in one place; or none is found,
            because two are too close for it, or it would take more evaluations than
            allowed.
    """
    from scipy.integrate import solve_ivp  # slow to import

    x = checked_positions(positions)
    at = validation.real_array("times", times, ndim=1)
    if at[0] < 0 or (np.diff(at) < 0).any():
        raise ValueError(
            f"times must be >= 0 and in ascending order, got {validation.shown(times)}."
        )
    tolerance = validation.number("tolerance", tolerance, at_least=1e-15, at_most=1)
    most = validation.integer("most_evaluations", most_evaluations, at_least=1)
    everyone = Links.everyone(len(x)) if links is None else links
    check_interaction(interaction)
    if profile is not None and not isinstance(profile, Profile):
        raise TypeError(
            f"profile must be of a subclass of Profile, got {validation.shown(profile)}."
        )
    forces_over_links(x, x, everyone, interaction)  # says so if they do not fit
    _check_apart(x, interaction, everyone)
    calls = 0

    def rate(time: float, flat: FloatArray) -> FloatArray:
        nonlocal calls
        calls += 1
        if calls > most:
            raise ValueError(
                f"times must be reached with {most:,} evaluations, got to {time:g} of "
                f"{at[-1]:g} s; shorten times, raise most_evaluations, or let `run` make "
                "steps."
            )
        here = flat.reshape(x.shape)
        u = forces_over_links(here, here, everyone, interaction)
        if profile is not None:
            u -= checked_gradient(profile, here)
        return u.reshape(-1)

    if at[-1] == 0.0:
        return np.array(np.broadcast_to(x, (at.size, *x.shape)))
    distinct, which = np.unique(at, return_inverse=True)
    solved = solve_ivp(
        rate,
        (0.0, float(at[-1])),
        x.reshape(-1),
        method="DOP853",
        t_eval=distinct,
        rtol=max(tolerance, 1e-13),
        atol=tolerance,
    )
    if not solved.success:
        raise ValueError(
            "positions must have a solution up to the last of the times, got none: "
            f"{solved.message.rstrip('.')}; move agents apart."
        )
    return np.asarray(solved.y.T[which].reshape(at.size, *x.shape))


def _check_apart(x: FloatArray, interaction: Interaction, links: Links) -> None:
    """Check that b / r^2 acts between no two agents in one place.

    Kernels give such a pair no force, because it has no direction to part in. In
    continuous time that would be a solution which any disturbance ends.
    """
    law = coefficients_of(interaction, len(x))
    if law is None or law.kind != UNBOUNDED:
        return
    repelled = law.repulsion > 0.0
    _, place = np.unique(x + 0.0, axis=0, return_inverse=True)  # -0.0 becomes 0.0
    place = place.reshape(-1)
    shared = repelled & (np.bincount(place)[place] > 1)
    if not links.is_implicit:
        to, by = links.receiver, links.sender
        pairs = (to != by) & (place[to] == place[by])
        shared &= np.bincount(to[pairs], minlength=len(x)) > 0
    if shared.any():
        agent = int(np.flatnonzero(shared)[0])
        raise ValueError(
            "positions of agents that UnboundedRepulsion drives apart must differ, got "
            f"another agent at the place of agent {agent}, {x[agent]}; move one of them."
        )
