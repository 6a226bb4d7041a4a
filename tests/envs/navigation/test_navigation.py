"""The navigation's kernels against plain NumPy and SciPy, and what bounds them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.stats import chisquare, qmc

from acl_gym import Fuzzy
from acl_gym.envs.navigation import Navigation, kernels
from tests.envs.navigation import reference_navigation as reference

Move = tuple[Navigation, reference.FloatArray, np.ndarray]

# Nothing slows the vehicle: it moves by T_s v and its velocity stays.
DRIFTING = {
    "base_damping": 0.0,
    "peaks": (),
    "forces": ((0.0, 0.0),),
    "sampling_time": 0.125,
}
# In so short a time nothing moves.
STILL = {**DRIFTING, "sampling_time": 1e-30}


@given(reference.moves())
def test_a_step_is_that_of_the_equations(move: Move) -> None:
    system, states, actions = move
    after, rewards, reached = reference.advance(system, states, actions)
    expected = reference.clipped(system, reference.integrated(system, states, actions))
    np.testing.assert_allclose(after, expected, rtol=1e-11, atol=1e-11)
    assert np.all(np.abs(after) <= reference.limits(system))
    # The cost and the goal are those of the state that was reached, to the last bit
    # where a bound is concerned.
    cost = reference.stage_cost(system, after, actions)
    np.testing.assert_allclose(rewards, -cost, rtol=1e-12, atol=1e-12)
    at_goal = reference.is_goal(system, after)
    if system.goal_rule == "membership":
        clear = np.abs(reference.goal_degree(system, after) - 0.5) > 1e-12
        reached, at_goal = reached[clear], at_goal[clear]
    np.testing.assert_array_equal(reached, at_goal)


@given(reference.moves())
def test_slots_do_not_mix(move: Move) -> None:
    # Whether a slot is in the vectorised part of the loop must not matter either.
    system, states, actions = move
    together = reference.advance(system, states, actions)
    for slot in range(actions.size):
        one = slice(slot, slot + 1)
        alone = reference.advance(system, states[one], actions[one])
        for whole, part in zip(together, alone, strict=True):
            np.testing.assert_array_equal(whole[one], part)


@pytest.mark.parametrize(
    ("substeps", "position_tolerance", "velocity_tolerance"),
    [(1, 3e-2, 2e-1), (2, 8e-4, 6e-3), (4, 4e-5, 3e-4)],
)
def test_integration_agrees_with_scipy(
    substeps: int, position_tolerance: float, velocity_tolerance: float
) -> None:
    system = Navigation(substeps=substeps, position_max=1e3, velocity_max=1e3)
    grid = reference.state_grid(21, 3)
    states = np.tile(grid, (3, 1))
    actions = np.repeat([0, 4, 7], len(grid))
    force = np.array(system.forces)[actions].T

    def rate(_: float, x: reference.FloatArray) -> reference.FloatArray:
        return reference.derivative(system, x.reshape(4, -1), force).ravel()

    solution = solve_ivp(
        rate,
        (0.0, system.sampling_time),
        states.T.ravel(),
        method="DOP853",
        rtol=1e-9,
        atol=1e-9,
    )
    after, _, _ = reference.advance(system, states, actions)
    error = np.abs(after.T - solution.y[:, -1].reshape(4, -1)).max(axis=1)
    assert error[[0, 2]].max() < position_tolerance
    assert error[[1, 3]].max() < velocity_tolerance
    # The documented error is about the real one, not a generous bound.
    assert error[[1, 3]].max() > 0.5 * velocity_tolerance


def test_kernels_run_the_same_without_the_compiler() -> None:
    system = Navigation(substeps=2, goal_rule="membership", goal_spacing=(8.0, 9.0))
    rng = np.random.default_rng(1)
    compiled = [rng.uniform(-1.0, 1.0, (4, 40)) * [[5.0], [2.0], [5.0], [2.0]]]
    plain = [compiled[0].copy()]
    actions = rng.integers(0, 9, 40)
    drive = (system._acceleration, 0.5, system._kernel_peaks, 0.1, 2)
    weight = tuple(np.ravel(system.state_weight))
    price = (5.0, 2.0, weight, np.arange(9.0), True, 8.0, 9.0)
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
    one = kernels.damping_at.py_func(1.0, -2.0, 0.5, system._kernel_peaks)
    assert one == pytest.approx(float(system.damping(1.0, -2.0)), rel=1e-14)


@given(reference.systems(), st.floats(-9, 9), st.floats(-9, 9))
def test_damping_is_that_of_the_equation(
    system: Navigation, c1: float, c2: float
) -> None:
    row, column = np.array([c1, 0.5, -1.0]), np.array([[c2], [1.0]])
    expected = reference.damping(system, *np.broadcast_arrays(row, column))
    ours = system.damping(row, column)
    assert ours.shape == (2, 3)
    np.testing.assert_allclose(ours, expected, rtol=1e-13, atol=1e-300)


def test_damping_of_the_thesis() -> None:
    # sigma^2 without a factor 2: one sigma away a Gaussian has fallen to 1 / e.
    alone = Navigation(peaks=Navigation().peaks[:1])
    np.testing.assert_allclose(
        alone.damping([0.0, 2.5, 0.0], [-2.3, -2.3, -0.8]),
        [8.5, 0.5 + 8.0 / np.e, 0.5 + 8.0 / np.e],
    )
    second = Navigation(peaks=Navigation().peaks[1:])
    np.testing.assert_allclose(
        second.damping([4.7, 3.2, 4.7], [1.0, 1.0, 3.0]),
        [8.5, 0.5 + 8.0 / np.e, 0.5 + 8.0 / np.e],
    )
    assert float(Navigation(peaks=()).damping(1, 2)) == 0.5


def test_a_force_pushes_along_its_axis() -> None:
    system = Navigation(peaks=())
    after, _, _ = reference.advance(system, np.zeros((9, 4)), np.arange(9))
    assert np.sign(after[:, [0, 2]]).astype(int).tolist() == [
        [a, b] for a in (-1, 0, 1) for b in (-1, 0, 1)
    ]
    # v(t) = u / b (1 - exp(-b t)) with b = 0.5.
    speed = (1.0 - np.exp(-0.1)) / 0.5
    np.testing.assert_allclose(after[8, [1, 3]], speed, rtol=1e-6)


def test_a_heavier_vehicle_is_slower_to_start_and_to_stop() -> None:
    for mass in (1.0, 4.0):
        system = Navigation(mass=mass, peaks=(), substeps=8)
        after, _, _ = reference.advance(system, [[0, 0, 0, 1], [0, 0, 0, 0]], [4, 7])
        decay = np.exp(-0.5 * 0.2 / mass)
        assert after[0, 3] == pytest.approx(decay, rel=1e-9)
        assert after[1, 1] == pytest.approx((1.0 - decay) / 0.5, rel=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_states_are_clipped(sign: float) -> None:
    system = Navigation(**DRIFTING)
    state = sign * np.array([4.9, 2.0, -4.9, -2.0])
    after, rewards, _ = reference.advance(system, [state], [0])
    # At the wall the velocity stays as it is; it does not bounce.
    assert after.tolist() == [[sign * 5.0, sign * 2.0, sign * -5.0, sign * -2.0]]
    assert rewards[0] == pytest.approx(-(2 * 0.2 * 25.0 + 2 * 0.1 * 4.0))

    pushed = Navigation(forces=((5.0 * sign, -5.0 * sign),))
    after, _, _ = reference.advance(pushed, [[0.0, 1.9 * sign, 3.5, -1.9 * sign]], [0])
    assert after[0, [1, 3]].tolist() == [2.0 * sign, -2.0 * sign]


def test_costs_computed_by_hand() -> None:
    state = [[1.0, 0.5, -2.0, -1.0]]
    moving = {**DRIFTING, "forces": ((3.0, -4.0),), "mass": 1e12}
    # After 0.125 s: c = (1.0625, -2.125), e' Q e = 0.2 1.1289 + 0.1 0.25
    # + 0.2 4.5156 + 0.1 1 = 1.25390625; u' u = 25.
    _, quadratic, _ = reference.advance(Navigation(**moving), state, [0])
    assert quadratic[0] == pytest.approx(-1.25390625, rel=1e-9)
    _, weighted, _ = reference.advance(
        Navigation(force_weight=0.1, **moving), state, [0]
    )
    assert weighted[0] == pytest.approx(-3.75390625, rel=1e-9)
    # A weight between c1 and v2 counts twice: 2 * 0.15 * 1.0625 * -1 = -0.31875.
    crossed = np.diag([0.2, 0.1, 0.2, 0.2])
    crossed[0, 3] = crossed[3, 0] = 0.15
    _, cross, _ = reference.advance(
        Navigation(state_weight=crossed, **moving), state, [0]
    )
    assert cross[0] == pytest.approx(-1.25390625 - 0.1 + 0.31875, rel=1e-9)
    _, time, _ = reference.advance(
        Navigation(cost="time", force_weight=0.1, **moving), state, [0]
    )
    assert time[0] == -1.0


ABOVE_1_8 = np.nextafter(0.125, 1.0)
ABOVE_1_4 = np.nextafter(0.25, 1.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("state", "inside"),
    [
        ((0.0, 0.0, 0.0, 0.0), True),
        ((0.25, 0.125, -0.25, -0.125), True),
        ((ABOVE_1_4, 0.0, 0.0, 0.0), False),
        ((0.0, ABOVE_1_8, 0.0, 0.0), False),
        ((0.0, 0.0, ABOVE_1_4, 0.0), False),
        ((0.0, 0.0, 0.0, ABOVE_1_8), False),
    ],
)
def test_bounds_include_their_edges(
    state: tuple[float, ...], inside: bool, sign: float
) -> None:
    # Binary fractions make the edges exact.
    system = Navigation(goal_bounds=(0.25, 0.125), **STILL)
    states = sign * np.array([state])
    after, _, reached = reference.advance(system, states, [0])
    np.testing.assert_allclose(after, states, rtol=0.0, atol=1e-29)
    assert reached.tolist() == [inside]
    assert system._in_goal(states.T).tolist() == [inside]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("state", "inside"),
    [
        ((0.0, 0.0, 0.0, 0.0), True),
        # 0.5 itself is not enough, in any variable.
        ((0.125, 0.0, 0.0, 0.0), False),
        ((0.0, 1.0, 0.0, 0.0), False),
        ((0.0, 0.0, 0.125, 0.0), False),
        ((0.0, 0.0, 0.0, 1.0), False),
        ((0.124, 0.0, 0.0, 0.0), True),
        ((0.0, 0.0, 0.0, 0.99), True),
        # 0.75 * 0.75 = 0.5625, times 0.8 = 0.45, times 0.9 = 0.50625.
        ((0.0625, 0.5, 0.0, 0.0), True),
        ((0.0625, 0.5, 0.05, 0.0), False),
        ((0.0625, 0.5, 0.025, 0.0), True),
        # Two factors that are not positive do not make a positive product.
        ((2.0, 0.0, 2.0, 0.0), False),
    ],
)
def test_membership_above_one_half(
    state: tuple[float, ...], inside: bool, sign: float
) -> None:
    system = Navigation(goal_rule="membership", goal_spacing=(0.25, 2.0), **STILL)
    states = sign * np.array([state])
    _, _, reached = reference.advance(system, states, [0])
    assert reached.tolist() == [inside]
    assert system._in_goal(states.T).tolist() == [inside]


def test_membership_is_that_of_the_partition() -> None:
    # The partition of §4.5.2; its cell at the goal is in the middle of each axis.
    position = [-5, -2, -0.3, -0.1, 0, 0.1, 0.3, 2, 5]
    partition = Fuzzy([position, [-2, 0, 2], position, [-2, 0, 2]])
    goal_cell = np.ravel_multi_index((4, 1, 4, 1), (9, 3, 9, 3))
    rng = np.random.default_rng(5)
    states = rng.uniform(-1, 1, (5000, 4)) * [0.05, 0.5, 0.05, 0.5]
    index, degree = partition(states)
    of_goal = np.where(index == goal_cell, degree, 0.0).sum(axis=1)
    system = Navigation(goal_rule="membership", **STILL)
    _, _, reached = reference.advance(system, states, np.zeros(5000))
    assert 500 < reached.sum() < 4500
    np.testing.assert_array_equal(reached, of_goal > 0.5)


@given(reference.moves())
def test_no_reward_exceeds_the_bounds(move: Move) -> None:
    system, states, actions = move
    _, rewards, _ = reference.advance(system, states, actions)
    assert rewards.max() <= 1e-12
    assert -rewards.min() <= system.max_stage_cost * (1.0 + 1e-12)


@given(reference.systems())
def test_the_largest_stage_cost_is_attained(system: Navigation) -> None:
    signs = np.array(list(np.ndindex(2, 2, 2, 2))) * 2 - 1
    corners = signs * reference.limits(system)
    dearest = int(np.argmax(np.sum(np.square(system.forces), axis=1)))
    cost = reference.stage_cost(system, corners, np.full(16, dearest))
    assert cost.max() == pytest.approx(system.max_stage_cost, rel=1e-12)


def test_largest_stage_costs_of_the_thesis() -> None:
    assert Navigation().max_stage_cost == pytest.approx(10.8)
    assert Navigation(force_weight=0.5).max_stage_cost == pytest.approx(11.8)
    assert Navigation(cost="time").max_stage_cost == 1.0


def test_evaluation_states_are_those_decided() -> None:
    states = Navigation().evaluation_states()
    assert states.shape == (100, 4)
    expected = qmc.Halton(4, scramble=False).random(101)[1:] * 2 - 1
    np.testing.assert_allclose(states, expected * [5, 2, 5, 2], rtol=0, atol=1e-14)
    # Point 1 is (1/2, 1/3, 1/5, 1/7), point 2 is (1/4, 2/3, 2/5, 2/7).
    np.testing.assert_allclose(states[0], [0, -2 / 3, -3, -10 / 7], atol=1e-14)
    np.testing.assert_allclose(states[1], [-2.5, 2 / 3, -1, -6 / 7], atol=1e-14)
    assert not reference.is_goal(Navigation(), states).any()
    assert Navigation.evaluation_steps == 150
    small = Navigation(position_max=0.5).evaluation_states()
    np.testing.assert_allclose(small, states / [10, 1, 10, 1])
    Navigation().checked_states(states)


@pytest.mark.parametrize("rule", ["bounds", "membership"])
def test_samples_are_uniform_outside_the_goal(rule: str) -> None:
    system = Navigation(
        goal_rule=rule, goal_bounds=(2.5, 1.0), goal_spacing=(20.0, 9.0)
    )
    n = 20_000
    states = system.sample_states(np.random.default_rng(3), n).T
    assert states.shape == (n, 4)
    assert np.all(np.abs(states) <= reference.limits(system))
    assert not reference.is_goal(system, states).any()
    # The plain way: draw from X, keep what is not the goal.
    plain = np.random.default_rng(4).uniform(-1, 1, (400_000, 4)) * [5, 2, 5, 2]
    plain = plain[~reference.is_goal(system, plain)]
    assert len(plain) < 390_000  # the goal is large enough to matter
    edges = [np.linspace(-limit, limit, 4) for limit in (5, 2, 5, 2)]
    counts, expected = (np.histogramdd(x, edges)[0].ravel() for x in (states, plain))
    large = expected > 1000.0
    share = expected[large] / expected[large].sum()
    assert chisquare(counts[large], share * counts[large].sum()).pvalue > 1e-4


def test_given_states_are_kept() -> None:
    given_states = np.array([[5, -2, -5, 2], [0, 0, 0, 0]])
    states = Navigation().checked_states(given_states)
    assert states.dtype == np.float64
    np.testing.assert_array_equal(states, given_states)
    assert not np.shares_memory(states, given_states)
