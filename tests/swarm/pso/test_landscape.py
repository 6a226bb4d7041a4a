"""The environment and the agents: what each part of §6.3.2 does on its own."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest
from scipy.optimize import Bounds

from acl_gym.swarm import Field, Inbox, Links, run
from acl_gym.swarm.pso import Landscape, ParticleSwarm, minimize
from acl_gym.swarm.pso.benchmark_functions import sphere
from acl_gym.swarm.pso.landscape import ExplosionError

UNIT = [(-1.0, 1.0)] * 2


def begun(landscape: Landscape, seed: int = 0) -> Landscape:
    """A landscape whose particles are where they begin."""
    landscape.reset(np.random.default_rng(seed))
    return landscape


def test_particles_begin_within_the_bounds_on_their_way_to_another_point() -> None:
    bounds = [(-3, -2), (1, 1), (5, 9)]
    landscape = begun(Landscape(sphere, bounds, n_particles=500))
    assert landscape.x.shape == (500, 6)
    theta, nu = landscape.positions, landscape.velocities
    for points in (theta, theta + 2 * nu):
        assert (points[:, 1] == 1.0).all()
        for k, (low, high) in enumerate(bounds):
            assert low <= points[:, k].min() <= points[:, k].max() <= high
            assert np.ptp(points[:, k]) >= 0.9 * (high - low)
    assert abs(np.corrcoef(theta[:, 0], (theta + 2 * nu)[:, 0])[0, 1]) < 0.2
    slow = begun(Landscape(sphere, bounds, n_particles=500, velocity_limit=0.25))
    assert np.array_equal(slow.velocities, np.clip(nu, -0.25, 0.25))


def test_scipy_bounds_are_bounds() -> None:
    pairs = Landscape(sphere, [(0, 1), (0, 2)])
    scipys = Landscape(sphere, Bounds(0, [1, 2]))
    assert np.array_equal(scipys.space.lower, pairs.space.lower)
    assert np.array_equal(scipys.space.upper, pairs.space.upper)


def test_the_first_particles_begin_where_they_are_told() -> None:
    points = [[0.5, -0.5], [0.25, 1.0]]
    for x0, m in ((points[0], 1), (points, 2)):
        landscape = begun(Landscape(sphere, UNIT, n_particles=4, x0=x0))
        assert np.array_equal(landscape.positions[:m], np.atleast_2d(x0))
        assert (np.abs(landscape.positions) <= 1).all()
    free = [(-math.inf, math.inf)] * 2
    landscape = begun(Landscape(sphere, free, n_particles=2, x0=points))
    assert landscape.positions.tolist() == points
    assert not landscape.velocities.any()


def test_observations_are_values_and_positions_and_nobody_shares_arrays() -> None:
    seen = []

    def function(points: np.ndarray) -> np.ndarray:
        seen.append(points)
        values = sphere(points)
        points[:] = 9.0  # its own copy
        return values

    landscape = begun(Landscape(function, UNIT, n_particles=3))
    before = landscape.x.copy()
    first, second = landscape.observe(), landscape.observe()
    assert np.array_equal(landscape.x, before)
    assert np.array_equal(first["value"], sphere(landscape.positions))
    assert np.array_equal(first["position"], landscape.positions)
    arrays = [first["position"], second["position"], landscape.x, *seen]
    assert not any(
        np.shares_memory(a, b) for i, a in enumerate(arrays) for b in arrays[:i]
    )
    assert landscape.objective.evaluations == 6


def test_a_function_may_return_the_same_array_each_time() -> None:
    memory = np.zeros(3)

    def function(points: np.ndarray) -> np.ndarray:
        memory[:] = points[:, 0]
        return memory

    landscape = begun(Landscape(function, UNIT, n_particles=3))
    first = landscape.observe()["value"]
    kept = first.copy()
    memory[:] = 5.0
    assert np.array_equal(first, kept)


@pytest.mark.parametrize("vectorized", [True, False])
def test_nan_counts_as_infinity_with_one_warning(vectorized: bool) -> None:
    def function(points: np.ndarray) -> Any:
        return np.where(points[..., 0] > 0, math.nan, points[..., 0])

    landscape = Landscape(function, UNIT, n_particles=50, vectorized=vectorized)
    begun(landscape)
    with pytest.warns(RuntimeWarning, match=r"returned NaN at \[0\.") as caught:
        values = [landscape.observe()["value"] for _ in range(2)]
    assert len(caught) == 1
    for each in values:
        right = landscape.positions[:, 0] > 0
        assert (each[right] == math.inf).all()
        assert np.isfinite(each[~right]).all()


def test_inertia_may_change_with_the_iteration_and_the_particle() -> None:
    for inertia, expected in (
        (lambda k: 0.5 - 0.25 * k, [[0.5, 0.5], [0.125, 0.125]]),
        (lambda k: [1.0, 0.5 - k], [[1.0, 0.5], [1.0, -0.25]]),
        ([1.0, 0.5], [[1.0, 0.5], [1.0, 0.25]]),
    ):
        landscape = Landscape(
            sphere, [(-9, 9)], n_particles=2, x0=[[0.0], [0.0]], inertia=inertia
        )
        begun(landscape)
        landscape.velocities[:] = 1.0
        for row in expected:
            landscape.step(np.zeros((2, 1)), np.random.default_rng(0))
            assert landscape.velocities[:, 0].tolist() == row
        begun(landscape)
        assert landscape.iteration == 0


def test_the_velocity_limit_may_differ_between_variables() -> None:
    landscape = Landscape(sphere, [(-9, 9)] * 2, n_particles=1, velocity_limit=[0.5, 2])
    begun(landscape)
    landscape.step(np.array([[-9.0, 9.0]]), np.random.default_rng(0))
    assert landscape.velocities.tolist() == [[-0.5, 2.0]]


@pytest.mark.parametrize(
    ("boundary", "position", "velocity"),
    [
        ("none", 1.5, 1.0),
        ("clip", 1.0, 1.0),
        ("absorb", 1.0, 0.0),
        ("reflect", 0.5, -1.0),
    ],
)
def test_what_bounds_do_to_position_and_velocity(
    boundary: str, position: float, velocity: float
) -> None:
    landscape = Landscape(
        sphere, UNIT, n_particles=1, x0=[0.5, 0.0], boundary=boundary, inertia=0.0
    )
    begun(landscape)
    landscape.step(np.array([[1.0, 0.25]]), np.random.default_rng(0))
    assert landscape.x.tolist() == [[position, 0.25, velocity, 0.25]]


def test_an_explosion_is_one_clear_error() -> None:
    landscape = Landscape(
        sphere, [(1, 1)], n_particles=3, boundary="none", inertia=100.0
    )
    rng = np.random.default_rng(0)
    landscape.reset(rng)
    landscape.step(np.ones((3, 1)), rng)
    for _ in range(74):
        landscape.step(np.zeros((3, 1)), rng)
    assert 1e148 < np.abs(landscape.positions).max() <= 1e150
    words = r"stay within 1e\+150 .* exploded in iteration 76, first seen at particle 0; use"
    with pytest.raises(ExplosionError, match=words):
        landscape.step(np.zeros((3, 1)), rng)


def test_velocities_explode_where_bounds_hold_positions() -> None:
    landscape = Landscape(
        sphere, [(1, 2)], n_particles=3, boundary="clip", inertia=100.0
    )
    rng = np.random.default_rng(0)
    landscape.reset(rng)
    for _ in range(140):
        landscape.step(np.zeros((3, 1)), rng)
    landscape.velocities[:] = 1e307
    with pytest.raises(ExplosionError, match="velocities finite"):
        landscape.step(np.zeros((3, 1)), rng)


# Agents


def observed(agents: ParticleSwarm, values: list[float], positions: Any) -> None:
    agents.observe(
        {"value": np.array(values), "position": np.array(positions, np.float64)}
    )


def test_the_personal_best_is_over_all_time() -> None:
    """Not over the last two steps, as the formula under (6.3) has it."""
    agents = ParticleSwarm()
    agents.reset(1, np.random.default_rng(0))
    for value, position in ((1.0, 10), (5.0, 50), (4.0, 40)):
        observed(agents, [value], [[position]])
    assert agents.best_values.tolist() == [1.0]
    assert agents.best_positions.tolist() == [[10.0]]
    assert agents.send()["position"].tolist() == [[10.0]]


def test_the_local_best_is_the_best_of_those_heard_now() -> None:
    """c1 = 0 and r2 known: u shows where theta_lbest is."""
    agents = ParticleSwarm(cognitive=0.0, social=1.0)
    agents.reset(3, np.random.default_rng(0))
    observed(agents, [3.0, 2.0, 1.0], [[30], [20], [10]])
    observed(agents, [9.0, 9.0, 9.0], [[0], [0], [0]])

    def local_bests(lists: list[list[int]], seed: int = 7) -> list[float]:
        agents.hear(Inbox(Links.from_lists(lists), agents.send()))
        u = agents.decide(np.random.default_rng(seed))
        r2 = np.random.default_rng(seed).random((3, 2, 1))[:, 1]
        return np.round(u / r2, 9)[:, 0].tolist()

    assert local_bests([[0, 1], [0, 1, 2], [0]]) == [20.0, 10.0, 30.0]
    assert local_bests([[], [], []]) == [30.0, 20.0, 10.0], "their own personal bests"
    assert local_bests([[0], [1], [2]]) == [30.0, 20.0, 10.0]


def test_what_is_worth_nothing_attracts_nobody() -> None:
    """Where no value is finite, a particle's own point is its local best: u = 0."""
    agents = ParticleSwarm()
    agents.reset(2, np.random.default_rng(0))
    observed(agents, [math.inf, math.inf], [[3], [5]])
    agents.hear(Inbox(Links.everyone(2), agents.send()))
    assert not agents.decide(np.random.default_rng(0)).any()


