"""The shared world: what agents see, do and pay, against the definitions written out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acl_gym.envs.swarm_aggregation import SwarmAggregation
from acl_gym.envs.swarm_aggregation.kernels import look_around
from acl_gym.envs.swarm_aggregation.system import LEAST, MOST, MOST_WITHOUT_RADIUS
from acl_gym.envs.swarm_aggregation.world import World
from acl_gym.swarm import Radius
from acl_gym.swarm.cells import sort_into_cells
from tests.envs.swarm_aggregation import reference_world as reference

RNG = np.random.default_rng
coordinates = st.integers(-40, 40).map(lambda k: k / 8.0)
VALLEYS = ((1.0, 1.0, 2.0, 1.5), (-2.0, 0.0, -1.0, 1.0))
ROCKS = ((-3.0, -3.0, 0.75), (3.0, 2.5, 1.0))

VARIANTS: list[dict[str, Any]] = [
    {},
    {"sensing_radius": 1.5},
    {"sensing_radius": 0.3, "nearest": 3},
    {"nearest": 0},
    {"nearest": 5},
    {"point_mass": True, "mass": 0.5, "damping": 0.1},
    {"observe": "potential"},
    {"observe": "potential", "sensing_radius": 1.5, "point_mass": True},
    {"observe": "potential", "valleys": VALLEYS, "obstacles": ROCKS},
    {"valleys": VALLEYS, "obstacles": ROCKS, "profile_weight": 0.7},
    {"distance_weight": 0.3, "collision_weight": 2.0, "collision_distance": 0.6},
    {"followers": 4, "obstacles": ROCKS},
    {"followers": 6, "sensing_radius": 2.0, "valleys": VALLEYS, "point_mass": True},
]
EVERY_VARIANT = pytest.mark.parametrize("variant", VARIANTS, ids=str)


@given(
    st.integers(1, 30).flatmap(
        lambda n: arrays(np.float64, (n, 2), elements=coordinates)
    ),
    st.sampled_from([0.1, 0.5, 1.0, 2.0, 20.0, math.inf]),
    st.sampled_from([0.0, 0.2, 1.0, 3.0]),
    st.integers(0, 4),
    st.sampled_from([0.1, 0.7, 3.0, 50.0]),
)
def test_look_around(
    x: np.ndarray, radius: float, contact: float, count: int, side: float
) -> None:
    """Whatever the width of the cells."""
    n = len(x)
    found = []
    for kernel in (look_around, look_around.py_func):
        heard, collisions = np.full(n, -1), np.full(n, -1)
        towards, nearest = np.full((n, 2), np.nan), np.full((n, 2 * count), np.nan)
        cells = sort_into_cells(x, side)
        kernel(cells, radius, contact, heard, towards, collisions, nearest)
        found.append((heard, towards, collisions, nearest))
    for compiled, plain in zip(*found, strict=True):
        np.testing.assert_array_equal(compiled, plain)
    for i in range(n):
        others = reference.others_by_distance(x, i)
        assert collisions[i] == sum(r < contact for r, _ in others)
        near = [(r, j) for r, j in others if r < radius]
        if radius < math.inf:
            assert heard[i] == len(near)
            wanted = sum((x[j] - x[i] for _, j in near), np.zeros(2))
            np.testing.assert_allclose(towards[i], wanted, atol=1e-12)
        shown = nearest[i].reshape(-1, 2)
        distances = [math.hypot(*row) for row in shown]
        wanted = [r for r, _ in near[:count]] + [0.0] * (count - len(near))
        assert distances == wanted  # of equally distant ones, any
        places = {tuple(x[j] - x[i]) for _, j in near} | {(0.0, 0.0)}
        assert all(tuple(row) in places for row in shown)


def worlds(variant: dict[str, Any], learners: int, seed: int) -> World:
    world = World(SwarmAggregation(**variant), learners, 0)
    world.start(RNG(seed))
    return world


@EVERY_VARIANT
def test_observations_and_costs_are_those_of_the_definition(
    variant: dict[str, Any],
) -> None:
    world = worlds(variant, 12, 0)
    system, rng = world.system, RNG(1)
    space = system.observation_space
    hits = 0
    for _ in range(40):
        # Now together, now apart.
        inputs = np.where(rng.random() < 0.6, -0.4 * world.positions[:12], 0.0)
        inputs = inputs + rng.normal(0, 0.5, (12, 2))
        before = world.states.copy()
        outcome = world.step(inputs)
        seen, states = world.observe(), world.states
        assert seen.dtype == np.float64
        for i in range(12):
            np.testing.assert_allclose(
                seen[i],
                reference.observation(system, states, i),
                rtol=1e-10,
                atol=1e-10,
            )
            assert space.contains(seen[i])
            costs = [reference.cost(system, states, i, hit) for hit in (False, True)]
            which = int(outcome.collisions[i]) - world.look().collisions[i]
            assert outcome.rewards[i] == pytest.approx(-costs[which], abs=1e-12)
            hits += which
        # Followers obey the rule, as every agent would that took its input.
        if world.n > 12 and not system.point_mass:
            wanted = [
                reference.rule(system, before[:, :2], i) for i in range(12, world.n)
            ]
            free = np.abs(states[12:]).max(axis=1) < system.half_width
            if system.walls is not None:
                edge = np.linalg.norm(
                    states[12:, None] - system.walls.centres, axis=2
                ) - np.asarray(system.walls.radii)
                free &= edge.min(axis=1) > 1e-9
            moved = (states[12:] - before[12:]) / system.time_step
            np.testing.assert_allclose(moved[free], np.array(wanted)[free], atol=1e-10)
    if system.obstacles:
        assert not system.walls.inside(world.positions * (1 - 1e-12)).any()


def test_the_centre_is_the_sum_of_what_is_observed() -> None:
    """With everyone heard, the cost of the distance follows from the observation."""
    world = worlds({"collision_weight": 0.0}, 7, 3)
    outcome = world.step(np.zeros((7, 2)))
    to_centre = world.observe()[:, 2:4] * 6 / 7
    np.testing.assert_allclose(
        outcome.distance, np.hypot(*to_centre.T), rtol=1e-12, atol=1e-12
    )
    np.testing.assert_array_equal(outcome.rewards, -outcome.distance)


def test_walls_stop_agents_and_their_speed() -> None:
    for point_mass in (False, True):
        world = worlds({"point_mass": point_mass, "time_step": 1.0}, 1, 0)
        world.start(RNG(0), np.zeros((1, world.system.state_size)))
        for _ in range(30):
            world.step(np.array([[1.0, 0.1]]))
        assert world.positions[0, 0] == 5.0
        assert world.positions[0, 1] < 5.0
        if point_mass:
            assert world.states[0, 2] == 0.0
            assert world.states[0, 3] > 0.0


def test_point_masses_keep_to_their_largest_speed_and_force() -> None:
    world = worlds({"point_mass": True, "max_speed": 0.3, "damping": 0.0}, 3, 0)
    for _ in range(10):
        world.step(np.full((3, 2), 100.0))
    speed = np.hypot(*world.states[:, 2:].T)
    moving = np.abs(world.positions).max(axis=1) < 5.0
    np.testing.assert_allclose(speed[moving], 0.3)
    slow = worlds({"point_mass": True, "damping": 0.0}, 1, 0)
    slow.start(RNG(0), np.zeros((1, 4)))
    slow.step(np.array([[3.0, 4.0]]))
    np.testing.assert_allclose(slow.states[0, 2:], [0.6 * 0.2, 0.8 * 0.2])


def test_an_obstacle_stops_an_agent_and_counts_as_a_collision() -> None:
    world = worlds({"obstacles": [(0.0, 0.0, 1.0)]}, 2, 0)
    world.start(RNG(0), np.array([[-1.05, 0.0], [4.0, 4.0]]))
    outcome = world.step(np.array([[1.0, 0.0], [1.0, 0.0]]))
    assert outcome.collisions.tolist() == [1, 0]
    np.testing.assert_allclose(world.positions[0], [-1.0, 0.0], atol=1e-15)


def test_agents_put_elsewhere_leave_the_others_as_they_are() -> None:
    world = World(SwarmAggregation(point_mass=True), 6, 0, keep_trail=True)
    world.start(RNG(0))
    for _ in range(3):
        world.step(RNG(1).normal(size=(6, 2)))
    before = world.states.copy()
    world.place(np.array([1, 4]), RNG(5))
    others = [0, 2, 3, 5]
    assert world.states[others].tobytes() == before[others].tobytes()
    assert (world.states[[1, 4], :2] != before[[1, 4], :2]).all()
    assert (world.states[[1, 4], 2:] == 0.0).all()
    # Their trails begin where they are now.
    trail = world.scene().trail
    assert len(trail) == 3
    assert (trail[:, [1, 4]] == world.positions[[1, 4]]).all()


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"followers": -1}, ValueError, "followers must be at least 0"),
        ({"point_mass": 1}, TypeError, "point_mass must be True or False"),
        ({"directions": 1}, ValueError, "directions must be at least 2"),
        ({"observe": "all"}, ValueError, "observe must be one of 'neighbours'"),
        ({"nearest": 0.5}, TypeError, "nearest must be an integer"),
        ({"sensing_radius": 0}, ValueError, r"sensing_radius must lie in \[1e-09"),
        ({"max_speed": 0}, ValueError, "max_speed must lie in"),
        ({"half_width": math.inf}, ValueError, "half_width must lie in"),
        ({"collision_weight": -1}, ValueError, "collision_weight must lie in"),
        ({"valleys": [(0, 0, 1)]}, ValueError, "valleys must be rows"),
        ({"valleys": [(0, 0, 1, 0)]}, ValueError, "widths of valleys must lie in"),
        (
            {"valleys": [(0, 0, 1e308, 1)]},
            ValueError,
            "valleys must be rows .* at most",
        ),
        ({"half_width": 1e308}, ValueError, r"half_width must lie in \[1e-09, 1e9\]"),
        ({"half_width": 1e-310}, ValueError, "half_width must lie in"),
        ({"point_mass": True, "mass": 1e-320}, ValueError, "mass must lie in"),
        ({"attraction": 1e308}, ValueError, r"attraction must lie in \[0, 1e9\]"),
        ({"distance_weight": 1e308}, ValueError, "distance_weight must lie in"),
        ({"time_step": 1e-320}, ValueError, "time_step must lie in"),
        ({"valleys": [(0, 0, 1, 1e-320)]}, ValueError, "widths of valleys must lie in"),
        ({"obstacles": [(0, 0, 1e-320)]}, ValueError, "radius >= 1e-09 that lie in"),
        ({"valleys": 3.0}, ValueError, "valleys must be an array of 2 axes"),
        ({"obstacles": [(0, 0, -1)]}, ValueError, "obstacles must be rows"),
        (
            {"obstacles": [(4.5, 0, 1)]},
            ValueError,
            "lie in the world, whose half_width",
        ),
        (
            {"obstacles": [(0, 0, 5), (0, 0, 3)]},
            ValueError,
            "leave a tenth of the world",
        ),
    ],
)
def test_what_makes_no_world(
    values: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        SwarmAggregation(**values)


def test_parameters_are_plain_and_can_be_hashed() -> None:
    rows = np.array([[0.0, 1.0, 2.0, 3.0]])
    system = SwarmAggregation(valleys=rows, obstacles=[[1, 1, 1]], max_speed=2)
    assert system.valleys == ((0.0, 1.0, 2.0, 3.0),)
    assert system.obstacles == ((1.0, 1.0, 1.0),)
    assert hash(system) == hash(
        SwarmAggregation(valleys=((0, 1, 2, 3),), obstacles=((1, 1, 1),), max_speed=2.0)
    )


def test_directions() -> None:
    np.testing.assert_array_equal(
        SwarmAggregation(max_speed=2).inputs,
        [[0, 0], [2, 0], [0, 2], [-2, 0], [0, -2]],
    )
    eight = SwarmAggregation(directions=8, point_mass=True, max_force=3.0)
    assert eight.action_space.n == 9
    np.testing.assert_allclose(np.hypot(*eight.inputs[1:].T), 3.0)


def test_no_memory_for_so_many() -> None:
    with pytest.raises(ValueError, match=r"agents with .* must fit into"):
        World(SwarmAggregation(), 10**12, 0)


SMALL = dict.fromkeys(("mass", "time_step", "spread", "max_speed", "max_force"), LEAST)
LARGE = dict.fromkeys(
    (
        *("attraction", "repulsion", "damping", "distance_weight", "max_speed"),
        *("collision_weight", "profile_weight", "half_width", "max_force", "time_step"),
    ),
    MOST,
)


@pytest.mark.parametrize("point_mass", [False, True])
@pytest.mark.parametrize(
    "values",
    [
        SMALL,
        LARGE,
        {**LARGE, "mass": LEAST},
        {**SMALL, **LARGE},
        {**SMALL, "half_width": LEAST, "sensing_radius": LEAST},
        {**LARGE, "valleys": [(0, 0, MOST, LEAST), (1, 1, -MOST, MOST)]},
        {"time_step": LEAST, "obstacles": [(0, 0, LEAST), (1, 1, 1)]},
    ],
    ids=str,
)
def test_the_limits_of_the_parameters_give_finite_numbers(
    values: dict[str, Any], point_mass: bool
) -> None:
    for observe in ("neighbours", "potential"):
        system = SwarmAggregation(
            **{**values, "observe": observe, "point_mass": point_mass}
        )
        world = World(system, 4, 2)
        world.start(RNG(0))
        for _ in range(5):
            inputs = system.inputs[RNG(1).integers(0, 5, 4)]
            outcome = world.step(inputs)
            assert np.isfinite(outcome.rewards).all()
            assert np.isfinite(world.states).all()
            assert system.observation_space.contains(world.observe()[0])


def test_nobody_jumps_through_an_obstacle() -> None:
    world = worlds({"obstacles": [(0.0, 0.0, 0.05)]}, 2, 0)
    world.start(RNG(0), np.array([[-0.1, 0.0], [4.0, 4.0]]))
    outcome = world.step(np.array([[1.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_allclose(world.positions[0], [-0.05, 0.0], atol=1e-15)
    assert outcome.collisions.tolist() == [1, 0]


@pytest.mark.parametrize("point_mass", [False, True])
@pytest.mark.parametrize(
    "obstacles",
    [
        [(0, 0, 1.3)],
        [(0, 0, 1.3), (1.0, 0.3, 1.1), (0.2, -1.0, 0.9), (0.1, 0.1, 0.2)],
        [(4.0, 0.0, 1.0), (0.0, -4.1, 0.9), (4.3, -4.3, 0.7)],  # touch the walls
        [(3.9, 0.0, 1.0), (3.9, 1.9, 1.05)],  # a gap that becomes narrow
    ],
    ids=str,
)
def test_states_of_the_world_can_be_set_again(
    obstacles: list[tuple[float, ...]], point_mass: bool
) -> None:
    system = SwarmAggregation(
        obstacles=obstacles, point_mass=point_mass, max_speed=1.3, time_step=0.3
    )
    world, rng = World(system, 60, 0), RNG(0)
    world.start(rng)
    goals = np.array(obstacles)[rng.integers(0, len(obstacles), 60), :2]
    for step in range(60):
        if step % 20 == 0:
            goals = (
                rng.uniform(-6, 6, (60, 2)) if step == 40 else rng.permutation(goals)
            )
        world.step(3.0 * (goals - world.positions))
        assert world.states is not None
        again = system.checked_states(world.states)
        np.testing.assert_array_equal(again, world.states)


def test_many_agents_that_hear_all_others_are_refused() -> None:
    many = MOST_WITHOUT_RADIUS
    World(SwarmAggregation(), many + 1, 0)  # nobody follows the rule
    World(SwarmAggregation(sensing_radius=1.0), 1, many)
    for system, learners, followers in (
        (SwarmAggregation(), 1, many),
        (SwarmAggregation(followers=many), 1, 9),
        (SwarmAggregation(observe="potential"), many + 1, 0),
    ):
        with pytest.raises(
            ValueError, match=r"at most 20,000 agents where .* set sensing"
        ):
            World(system, learners, followers)


def test_neighbours_that_are_observed_count_as_memory() -> None:
    with pytest.raises(ValueError, match=r"links must fit .* or a smaller nearest"):
        World(SwarmAggregation(nearest=1000), 10**6, 0)


COORDINATES = st.floats(1e-3, 3.0)


@given(COORDINATES, COORDINATES)
def test_a_pair_at_the_limit_does_not_collide(a: float, b: float) -> None:
    """As in a `Radius` channel: what counts is the distance, not its square."""
    x = np.array([[0.0, 0.0], [a, b]])
    at = math.sqrt(a * a + b * b)
    for limit, hit in ((at, 0), (math.nextafter(at, math.inf), 1)):
        world = World(
            SwarmAggregation(collision_distance=limit, sensing_radius=limit), 2, 0
        )
        world.start(RNG(0), x)
        assert world.look().collisions.tolist() == [hit, hit]
        assert world.look().heard.tolist() == [hit, hit]
        assert Radius(limit, include_self=False).links(x).n_links == 2 * hit
