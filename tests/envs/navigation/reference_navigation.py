"""The navigation of §4.5 in plain NumPy, written from its equations and (3.2)."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.navigation import Navigation

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def damping(system: Navigation, c1: FloatArray, c2: FloatArray) -> FloatArray:
    """b(c1, c2) of §4.5.1."""
    b = system.base_damping * np.ones_like(c1)
    for height, *centre_and_width in system.peaks:
        m1, m2, sigma1, sigma2 = centre_and_width
        b = b + height * np.exp(
            -((c1 - m1) ** 2 / sigma1**2 + (c2 - m2) ** 2 / sigma2**2)
        )
    return b


def derivative(system: Navigation, x: FloatArray, force: FloatArray) -> FloatArray:
    """The right-hand side for x = [c1 v1 c2 v2], shape (4, n), forces (2, n)."""
    c1, v1, c2, v2 = x
    b = damping(system, c1, c2)
    return np.stack(
        [v1, (force[0] - b * v1) / system.mass, v2, (force[1] - b * v2) / system.mass]
    )


def integrated(
    system: Navigation, states: FloatArray, actions: ArrayLike
) -> FloatArray:
    """One sampling time by the classical Runge-Kutta method; states (n, 4)."""
    force = np.array(system.forces)[np.asarray(actions)].T
    h = system.sampling_time / system.substeps
    x = states.T
    for _ in range(system.substeps):
        k1 = derivative(system, x, force)
        k2 = derivative(system, x + h / 2 * k1, force)
        k3 = derivative(system, x + h / 2 * k2, force)
        k4 = derivative(system, x + h * k3, force)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x.T


def limits(system: Navigation) -> FloatArray:
    """The largest value of each variable, shape (4,)."""
    return np.array([system.position_max, system.velocity_max] * 2)


def clipped(system: Navigation, states: FloatArray) -> FloatArray:
    """Bring integrated states (n, 4) back into X."""
    return np.clip(states, -limits(system), limits(system))


def stage_cost(
    system: Navigation, states: FloatArray, actions: ArrayLike
) -> FloatArray:
    """The cost of the states (n, 4) reached at t + 1 by the actions taken at t."""
    if system.cost == "time":
        return np.ones(len(states))
    force = np.array(system.forces)[np.asarray(actions)]
    weight = np.array(system.state_weight)
    quadratic = np.einsum("ni,ij,nj->n", states, weight, states)
    return quadratic + system.force_weight * np.sum(force**2, axis=1)


def goal_degree(system: Navigation, states: FloatArray) -> FloatArray:
    """The membership (4.8) to the goal: a product of triangles; states (n, 4)."""
    spacing = np.array(list(system.goal_spacing) * 2)
    return np.prod(np.clip(1.0 - np.abs(states) / spacing, 0.0, None), axis=1)


def is_goal(system: Navigation, states: FloatArray) -> BoolArray:
    """Whether states (n, 4) count as the goal by the system's rule."""
    if system.goal_rule == "membership":
        return goal_degree(system, states) > 0.5
    bounds = np.array(list(system.goal_bounds) * 2)
    return np.all(np.abs(states) <= bounds, axis=1)


def advance(
    system: Navigation, states: ArrayLike, actions: ArrayLike
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The compiled kernels: next states (n, 4), rewards and whether at the goal."""
    columns = np.array(states, dtype=np.float64).T.copy()
    chosen = np.array(actions, dtype=np.int64)
    rewards = np.full(chosen.size, np.nan)
    reached = np.zeros(chosen.size, dtype=np.bool_)
    system.advance(columns, chosen, None, rewards, reached)
    return columns.T.copy(), rewards, reached


def state_grid(n_position: int, n_velocity: int) -> FloatArray:
    """States spread evenly over the default X, shape (n, 4)."""
    c, v = np.linspace(-5, 5, n_position), np.linspace(-2, 2, n_velocity)
    return np.stack(np.meshgrid(c, v, c, v), axis=-1).reshape(-1, 4)


@st.composite
def weights(draw: st.DrawFn) -> FloatArray:
    """Positive semi-definite matrices A'A, or their diagonals."""
    entries = [draw(st.floats(-1, 1)) for _ in range(16)]
    factor = np.array(entries).reshape(4, 4)
    weight = factor.T @ factor + 0.01 * np.eye(4)
    weight = (weight + weight.T) / 2
    return np.diag(weight).copy() if draw(st.booleans()) else weight


def peaks() -> st.SearchStrategy[tuple[tuple[float, ...], ...]]:
    """None to three regions of damping, in and around X."""
    peak = st.tuples(
        st.floats(0, 10),
        st.floats(-7, 7),
        st.floats(-7, 7),
        st.floats(0.2, 5),
        st.floats(0.2, 5),
    )
    return st.lists(peak, max_size=3).map(tuple)


@st.composite
def systems(draw: st.DrawFn) -> Navigation:
    """Vehicles with any parameters for which rounding errors stay small."""
    pair = st.tuples(st.floats(-2, 2), st.floats(-2, 2))
    parameters = {
        "mass": st.floats(0.5, 4),
        "base_damping": st.floats(0, 2),
        "peaks": peaks(),
        "forces": st.lists(pair, min_size=1, max_size=5),
        "sampling_time": st.floats(0.01, 0.4),
        "substeps": st.integers(1, 5),
        "position_max": st.floats(0.5, 8),
        "velocity_max": st.floats(0.2, 4),
        "cost": st.sampled_from(["quadratic", "time"]),
        "goal_rule": st.sampled_from(["bounds", "membership"]),
        "goal_bounds": st.tuples(st.floats(0.01, 0.45), st.floats(0.01, 0.15)),
        "goal_spacing": st.tuples(st.floats(0.01, 1), st.floats(0.1, 4)),
        "state_weight": weights(),
        "force_weight": st.floats(0, 1),
    }
    chosen = {name: draw(values) for name, values in parameters.items()}
    step = chosen["sampling_time"] / chosen["substeps"]
    highest = chosen["base_damping"] + sum(peak[0] for peak in chosen["peaks"])
    assume(step * highest < 2.4 * chosen["mass"])
    return Navigation(**chosen)


@st.composite
def moves(draw: st.DrawFn) -> tuple[Navigation, FloatArray, NDArray[np.int64]]:
    """A system, some of its states (n, 4), near the goal or not, and actions."""
    system = draw(systems())
    n = draw(st.integers(1, 9))
    share = st.floats(-1, 1) | st.floats(-0.02, 0.02)
    states = np.array([[draw(share) for _ in range(4)] for _ in range(n)])
    action = st.integers(0, len(system.forces) - 1)
    return system, states * limits(system), np.array([draw(action) for _ in range(n)])