def test_agents_can_be_used_again_with_another_swarm() -> None:
    agents = ParticleSwarm()
    for n, d in ((3, 2), (5, 1), (5, 4)):
        landscape = Landscape(sphere, [(-1, 1)] * d, n_particles=n)
        run(agents, landscape, 3, 0)
        assert agents.best_positions.shape == (n, d)
        fresh = ParticleSwarm()
        run(fresh, Landscape(sphere, [(-1, 1)] * d, n_particles=n), 3, 0)
        assert np.array_equal(agents.best_positions, fresh.best_positions)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"function": 3}, TypeError, "function must be callable"),
        ({"bounds": 3}, ValueError, "bounds must be a pair"),
        ({"bounds": []}, ValueError, "bounds must be"),
        ({"bounds": [(0, 1, 2)]}, ValueError, r"shape \(1, 3\)"),
        ({"bounds": [(0, 1), (2, 1)]}, ValueError, r"lower <= upper.*\(2, 1\).* 1\."),
        ({"bounds": [(0, math.nan)]}, ValueError, "neither of them NaN"),
        ({"bounds": [(math.inf, math.inf)]}, ValueError, "lower <= upper"),
        ({"bounds": [(-1e308, 1e308)]}, ValueError, r"finite within 1e\+150"),
        ({"bounds": [(0, 1e151)]}, ValueError, r"finite within 1e\+150"),
        (
            {"bounds": [(0, math.inf)], "x0": np.full((40, 1), 1e151)},
            ValueError,
            r"x0 must lie within 1e\+150",
        ),
        ({"bounds": [(0, math.inf)]}, ValueError, "finite where positions are drawn"),
        (
            {"bounds": [(0, math.inf)], "x0": [3.0]},
            ValueError,
            r"x0 as an array of 40 points",
        ),
        ({"n_particles": 0}, ValueError, "n_particles must be at least 1"),
        ({"n_particles": 2.5}, TypeError, "n_particles must be an integer"),
        ({"n_particles": 10**14}, ValueError, "use fewer particles"),
        ({"x0": [0, 0, 0]}, ValueError, r"a point of 2 variables.*\(3,\)"),
        ({"x0": np.zeros((41, 2))}, ValueError, "at most 40"),
        ({"x0": np.zeros((1, 1, 2))}, ValueError, "x0"),
        ({"x0": [0, 2]}, ValueError, "within the bounds, got 2 for variable 1"),
        ({"x0": [0, math.nan]}, ValueError, "x0 must be an array of finite"),
        ({"inertia": [0.1, 0.2]}, ValueError, "one for each of the 40 particles"),
        ({"inertia": math.inf}, ValueError, "inertia must lie in"),
        ({"inertia": lambda k: "much"}, ValueError, "inertia must be an array"),
        ({"boundary": "bounce"}, ValueError, "boundary must be one of"),
        ({"velocity_limit": 0.0}, ValueError, "velocity_limit must be a number > 0"),
        ({"velocity_limit": [1.0] * 3}, ValueError, "or 2 of them"),
        ({"velocity_limit": math.nan}, ValueError, "velocity_limit must be a number"),
        ({"order": "new"}, ValueError, "order must be one of"),
    ],
)
def test_bad_landscapes_are_refused(
    arguments: dict[str, Any], error: Any, message: str
) -> None:
    with pytest.raises(error, match=message):
        Landscape(**{"function": sphere, "bounds": UNIT, **arguments})


