"""Profiles, obstacles and bodies, held against their equations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp

from acl_gym.swarm.aggregation import (
    Field,
    Gaussians,
    Kinematic,
    Obstacles,
    Plane,
    PointMass,
    Profile,
    Quadratic,
)

RNG = np.random.default_rng
POINTS = RNG(5).normal(0.0, 2.0, (60, 2))
VALLEYS = Gaussians(
    [[0.0, 0.0], [2.0, 1.0], [-1.0, 2.0]], [1.0, -0.5, 2.0], [0.5, 1, 2]
)
ROCKS = Obstacles([[0.0, 0.0], [3.0, 0.0]], [1.0, 0.5], strength=3.0, reach=0.7)
PROFILES = pytest.mark.parametrize(
    "profile", [Plane([1.0, -2.0]), Quadratic([1.0, 2.0], 0.7), VALLEYS, ROCKS]
)


@PROFILES
def test_gradients_are_those_of_the_values(profile: Any) -> None:
    step = 1e-6
    for axis in range(2):
        ahead, behind = POINTS.copy(), POINTS.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        slope = (profile.value(ahead) - profile.value(behind)) / (2 * step)
        np.testing.assert_allclose(
            profile.gradient(POINTS)[:, axis], slope, rtol=1e-6, atol=1e-8
        )


def test_values_of_profiles() -> None:
    assert Plane([1.0, -2.0]).value(np.array([3.0, 4.0])) == -5.0
    assert Quadratic([1.0, 1.0], 2.0).value(np.array([4.0, 5.0])) == 25.0
    bowl = Gaussians([[1.0, 1.0]], 3.0, 2.0)
    assert bowl.value(np.array([1.0, 1.0])) == -3.0 == bowl.least
    # A = 2 d and l = 2 s^2 in (A / 2) exp(-|x - c|^2 / l).
    np.testing.assert_allclose(
        bowl.value(POINTS),
        -3.0 * np.exp(-np.square(POINTS - 1.0).sum(axis=1) / 8.0),
        rtol=1e-14,
    )
    assert VALLEYS.least == -3.0
    assert (VALLEYS.value(POINTS) >= VALLEYS.least).all()
    # One number is enough where all are alike, and any shape of positions is taken.
    each = Gaussians([[0, 0], [1, 1]], [2, 2], [3, 3])
    both = Gaussians([[0, 0], [1, 1]], 2, 3)
    grid = POINTS.reshape(3, 20, 2)
    np.testing.assert_array_equal(both.value(grid), each.value(grid))
    assert both.gradient(grid).shape == (3, 20, 2)


def test_an_obstacle_repels_within_its_reach_and_stops_what_enters() -> None:
    x = np.array([[1.7, 0.0], [1.5, 0.0], [0.0, -0.5], [0.0, 0.0], [3.0, 0.2]])
    force = -ROCKS.gradient(x)
    # k (reach - rho) outwards, rho being the distance from the edge.
    np.testing.assert_allclose(
        force,
        [
            [0.0, 0.0],
            [3.0 * 0.2, 0.0],
            [0.0, -3.0 * 1.2],
            [0.0, 0.0],
            [0.0, 3.0 * 1.0],
        ],
        atol=1e-14,
    )
    assert ROCKS.inside(x).tolist() == [False, False, True, True, True]
    assert ROCKS.stop(x).tolist() == [False, False, True, True, True]
    np.testing.assert_allclose(
        x, [[1.7, 0.0], [1.5, 0.0], [0.0, -1.0], [1.0, 0.0], [3.0, 0.5]], atol=1e-15
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane([[1.0]]), "slope must be an array of 1 axes"),
        (lambda: Quadratic([math.nan, 0.0]), "centre must be an array of 1 axes"),
        (lambda: Quadratic([0.0], math.inf), "curvature must lie in"),
        (lambda: Gaussians([0.0, 0.0]), "centres must be an array of 2 axes"),
        (lambda: Gaussians([[0, 0]], [1, 2]), "depths must be a number or have one"),
        (lambda: Gaussians([[0, 0]], 1, 0), "widths must be > 0.* got 0"),
        (lambda: Gaussians([[0, 0]], 1, 1e-200), "1e-150 or more.* got 1e-200"),
        (lambda: Obstacles([[0, 0]], -1), "radii must be > 0, got -1"),
        (lambda: Obstacles([[0, 0]], 1, reach=-1), "reach must lie in"),
        (
            lambda: VALLEYS.value(np.zeros((3, 3))),
            "must have 2 coordinates each, as the",
        ),
        (lambda: ROCKS.gradient(np.zeros((3, 3))), "must have 2 coordinates each, as"),
        (lambda: Kinematic(max_speed=0), "max_speed must lie in"),
        (lambda: PointMass(mass=0), "mass must lie in"),
        (lambda: PointMass(damping=math.inf), "damping must lie in"),
    ],
)
def test_what_makes_no_field_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


# --- bodies ---------------------------------------------------------------------------


@given(
    arrays(np.float64, (7, 2), elements=st.floats(-1e200, 1e200)),
    st.floats(1e-3, 1e3),
)
def test_velocities_are_shortened_and_keep_their_direction(
    u: np.ndarray, longest: float
) -> None:
    moved = Kinematic(max_speed=longest).advance(np.zeros((7, 2)), u, 1.0)
    for row, wanted in zip(moved, u, strict=True):
        length = math.hypot(*wanted)
        share = min(1.0, longest / length) if length > 0 else 1.0
        np.testing.assert_allclose(row, wanted * share, rtol=1e-13, atol=1e-290)


def test_a_limit_for_each_agent() -> None:
    u = np.full((3, 2), 3.0)
    moved = Kinematic(max_speed=[1.0, 5.0, math.inf]).advance(np.zeros((3, 2)), u, 2.0)
    side = math.sqrt(0.5)
    np.testing.assert_allclose(moved, 2 * np.array([[side, side], [3, 3], [3, 3]]))


@given(
    st.floats(0.1, 5.0),
    st.one_of(st.just(0.0), st.floats(-6.0, 3.0).map(lambda e: 10.0**e)),
    st.floats(0.01, 2.0),
)
def test_a_step_of_a_point_mass_is_the_solution(
    mass: float, damping: float, time_step: float
) -> None:
    body = PointMass(mass=mass, damping=damping)
    x0, u = np.array([[1.0, -2.0, 0.5, 3.0]]), np.array([[2.0, -1.0]])
    if damping * time_step / mass < 40:

        def rate(_: float, x: np.ndarray) -> np.ndarray:
            return np.concatenate([x[2:], (u[0] - damping * x[2:]) / mass])

        solved = solve_ivp(
            rate, (0, time_step), x0[0], method="Radau", rtol=1e-9, atol=1e-11
        )
        wanted = solved.y[:, -1]
    else:  # at the final speed almost at once
        speed = u[0] / damping
        lag = (x0[0, 2:] - speed) * mass / damping
        wanted = np.concatenate([x0[0, :2] + speed * time_step + lag, speed])
    moved = body.advance(x0, u, time_step)[0]
    np.testing.assert_allclose(moved, wanted, rtol=1e-6, atol=1e-8)
    # Two halves are as good as a whole.
    halves = body.advance(body.advance(x0, u, time_step / 2), u, time_step / 2)[0]
    np.testing.assert_allclose(halves, moved, rtol=1e-11, atol=1e-12)


def test_bodies_differ() -> None:
    x = np.zeros((2, 2))
    u = np.ones((2, 1))
    both = PointMass(mass=[1.0, 4.0], damping=[0.5, 0.0]).advance(x, u, 0.3)
    for i, (mass, damping) in enumerate([(1.0, 0.5), (4.0, 0.0)]):
        one = PointMass(mass=mass, damping=damping).advance(x[:1], u[:1], 0.3)
        np.testing.assert_array_equal(both[i], one[0])


# --- the field ------------------------------------------------------------------------


def test_what_agents_observe_is_theirs_to_keep() -> None:
    field = Field([[0.0, 0.0], [1.0, 2.0]], PointMass(), profile=Quadratic([1.0, 1.0]))
    field.reset(RNG(0))
    assert field.n == 2
    seen = field.observe()
    assert set(seen) == {"position", "slope", "velocity"}
    np.testing.assert_array_equal(seen["slope"], [[-1.0, -1.0], [0.0, 1.0]])
    kept = {name: array.copy() for name, array in seen.items()}
    field.step(np.ones((2, 2)), RNG(0))
    for name, array in seen.items():
        np.testing.assert_array_equal(array, kept[name])
    assert field.time == field.time_step
    assert field.velocities is not None
    assert (field.velocities > 0).all()


def test_nobody_enters_an_obstacle() -> None:
    wall = Obstacles([[0.0, 0.0]], 1.0, strength=0.0)
    for body in (Kinematic(), PointMass()):
        field = Field([[-2.0, 0.0], [-2.0, 3.0]], body, obstacles=wall, time_step=0.05)
        field.reset(RNG(0))
        for _ in range(200):
            field.step(np.full((2, 2), [1.0, 0.0]), RNG(0))
        np.testing.assert_allclose(field.positions[0], [-1.0, 0.0], atol=1e-15)
        assert field.positions[1, 0] > 5.0
        if field.velocities is not None:
            assert field.velocities[0].tolist() == [0.0, 0.0]


def test_starts_are_drawn_beside_obstacles_and_from_the_seed() -> None:
    rock = Obstacles([[0.0, 0.0]], 2.0)
    field = Field(300, obstacles=rock, bounds=(-2.5, 2.5))
    field.reset(RNG(3))
    first = field.positions.copy()
    assert not rock.inside(first).any()
    assert first.min() >= -2.5
    assert first.max() <= 2.5
    field.reset(RNG(3))
    np.testing.assert_array_equal(field.positions, first)
    space = Field(5, dim=3)
    space.reset(RNG(0))
    assert space.x.shape == (5, 3)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Field(0), ValueError, "start must be at least 1, got 0"),
        (lambda: Field(2.5), TypeError, "start must be an integer"),
        (lambda: Field(3, time_step=0.0), ValueError, "time_step must lie in"),
        (lambda: Field(3, bounds=(1, 0)), ValueError, "lowest and the highest"),
        (lambda: Field(3, profile=Kinematic()), TypeError, "a subclass of Profile"),
        (lambda: Field(3, Quadratic([0, 0])), TypeError, "a subclass of Particles"),
        (lambda: Field(3, profile=Plane([1.0])), ValueError, "must have 1 coordinates"),
        (lambda: Field([[math.inf, 0.0]]), ValueError, "start must be an array of 2"),
        (lambda: Field([[math.nan, 0.0]]), ValueError, "start must be an array of 2"),
        (
            lambda: Field([[1e200, 0.0]]),
            ValueError,
            "start must hold coordinates of at",
        ),
        (lambda: Field(10**12), ValueError, "agents with 2 coordinates each must fit"),
        (lambda: Field(3, dim=10**12), ValueError, "3 agents with 1,000,000,000,000"),
        (
            lambda: Field(8, Kinematic(max_speed=[1.0, 2.0, 3.0])),
            ValueError,
            "max_speed must be a number, or one for each of the 8 agents",
        ),
        (
            lambda: Field(8, PointMass(mass=np.ones(3))),
            ValueError,
            "mass must be a number, or one for each of the 8 agents",
        ),
        (
            lambda: Field(8, PointMass(max_force=np.ones(7))),
            ValueError,
            "max_force must be a number, or one for each of the 8 agents",
        ),
    ],
)
def test_what_makes_no_field(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_no_room_beside_the_obstacles() -> None:
    field = Field(3, obstacles=Obstacles([[0.0, 0.0]], 10.0))
    with pytest.raises(ValueError, match="bounds must leave room beside the obstacles"):
        field.reset(RNG(0))


@pytest.mark.parametrize(
    ("u", "message"),
    [
        (np.zeros((3, 2)), r"u must be an array of numbers of shape \(2, 2\)"),
        ("abc", "u must be an array of numbers"),
        (np.zeros((2, 2), complex), "u must be an array of numbers"),
        (np.full((2, 2), np.nan), "inputs must be finite, got .* for agent 0"),
        ([[0.0, 0.0], [np.inf, 0.0]], "inputs must be finite, got .* for agent 1"),
    ],
)
def test_bad_inputs(u: Any, message: str) -> None:
    field = Field(2)
    field.reset(RNG(0))
    with pytest.raises(ValueError, match=message):
        field.step(u, RNG(0))


def test_a_profile_of_ones_own() -> None:
    class Cliff(Profile):
        def value(self, positions: np.ndarray) -> np.ndarray:
            return np.maximum(positions[..., 0], 0.0)

        def gradient(self, positions: np.ndarray) -> np.ndarray:
            return np.stack([positions[:, 0] > 0, np.zeros(len(positions))], axis=1)

    field = Field([[1.0, 0.0], [-1.0, 0.0]], profile=Cliff())
    field.reset(RNG(0))
    np.testing.assert_array_equal(field.observe()["slope"], [[1.0, 0.0], [0.0, 0.0]])


class Own(Profile):
    """A profile with any gradient."""

    def __init__(self, gradient: Any) -> None:
        self.given = gradient

    def value(self, positions: np.ndarray) -> np.ndarray:
        return positions[..., 0]

    def gradient(self, positions: np.ndarray) -> np.ndarray:
        return self.given(positions)


@pytest.mark.parametrize("given", [lambda x: 1.0, lambda x: x[:, 0], lambda x: x + 1j])
def test_a_gradient_of_another_shape_is_refused(given: Any) -> None:
    with pytest.raises(ValueError, match="the gradient of Own must be real numbers of"):
        Field(3, profile=Own(given))


def test_a_gradient_that_is_nan_is_not_the_agents_fault() -> None:
    field = Field(3, profile=Own(lambda x: x * np.nan))
    field.reset(RNG(0))
    with pytest.raises(ValueError, match="the gradient of Own must be finite, got"):
        field.observe()


def test_there_are_no_states_before_a_reset() -> None:
    field = Field(3, PointMass())
    for name in ("positions", "velocities"):
        with pytest.raises(RuntimeError, match="a Field must be reset before"):
            getattr(field, name)


@pytest.mark.parametrize(
    ("body", "x", "u", "message"),
    [
        (Kinematic(max_speed=[1, 2]), (3, 2), (3, 2), "max_speed must be a number, or"),
        (PointMass(damping=[1, 2]), (3, 4), (3, 2), "damping must be a number, or one"),
        (PointMass(), (3, 2), (3, 2), r"x must have shape \(3, 4\)"),
        (PointMass(), (2, 4), (3, 2), r"x must have shape \(3, 4\)"),
        (Kinematic(), (1, 2), (3, 2), r"x must have shape \(3, 2\)"),
        (Kinematic(), (3, 2), (3,), r"u must have shape \(n, dim\)"),
    ],
)
def test_bodies_of_others_are_not_moved(
    body: Any, x: Any, u: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        body.advance(np.zeros(x), np.ones(u), 0.1)


# --- obstacles on the way ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("positions", "before", "error", "message"),
    [
        (
            [[0.0, 0.0]],
            None,
            TypeError,
            "positions must be a float64 array that can be",
        ),
        (np.zeros((3, 2), int), None, TypeError, "positions must be a float64 array"),
        (np.broadcast_to(0.0, (3, 2)), None, TypeError, "that can be written to"),
        (np.zeros((3, 3)), None, ValueError, "positions must have 2 coordinates each"),
        (np.zeros((3, 2)), np.zeros((2, 2)), ValueError, "before must have the shape"),
        (np.zeros((3, 2)), np.zeros((3, 3)), ValueError, "positions must have 2 coord"),
    ],
)
def test_what_cannot_be_stopped(
    positions: Any, before: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        ROCKS.stop(positions, before)


def test_nobody_jumps_through_an_obstacle() -> None:
    rock = Obstacles([[0.0, 0.0]], 0.5)
    before = np.array(
        [[-2.0, 0.0], [-2.0, 0.3], [-2.0, 0.5], [-2.0, 0.6], [-0.5, 0.0], [-2.0, 0.0]]
    )
    after = before + np.array([4.0, 0.0])
    after[5] = [0.2, 0.0]  # beyond the middle
    stopped = rock.stop(after, before)
    assert stopped.tolist() == [True, True, False, False, True, True]
    np.testing.assert_allclose(
        after,
        [[-0.5, 0.0], [-0.4, 0.3], [2.0, 0.5], [2.0, 0.6], [-0.5, 0.0], [-0.5, 0.0]],
        atol=1e-14,
    )


def test_agents_slide_along_an_edge() -> None:
    rock = Obstacles([[0.0, 0.0]], 1.0)
    before = np.array([[-1.0, 0.0]])
    after = np.array([[-0.9, 0.2]])
    assert rock.stop(after, before).tolist() == [True]
    np.testing.assert_allclose(after, np.array([[-0.9, 0.2]]) / math.hypot(0.9, 0.2))


circles = st.lists(
    st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.05, 1.5)),
    min_size=1,
    max_size=5,
)


@given(circles, st.integers(0, 2**32 - 1))
def test_nobody_is_left_inside_obstacles_that_overlap(
    rows: list[tuple[float, float, float]], seed: int
) -> None:
    table = np.array(rows)
    rocks = Obstacles(table[:, :2], table[:, 2])
    before = RNG(seed).uniform(-4, 4, (40, 2))
    inside = rocks.inside(before)
    assert rocks.stop(before).tolist() == inside.tolist()
    assert not rocks.inside(before).any()
    after = before + RNG(seed + 1).normal(0, 1.0, (40, 2))
    wanted = after.copy()
    stopped = rocks.stop(after, before)
    assert not rocks.inside(after).any()
    np.testing.assert_array_equal(after[~stopped], wanted[~stopped])
    # The ways of the others lead through nothing.
    for share in np.linspace(0, 1, 21):
        on_the_way = before + share * (wanted - before)
        between = on_the_way[~stopped]
        distance = np.linalg.norm(between[:, None] - table[:, :2], axis=2)
        assert (distance >= table[:, 2] * (1 - 1e-8)).all()


def test_nobody_is_put_into_an_obstacle() -> None:
    """Agents would be moved without a word."""
    with pytest.raises(
        ValueError, match=r"start must lie outside the obstacles, got .* for agent 1"
    ):
        Field([[2.0, 2.0], [0.1, 0.0]], obstacles=ROCKS)
    field = Field([[2.0, 2.0], [1.0, 0.0]], obstacles=ROCKS)  # the second at an edge
    field.reset(RNG(0))
    assert field.x.tolist() == [[2.0, 2.0], [1.0, 0.0]]


def test_bounds_too_wide_to_draw_from() -> None:
    with pytest.raises(ValueError, match=r"both within 1e\+150 of 0, got \(-1e\+308"):
        Field(3, bounds=(-1e308, 1e308))


class Unruly(Kinematic):
    """Particles that move as a test says."""

    def advance(self, x: Any, u: Any, time_step: float) -> Any:
        return self.__dict__["moved"](x)


@pytest.mark.parametrize(
    ("moved", "message"),
    [
        (lambda x: None, "what Unruly.advance returns must be an array of numbers"),
        (lambda x: x[:1], "what Unruly.advance returns must be an array of numbers"),
        (lambda x: x * math.nan, "positions must be numbers of at most 1e"),
        (lambda x: x + 1e200, "positions must be numbers of at most 1e"),
    ],
)
def test_particles_of_ones_own_are_checked(moved: Any, message: str) -> None:
    particles = Unruly()
    particles.__dict__["moved"] = moved
    field = Field([[0.0, 1.0], [1.0, 0.0]], particles)
    field.reset(RNG(0))
    with pytest.raises(ValueError, match=message):
        field.step(np.zeros((2, 2)), RNG(0))


def test_particles_that_change_their_argument_do_not_jump_through_obstacles() -> None:
    def leap(x: np.ndarray) -> np.ndarray:
        x += [4.0, 0.0]
        return x

    particles = Unruly()
    particles.__dict__["moved"] = leap
    rock = Obstacles([[0.0, 0.0]], 1.0)
    field = Field([[-2.0, 0.0]], particles, obstacles=rock)
    field.reset(RNG(0))
    field.step(np.zeros((1, 2)), RNG(0))
    np.testing.assert_allclose(field.x, [[-1.0, 0.0]], atol=1e-12)


def test_particles_without_a_number_of_variables() -> None:
    particles = Unruly()
    particles.__dict__["variables"] = 3
    with pytest.raises(
        ValueError, match="variables of Unruly must be at most 2, got 3"
    ):
        Field(2, particles)


@pytest.mark.parametrize(
    "call",
    [
        ROCKS.gradient,
        ROCKS.inside,
        VALLEYS.value,
        lambda x: Quadratic([0.0, 0.0]).gradient(x),
        lambda x: PointMass().advance(np.zeros((1, 4)), x, 0.1),
    ],
)
@pytest.mark.parametrize(
    "x", [[[math.nan, 0.0]], [["a", "b"]], None, [[1.0, 0.0], [1.0]]], ids=repr
)
def test_no_nan_and_nothing_odd_goes_through(call: Any, x: Any) -> None:
    with pytest.raises(ValueError, match=r"(positions|u) must"):
        call(x)


@pytest.mark.parametrize(
    "settings",
    [{"time_step": 1e308}, {"profile": Quadratic([9.0, 9.0], 1e308)}],
    ids=["time_step", "profile"],
)
def test_what_overflows_ends_in_an_error(settings: dict[str, Any]) -> None:
    field = Field([[0.0, 0.0], [1.0, 1.0]], **settings)
    field.reset(RNG(0))
    with pytest.raises(ValueError, match=r"positions must be numbers|must be finite"):
        field.step(-field.observe()["slope"] + [3.0, 3.0], RNG(0))


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"bounds": "x"}, ValueError, "bounds must"),
        ({"dim": "y"}, TypeError, "dim must"),
    ],
)
@pytest.mark.parametrize("start", [2, [[0.0, 0.0], [1.0, 1.0]]], ids=repr)
def test_settings_are_checked_whether_they_are_used_or_not(
    start: Any, settings: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        Field(start, **settings)
