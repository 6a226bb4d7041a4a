"""The kernels of particle swarms: memory, attraction, and the motion (6.1)-(6.2).

A particle is a row. Its state x = [theta, nu] has 2 d columns, first the position and
then the velocity. No kernel draws random numbers.
"""

from __future__ import annotations

import math
import sys

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

NONE, CLIP, ABSORB, REFLECT = range(4)
"""What happens at the bounds, see `acl_gym.swarm.pso.bounds.BOUNDARIES`."""

LARGEST = sys.float_info.max
"""The largest float: what is larger is infinite."""


@njit(error_model="numpy")
def remember_best(
    values: FloatArray,
    positions: FloatArray,
    best_values: FloatArray,
    best_positions: FloatArray,
) -> None:
    """Replace personal bests by positions that are better, in place.

    Args:
        values: F(theta), `(n,)`.
        positions: theta, `(n, d)`.
        best_values: the least value that each particle has found, `(n,)`.
        best_positions: theta_pbest, where it was found, `(n, d)`.
    """
    for i in range(values.size):
        if values[i] < best_values[i]:
            best_values[i] = values[i]
            for k in range(positions.shape[1]):
                best_positions[i, k] = positions[i, k]


@njit(error_model="numpy")
def choose_local_best(
    sender: IntArray, heard_values: FloatArray, chosen: IntArray
) -> None:
    """Say whose personal best is the local best of each particle.

    Args:
        sender: who sent the best message, -1 where nothing was heard, `(n,)`.
        heard_values: of the personal bests in the messages, `(m,)`.
        chosen: `(n,)`, receives the sender, and -1, the particle's own personal best,
            where nothing was heard or only of bests that are worth nothing.
    """
    for i in range(sender.size):
        j = sender[i]
        chosen[i] = j if j >= 0 and heard_values[j] < math.inf else -1


@njit(error_model="numpy")
def attract(
    positions: FloatArray,
    personal: FloatArray,
    chosen: IntArray,
    heard: FloatArray,
    cognitive: FloatArray,
    social: FloatArray,
    uniforms: FloatArray,
    u: FloatArray,
) -> None:
    """What the bests add to the velocity, eq. (6.3).

    u = c1 r1 (theta_pbest - theta) + c2 r2 (theta_lbest - theta)

    Args:
        positions: theta, `(n, d)`.
        personal: theta_pbest, `(n, d)`.
        chosen: row of `heard` that is the particle's local best, -1 where that is its
            personal best, `(n,)`.
        heard: positions in the messages, `(m, d)`.
        cognitive: c1, `(n,)`.
        social: c2, `(n,)`.
        uniforms: r1 and r2 of each particle, from [0, 1), `(n, 2, d)`.
        u: `(n, d)`, receives the input.
    """
    for i in range(positions.shape[0]):
        j = chosen[i]
        # Rows, because compilers make vector instructions of loops over them.
        theta, best, out = positions[i], personal[i], u[i]
        local = best if j < 0 else heard[j]
        r1, r2 = uniforms[i, 0], uniforms[i, 1]
        c1, c2 = cognitive[i], social[i]
        for k in range(theta.size):
            own = c1 * r1[k] * (best[k] - theta[k])
            out[k] = own + c2 * r2[k] * (local[k] - theta[k])


@njit(error_model="numpy")
def mirror(
    position: float, velocity: float, lower: float, upper: float
) -> tuple[float, float]:
    """Position and velocity of a motion that is reflected at bounds, however often."""
    width = upper - lower
    if width == 0.0:
        return lower, 0.0
    if math.isinf(width):  # there is one wall
        wall = lower if position < lower else upper
        return wall - (position - wall), -velocity
    # After two reflections everything repeats.
    rest = (position - lower) % (2.0 * width)
    if rest <= width:
        return min(lower + rest, upper), velocity
    return max(upper - (rest - width), lower), -velocity


@njit(error_model="numpy")
def move(
    x: FloatArray,
    u: FloatArray,
    inertia: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    boundary: int,
    limit: FloatArray,
    literal: bool,
    farthest: float = math.inf,
) -> bool:
    """Move every particle by (6.1) and (6.2), in place.

    nu <- w nu + u, limited; theta <- theta + nu, with the new nu, or with the old one as
    (6.1) is printed; then the bounds.

    Args:
        x: [theta, nu], `(n, 2 d)`.
        u: what the bests add to the velocity, `(n, d)`.
        inertia: w, `(n,)`.
        lower: least position, may be -inf, `(d,)`.
        upper: largest position, may be inf, `(d,)`.
        boundary: `NONE`, `CLIP`, `ABSORB` or `REFLECT`.
        limit: largest absolute velocity, may be inf, `(d,)`.
        literal: move with the old velocity.
        farthest: how far from 0 a position may be, after the bounds.

    Returns:
        Whether all states are finite, and no position is farther away. Where they are
        not, no particle is to be used any more.
    """
    n, d = u.shape
    finite = True
    for i in range(n):
        w, theta, nu, added = inertia[i], x[i, :d], x[i, d:], u[i]
        inside = near = True
        # Without a branch, so that compilers make vector instructions of it.
        for k in range(d):
            old = nu[k]
            new = w * old + added[k]
            # Not min and max, which may make a number of NaN.
            new = limit[k] if new > limit[k] else new
            new = -limit[k] if new < -limit[k] else new
            place = theta[k] + (old if literal else new)
            nu[k], theta[k] = new, place
            finite &= (abs(place) <= LARGEST) & (abs(new) <= LARGEST)
            near &= abs(place) <= farthest
            inside &= (lower[k] <= place) & (place <= upper[k])
        if inside or boundary == NONE or not finite:
            finite &= near
            continue
        for k in range(d):
            if lower[k] <= theta[k] <= upper[k]:
                finite &= abs(theta[k]) <= farthest  # a bound may be infinite
                continue
            if boundary == REFLECT:
                theta[k], nu[k] = mirror(theta[k], nu[k], lower[k], upper[k])
                finite &= abs(theta[k]) <= farthest
            else:
                theta[k] = min(max(theta[k], lower[k]), upper[k])
                if boundary == ABSORB:
                    nu[k] = 0.0
    return finite


@njit(error_model="numpy")
def replace_nan(values: FloatArray) -> int:
    """Replace NaN by infinity, in place; the first index of one, or -1."""
    first = -1
    for i in range(values.size):
        if math.isnan(values[i]):
            values[i] = math.inf
            if first < 0:
                first = i
    return first