@pytest.mark.parametrize("name", ["cognitive", "social"])
def test_bad_accelerations_are_refused(name: str) -> None:
    for bad in (-0.1, math.nan, math.inf, "much", [[1.0]]):
        with pytest.raises(ValueError, match=name):
            ParticleSwarm(**{name: bad})
    agents = ParticleSwarm(**{name: [1.0, 2.0]})
    with pytest.raises(ValueError, match=f"{name} must be a number, or one for each"):
        agents.reset(3, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("function", "vectorized", "message"),
    [
        (
            lambda x: x,
            True,
            r"shape \(4,\) for an array of 4 points, got shape \(4, 2\)",
        ),
        (lambda x: float(x.sum()), True, r"got shape \(\); reduce over the last axis"),
        (lambda x: ["a"] * 4, True, "4 real numbers for 4 points"),
        (lambda x: x[:, 0] + 1j, True, "4 real numbers"),
        (lambda x: None, True, "vectorized=False if it takes one point"),
        (lambda x: [[1], [2, 3]], True, "4 real numbers"),
        (lambda x: x, False, "one real number for a point"),
        (lambda x: None, False, "leave vectorized=True"),
        (lambda x: 1j, False, "one real number"),
    ],
)
def test_what_functions_may_not_return(
    function: Any, vectorized: bool, message: str
) -> None:
    landscape = Landscape(function, UNIT, n_particles=4, vectorized=vectorized)
    begun(landscape)
    with pytest.raises(ValueError, match=message):
        landscape.observe()


