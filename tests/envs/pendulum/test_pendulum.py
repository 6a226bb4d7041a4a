"""The pendulum's kernels against plain NumPy and SciPy, and what bounds them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.stats import chisquare

from acl_gym.envs.pendulum import Pendulum, kernels
from acl_gym.envs.pendulum.kernels import TWO_PI
from acl_gym.utils.fast_math import sine
from tests.envs.pendulum import reference_pendulum as reference

Move = tuple[Pendulum, reference.FloatArray, np.ndarray]

# Without gravity, damping and torque omega is constant and theta moves by T_s omega.
DRIFTING = {"gravity": 0.0, "damping": 0.0, "torques": (0.0,), "sampling_time": 0.125}


@given(reference.moves())
def test_a_step_is_that_of_the_equations(move: Move) -> None:
    system, states, actions = move
    after, rewards, reached = reference.advance(system, states, actions)
    expected = reference.clipped(system, reference.integrated(system, states, actions))
    assert np.all((after[:, 0] >= 0.0) & (after[:, 0] < TWO_PI))
    assert reference.angle_between(after[:, 0], expected[:, 0]).max() < 1e-10
    np.testing.assert_allclose(after[:, 1], expected[:, 1], rtol=1e-10, atol=1e-10)
    # The cost and the goal are those of the state that was reached, to the last bit
    # where a bound is concerned.
    cost = reference.stage_cost(system, after, actions)
    np.testing.assert_allclose(rewards, -cost, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(reached, reference.is_goal(system, after))


@given(reference.moves())
def test_slots_do_not_mix(move: Move) -> None:
    system, states, actions = move
    together = reference.advance(system, states, actions)
    for slot in range(actions.size):
        one = slice(slot, slot + 1)
        alone = reference.advance(system, states[one], actions[one])
        for whole, part in zip(together, alone, strict=True):
            np.testing.assert_array_equal(whole[one], part)


@pytest.mark.parametrize(
    ("substeps", "theta_tolerance", "omega_tolerance"),
    [(1, 5e-4, 6e-3), (2, 3e-5, 4e-4), (4, 2e-6, 2e-5)],
)
def test_integration_agrees_with_scipy(
    substeps: int, theta_tolerance: float, omega_tolerance: float
) -> None:
    system = Pendulum(substeps=substeps, omega_max=1e3)
    grid = reference.state_grid(60, 61, 9.0)
    states = np.tile(grid, (3, 1))
    actions = np.repeat([0, 1, 2], len(grid))
    torque = np.array(system.torques)[actions]

    def rate(_: float, x: reference.FloatArray) -> reference.FloatArray:
        return reference.derivative(system, x.reshape(2, -1), torque).ravel()

    solution = solve_ivp(
        rate,
        (0.0, system.sampling_time),
        states.T.ravel(),
        method="DOP853",
        rtol=1e-10,
        atol=1e-10,
    )
    theta, omega = solution.y[:, -1].reshape(2, -1)
    after, _, _ = reference.advance(system, states, actions)
    assert reference.angle_between(after[:, 0], theta).max() < theta_tolerance
    assert np.abs(after[:, 1] - omega).max() < omega_tolerance


def test_kernels_run_the_same_without_the_compiler() -> None:
    system = Pendulum(substeps=2, state_weight=((1.0, 0.2), (0.2, 0.1)))
    rng = np.random.default_rng(1)
    compiled = [system.sample_states(rng, 40).copy()]
    plain = [compiled[0].copy()]
    actions = rng.integers(0, 3, 40)
    drive = (system._dynamics[0], 19.62, 2.0, 0.05, 2)
    price = (9.0, 1.0, 0.2, 0.1, system._goal_and_cost[4], 0.5, 2.0)
    for states, integrate, settle in (
        (compiled, kernels.integrate, kernels.settle),
        (plain, kernels.integrate.py_func, kernels.settle.py_func),
    ):
        rewards, reached = np.empty(40), np.empty(40, dtype=np.bool_)
        integrate(*states[0], actions, *drive)
        settle(*states[0], actions, *price, rewards, reached)
        states += [rewards, reached]
    assert compiled[2].any()
    assert not compiled[2].all()
    for ours, theirs in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-14, atol=1e-14)


def test_sine_is_that_of_numpy() -> None:
    x = np.random.default_rng(2).uniform(-100.0, 100.0, 50_000)
    x[:400] = np.pi / 4 * np.arange(-200, 200) / 2
    x = x[np.abs(x) < 100.0]
    ours = np.array([sine(value) for value in x])
    assert np.abs(ours - np.sin(x)).max() < 1e-15
    plain = np.array([sine.py_func(value) for value in x[:1000]])
    assert np.abs(plain - np.sin(x[:1000])).max() < 1e-15


@pytest.mark.parametrize(
    ("theta", "omega", "expected"),
    [
        (1.0, 0.0, 1.0),
        (0.0, -1e-19, 0.0),  # a tiny negative angle rounds up to 2 pi
        (0.0, -1e-300, 0.0),
        (0.0, -0.0, 0.0),
        (0.25, -4.0, TWO_PI - 0.25),
        (6.0, 8.0, 7.0 - TWO_PI),
        (TWO_PI, 0.0, 0.0),
        (np.nextafter(TWO_PI, 0.0), 0.0, np.nextafter(TWO_PI, 0.0)),
        (1.0, 8.0 * 3 * TWO_PI, 1.0),  # three turns in one step
        (1.0, -8.0 * 3 * TWO_PI, 1.0),
    ],
)
def test_theta_is_brought_into_one_turn(
    theta: float, omega: float, expected: float
) -> None:
    system = Pendulum(omega_max=1e4, **DRIFTING)
    after, _, _ = reference.advance(system, [[theta, omega]], [0])
    assert 0.0 <= after[0, 0] < TWO_PI
    assert reference.angle_between(after[0, 0], np.float64(expected)) < 1e-13
    assert (after[0, 0] == 0.0) == (expected == 0.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_omega_is_clipped(sign: float) -> None:
    system = Pendulum(torques=(50.0 * sign,))
    after, rewards, _ = reference.advance(system, [[1.0, 8.5 * sign]], [0])
    assert after[0, 1] == 9.0 * sign
    # The cost is that of the clipped speed.
    cost = reference.stage_cost(system, after, [0])
    np.testing.assert_allclose(rewards, -cost, rtol=1e-14)


def test_the_error_is_taken_after_the_step() -> None:
    system = Pendulum(**{**DRIFTING, "torques": (2.0,), "motor_gain": 1e-12})
    _, rewards, _ = reference.advance(system, [[np.pi - 0.5, 4.0]], [0])
    # theta moves on to the goal's angle: what is left is 0.1 * 4^2 + 0.05 * 2^2.
    assert rewards[0] == pytest.approx(-1.8, abs=1e-9)


@pytest.mark.parametrize(
    ("theta", "omega", "inside"),
    [
        (np.pi, 0.0, True),
        (np.pi + 0.125, 0.0, True),
        (np.pi - 0.125, 0.0, True),
        (np.nextafter(np.pi + 0.125, 4.0), 0.0, False),
        (np.nextafter(np.pi - 0.125, 3.0), 0.0, False),
        (np.pi, 0.25, True),
        (np.pi, -0.25, True),
        (np.pi, np.nextafter(0.25, 1.0), False),
        (np.pi, -np.nextafter(0.25, 1.0), False),
        (0.0, 0.0, False),
    ],
)
def test_the_goal_includes_its_edges(theta: float, omega: float, inside: bool) -> None:
    # Binary fractions make the edges exact; in so short a time nothing moves.
    system = Pendulum(goal_bounds=(0.125, 0.25), **{**DRIFTING, "sampling_time": 1e-30})
    after, _, reached = reference.advance(system, [[theta, omega]], [0])
    assert after.tolist() == [[theta, omega]]
    assert bool(reached[0]) is inside


@given(reference.moves())
def test_no_reward_exceeds_the_bounds(move: Move) -> None:
    system, states, actions = move
    _, rewards, _ = reference.advance(system, states, actions)
    assert rewards.max() <= 0.0
    assert -rewards.min() <= system.max_stage_cost * (1.0 + 1e-12)


@given(reference.systems())
def test_the_largest_stage_cost_is_attained(system: Pendulum) -> None:
    dearest = int(np.argmax(np.abs(system.torques)))
    corners = np.array([[0.0, -system.omega_max], [0.0, system.omega_max]])
    cost = reference.stage_cost(system, corners, [dearest, dearest])
    assert cost.max() == pytest.approx(system.max_stage_cost, rel=1e-12)


def test_evaluation_states_are_those_decided() -> None:
    states = Pendulum().evaluation_states()
    expected = [
        (2 * np.pi * i / 10 + 0.01, -9.0 + 2 * 9.0 * j / 9)
        for i in range(10)
        for j in range(10)
    ]
    assert states.shape == (100, 2)
    np.testing.assert_allclose(states, expected, rtol=1e-15, atol=1e-15)
    assert Pendulum.evaluation_steps == 300
    wide = Pendulum(omega_max=20.0).evaluation_states()
    np.testing.assert_array_equal(wide[[0, 99], 1], [-20.0, 20.0])


def overlap(low: float, high: float, centre: float, half_width: float) -> float:
    return max(0.0, min(high, centre + half_width) - max(low, centre - half_width))


@pytest.mark.parametrize("goal_bounds", [(0.1, 0.1), (1.2, 3.0), (3.0, 8.9)])
def test_samples_are_uniform_outside_the_goal(
    goal_bounds: tuple[float, float],
) -> None:
    system = Pendulum(goal_bounds=goal_bounds)
    n = 20_000
    theta, omega = system.sample_states(np.random.default_rng(3), n)
    assert np.all((theta >= 0.0) & (theta < TWO_PI) & (np.abs(omega) <= 9.0))
    assert not reference.is_goal(system, np.stack([theta, omega], axis=1)).any()

    edges = np.linspace(0.0, TWO_PI, 8), np.linspace(-9.0, 9.0, 10)
    counts, *_ = np.histogram2d(theta, omega, edges)
    (wide_theta, wide_omega), area = goal_bounds, np.empty((7, 9))
    for i, left in enumerate(edges[0][:-1]):
        for j, low in enumerate(edges[1][:-1]):
            right, high = edges[0][i + 1], edges[1][j + 1]
            goal = overlap(left, right, np.pi, wide_theta)
            goal *= overlap(low, high, 0.0, wide_omega)
            area[i, j] = (right - left) * (high - low) - goal
    expected = n * area / area.sum()
    assert counts[expected < 1e-6].sum() == 0
    large = expected > 5.0
    test = chisquare(
        counts[large], expected[large] * counts[large].sum() / expected[large].sum()
    )
    assert test.pvalue > 1e-3


@given(st.floats(-1e6, 1e6), st.floats(-9.0, 9.0))
def test_given_states_become_canonical(theta: float, omega: float) -> None:
    given_states = np.array([[theta, omega]])
    kept = given_states.copy()
    states = Pendulum().checked_states(given_states)
    assert 0.0 <= states[0, 0] < TWO_PI
    assert reference.angle_between(states[0, 0], np.float64(theta)) < 1e-9
    assert states[0, 1] == omega
    np.testing.assert_array_equal(given_states, kept)
    assert not np.shares_memory(states, given_states)
