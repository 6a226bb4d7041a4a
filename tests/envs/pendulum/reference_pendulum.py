"""The pendulum of §5.2 in plain NumPy, written from (5.1) and (5.4)."""

from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.pendulum import Pendulum

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def derivative(system: Pendulum, x: FloatArray, torque: FloatArray) -> FloatArray:
    """The right-hand side of (5.1) for x = [theta omega], shape (2, n)."""
    theta, omega = x
    weight = system.mass * system.gravity * system.length
    moment = (
        system.motor_gain * torque - weight * np.sin(theta) - system.damping * omega
    )
    return np.stack([omega, moment / system.inertia])


def integrated(system: Pendulum, states: FloatArray, actions: ArrayLike) -> FloatArray:
    """One sampling time by the classical Runge-Kutta method; states (n, 2)."""
    torque = np.array(system.torques)[np.asarray(actions)]
    h = system.sampling_time / system.substeps
    x = states.T
    for _ in range(system.substeps):
        k1 = derivative(system, x, torque)
        k2 = derivative(system, x + h / 2 * k1, torque)
        k3 = derivative(system, x + h / 2 * k2, torque)
        k4 = derivative(system, x + h * k3, torque)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x.T


def clipped(system: Pendulum, states: FloatArray) -> FloatArray:
    """Bring integrated states (n, 2) back into X."""
    theta, omega = states.T
    speed = np.clip(omega, -system.omega_max, system.omega_max)
    return np.stack([np.mod(theta, 2 * np.pi), speed], axis=1)


def stage_cost(system: Pendulum, states: FloatArray, actions: ArrayLike) -> FloatArray:
    """(5.4) for the states (n, 2) reached at t + 1 by the actions taken at t."""
    error = states - np.array([np.pi, 0.0])
    torque = np.array(system.torques)[np.asarray(actions)]
    quadratic = np.einsum("ni,ij,nj->n", error, np.array(system.state_weight), error)
    return quadratic + system.torque_weight * torque**2


def is_goal(system: Pendulum, states: FloatArray) -> BoolArray:
    """|pi - theta| and |omega| within the goal's half-widths; states (n, 2)."""
    distance = np.abs(states - np.array([np.pi, 0.0]))
    return np.all(distance <= np.array(system.goal_bounds), axis=1)


def advance(
    system: Pendulum, states: ArrayLike, actions: ArrayLike
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The compiled kernels: next states (n, 2), rewards and whether at the goal."""
    columns = np.array(states, dtype=np.float64).T.copy()
    chosen = np.array(actions, dtype=np.int64)
    rewards = np.full(chosen.size, np.nan)
    reached = np.zeros(chosen.size, dtype=np.bool_)
    system.advance(columns, chosen, None, rewards, reached)
    return columns.T.copy(), rewards, reached


def angle_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """The distance of two angles along the circle."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def state_grid(n_theta: int, n_omega: int, omega_max: float) -> FloatArray:
    """States spread evenly over X, shape (n_theta * n_omega, 2)."""
    theta = np.linspace(0, 2 * np.pi, n_theta, endpoint=False)
    omega = np.linspace(-omega_max, omega_max, n_omega)
    return np.stack(np.meshgrid(theta, omega), axis=-1).reshape(-1, 2)


@st.composite
def weights(draw: st.DrawFn) -> tuple[tuple[float, float], tuple[float, float]]:
    """Positive definite matrices, with cross terms."""
    a, b, c = (draw(st.floats(-2, 2)) for _ in range(3))
    return ((a * a + 0.01, a * b), (a * b, b * b + c * c + 0.01))


def systems() -> st.SearchStrategy[Pendulum]:
    """Pendulums with any parameters for which rounding errors stay small."""
    return st.builds(
        _stable,
        inertia=st.floats(0.003, 0.02),
        motor_gain=st.floats(0.01, 0.3),
        damping=st.floats(0, 0.02),
        mass=st.floats(0.02, 0.2),
        length=st.floats(0.02, 0.2),
        gravity=st.floats(0, 20),
        torques=st.lists(st.floats(-2, 2), min_size=1, max_size=5).map(tuple),
        sampling_time=st.floats(0.01, 0.2),
        substeps=st.integers(1, 5),
        omega_max=st.floats(0.5, 20),
        goal_bounds=st.tuples(st.floats(0.01, 2), st.floats(0.01, 0.4)),
        state_weight=weights(),
        torque_weight=st.floats(0, 1),
    )


def _stable(**parameters: Any) -> Pendulum:
    """A pendulum for which Runge-Kutta does not diverge: shorter steps if need be."""
    stiffness = parameters["mass"] * parameters["gravity"] * parameters["length"]
    friction = parameters["damping"] / parameters["inertia"]
    fastest = max(np.sqrt(stiffness / parameters["inertia"]), friction)
    longest = 2.4 * parameters["substeps"] / max(fastest, 1e-9)
    parameters["sampling_time"] = min(parameters["sampling_time"], longest)
    return Pendulum(**parameters)


@st.composite
def moves(draw: st.DrawFn) -> tuple[Pendulum, FloatArray, NDArray[np.int64]]:
    """A system, some of its states (n, 2) and an action for each."""
    system = draw(systems())
    n = draw(st.integers(1, 6))
    theta = st.floats(0, 2 * np.pi, exclude_max=True)
    omega = st.floats(-system.omega_max, system.omega_max)
    states = [(draw(theta), draw(omega)) for _ in range(n)]
    action = st.integers(0, len(system.torques) - 1)
    return system, np.array(states), np.array([draw(action) for _ in range(n)])