@pytest.mark.parametrize(
    ("function", "vectorized"),
    [
        (lambda x: x[:, 0] > 0, True),
        (lambda x: [1, 2, 3, 4], True),
        (lambda x: np.float32(x[:, 0]), True),
        (lambda x: x[:, 1], True),  # not contiguous
        (lambda x: np.array([[2.0]]), False),
        (lambda x: 7, False),
    ],
)
def test_what_functions_may_return(function: Any, vectorized: bool) -> None:
    landscape = Landscape(function, UNIT, n_particles=4, vectorized=vectorized)
    begun(landscape)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = landscape.observe()["value"]
    assert values.shape == (4,)
    assert values.dtype == np.float64
    assert values.flags.c_contiguous


def test_inputs_of_another_shape_are_refused() -> None:
    landscape = begun(Landscape(sphere, UNIT, n_particles=4))
    with pytest.raises(ValueError, match=r"u must have the shape \(4, 2\).*\(2, 4\)"):
        landscape.step(np.zeros((2, 4)), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("u", "words"),
    [
        ([[1j, 0], [0, 0]], "real numbers"),
        ([["a", "b"], ["c", "d"]], "real numbers"),
        (None, "real numbers"),
        ([[0.0, 0.0], [0.0, math.nan]], "got NaN for particle 1"),
        ([[0.0, 0.0]], "have the shape"),
    ],
)
def test_inputs_that_are_no_numbers_are_refused(u: Any, words: str) -> None:
    landscape = begun(Landscape(sphere, UNIT, n_particles=2))
    with pytest.raises(ValueError, match=f"u must .*{words}"):
        landscape.step(u, np.random.default_rng(0))
    before = landscape.positions.copy()
    landscape.velocities[:] = 0.0
    landscape.step([[0, 0], [0, 0]], np.random.default_rng(0))
    assert np.array_equal(landscape.positions, before)


def test_some_particles_move_by_as_many_inputs_only() -> None:
    landscape = begun(Landscape(sphere, UNIT, n_particles=4))
    for u in (np.ones((3_000_000, 3)), np.ones((2, 2)), np.ones((1, 3))):
        with pytest.raises(ValueError, match=r"u must have the shape \(1, 2\)"):
            landscape.move(slice(0, 1), u)
    landscape.x = landscape.x[:, :3]
    with pytest.raises(ValueError, match="x must be a float64 array of shape"):
        landscape.move(slice(0, 1), np.ones((1, 2)))


# What is wrong is found before compiled code sees it.

GOOD = {"value": np.zeros(2), "position": np.zeros((2, 3))}


@pytest.mark.parametrize(
    ("y", "error", "words"),
    [
        (3, TypeError, "a dict with 'value' and 'position'.*got 3"),
        ({"position": np.zeros((2, 3))}, ValueError, r"got \['position'\]; use a Land"),
        (
            {**GOOD, "value": np.zeros(5_000_000)},
            ValueError,
            r"got shapes \(5000000,\)",
        ),
        ({**GOOD, "position": np.zeros((3, 3))}, ValueError, "got shapes"),
        ({**GOOD, "position": np.zeros((2, 0))}, ValueError, "got shapes"),
        ({**GOOD, "position": np.zeros(2)}, ValueError, "got shapes"),
        ({**GOOD, "value": ["a", "b"]}, ValueError, "'value' must be real numbers"),
        ({**GOOD, "value": 1.0}, ValueError, "'value' must be real numbers"),
    ],
)
def test_observations_are_checked(y: Any, error: Any, words: str) -> None:
    agents = ParticleSwarm()
    agents.reset(2, np.random.default_rng(0))
    with pytest.raises(error, match=words):
        agents.remember(slice(None), y)
    with pytest.raises(error, match=words):
        agents.observe(y)
    agents.observe({"value": [1, 2], "position": [[1, 2, 3], [4, 5, 6]]})
    assert agents.best_positions.tolist() == [[1, 2, 3], [4, 5, 6]]
    with pytest.raises(error, match=words):
        agents.remember(slice(None), y)
    with pytest.raises(error, match=words):
        agents.observe(y)
    with pytest.raises(ValueError, match="got shapes"):
        agents.observe({**GOOD, "position": np.zeros((2, 4))})


def test_nothing_is_remembered_before_the_first_observation() -> None:
    agents = ParticleSwarm()
    agents.reset(2, np.random.default_rng(0))
    with pytest.raises(ValueError, match="got shapes"):
        agents.remember(slice(None), GOOD)


def test_a_swarm_in_an_environment_of_another_kind() -> None:
    with pytest.raises(ValueError, match="use a Landscape as environment"):
        run(ParticleSwarm(), Field(3), 3, 0)


def test_messages_are_checked() -> None:
    agents = ParticleSwarm()
    agents.reset(2, np.random.default_rng(0))
    agents.observe(GOOD)
    for links, position in (
        (Links.everyone(2), np.zeros((2, 2))),
        (Links.everyone(3), np.zeros((3, 3))),
    ):
        inbox = Inbox(links, {"value": np.zeros(links.n), "position": position})
        with pytest.raises(
            ValueError, match=r"'position' must have the shape \(2, 3\)"
        ):
            agents.hear(inbox)
    with pytest.raises(ValueError, match="there must be a message 'position'"):
        agents.hear(Inbox(Links.everyone(2), {"value": np.zeros(2)}))
    words = r"must have the shape \(2, 3\)"
    with pytest.raises(ValueError, match=words):
        agents.attract(
            slice(None), np.zeros((2, 2)), np.zeros((2, 2, 3)), np.zeros((2, 3))
        )


def of_one(x: np.ndarray) -> Any:
    """A function of one point, where a function of many is expected."""
    return sum((x[k] - 0.5) ** 2 for k in range(3))


def test_a_function_of_one_point_is_found_out() -> None:
    """Also where there are as many particles as variables."""
    for n in (2, 3, 4):
        landscape = begun(Landscape(of_one, UNIT[:1] * 3, n_particles=max(n, 3)))
        with pytest.raises(ValueError, match=r"shape .*vectorized=False"):
            landscape.observe()


def test_a_function_of_many_points_sees_one_more_once() -> None:
    shapes = []

    def function(points: np.ndarray) -> np.ndarray:
        shapes.append(points.shape)
        return sphere(points)

    landscape = begun(Landscape(function, UNIT, n_particles=2))
    for _ in range(2):
        assert np.array_equal(landscape.observe()["value"], sphere(landscape.positions))
    assert shapes == [(3, 2), (2, 2)]
    assert landscape.objective.evaluations == 4


def test_the_warning_of_nan_names_the_line_of_the_caller() -> None:
    def function(points: np.ndarray) -> np.ndarray:
        return np.full(len(points), math.nan)

    for search in (
        lambda: run(ParticleSwarm(), Landscape(function, UNIT), 1, 0),
        lambda: minimize(function, UNIT, max_iterations=1),
    ):
        with pytest.warns(RuntimeWarning, match="returned NaN") as caught:
            search()
        assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "change",
    [
        lambda x: x.astype(int),
        lambda x: x.tolist(),
        lambda x: np.broadcast_to(0.0, x.shape),
        lambda x: x.astype(">f8"),
        lambda x: None,
    ],
)
def test_states_that_no_kernel_could_move(change: Any) -> None:
    landscape = begun(Landscape(sphere, UNIT, n_particles=3))
    landscape.x = change(landscape.x)
    with pytest.raises(ValueError, match="x must be a float64 array of shape"):
        landscape.step(np.zeros((3, 2)), np.random.default_rng(0))
