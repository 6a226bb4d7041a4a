"""What is known exactly of aggregating swarms, and that this one does it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from acl_gym.swarm import (
    Delayed,
    Everyone,
    Inbox,
    Links,
    Lossy,
    Nearest,
    Radius,
    Ring,
    run,
)
from acl_gym.swarm.aggregation import (
    AggregatingAgents,
    BoundedRepulsion,
    Field,
    Obstacles,
    PointMass,
    Profile,
    Quadratic,
    UnboundedRepulsion,
    bounds,
    centre,
    flow,
    forces_within,
    nearest_distances,
    rms_bound,
    rms_distance,
    size,
    size_bound,
    sum_of_squares,
)

DELTA = math.sqrt(0.2 * math.log(20.0))  # of a = 1, b = 20, c = 0.2
STARTS = {
    2: [[0.0, 0.0], [1.5, 0.2]],
    3: [[0.0, 0.0], [1.5, 0.2], [0.3, 1.0]],
}


def pair_distances(x: np.ndarray) -> np.ndarray:
    i, j = np.triu_indices(len(x), 1)
    return np.linalg.norm(x[i] - x[j], axis=1)


def rested(field: Field, channel: Any = None, steps: int = 4_000) -> np.ndarray:
    """The positions of a swarm that has come to rest."""
    run(AggregatingAgents(), field, steps, 0, channel)
    return field.positions


@pytest.mark.parametrize("n", STARTS)
@pytest.mark.parametrize("body", [None, PointMass(mass=0.5, damping=2.0)])
def test_two_and_three_agents_rest_at_delta(n: int, body: Any) -> None:
    x = rested(Field(STARTS[n], body, time_step=0.01))
    np.testing.assert_allclose(pair_distances(x), DELTA, rtol=0, atol=1e-10)
    assert round(DELTA, 4) == 0.7740


@pytest.mark.parametrize("n", STARTS)
def test_they_rest_at_delta_of_the_unbounded_repulsion(n: int) -> None:
    law = UnboundedRepulsion(attraction=2.0, repulsion=1.5)
    field = Field(STARTS[n], time_step=0.01)
    run(AggregatingAgents(law), field, 4_000, 0)
    wanted = math.sqrt(0.75)
    np.testing.assert_allclose(
        pair_distances(field.positions), wanted, rtol=0, atol=1e-10
    )


@pytest.mark.parametrize("n", [2, 3, 7, 20, 40])
def test_a_resting_swarm_is_within_its_bounds(n: int) -> None:
    x = rested(Field(n, time_step=min(0.01, 0.1 / n), bounds=(-2, 2)), steps=10_000)
    assert np.abs(forces_within(x, BoundedRepulsion())).max() < 1e-3
    assert size(x) < size_bound(n, 1.0, 20.0, 0.2)
    assert rms_distance(x) < rms_bound(n, 1.0, 20.0, 0.2)
    assert size_bound(n, 1.0, 20.0, 0.2) == pytest.approx(
        20.0 * math.sqrt(0.1) * math.exp(-0.5) * (n - 1) / n
    )
    assert rms_bound(n, 1.0, 20.0, 0.2) == pytest.approx(
        math.sqrt((n - 1) * 20.0 * 0.2 / (2.0 * math.e * n))
    )


def test_two_agents_rest_at_the_size_that_the_bound_is_about() -> None:
    """For b / a = sqrt(e) two agents rest at r^2 = c / 2, where r exp(-r^2 / c) is
    largest: no smaller bound would hold."""
    law = BoundedRepulsion(attraction=1.0, repulsion=math.exp(0.5), spread=0.2)
    field = Field(STARTS[2], time_step=0.05)
    run(AggregatingAgents(law), field, 3_000, 0)
    bound = size_bound(2, 1.0, math.exp(0.5), 0.2)
    assert size(field.positions) == pytest.approx(float(bound), abs=1e-10)


@pytest.mark.parametrize("n", [2, 5, 12])
def test_the_sum_of_squares_obeys_its_law(n: int) -> None:
    a, b = 0.8, 0.6
    start = np.random.default_rng(n).normal(size=(n, 2))
    times = np.linspace(0.0, 3.0 / (2 * a * n), 9)
    law = UnboundedRepulsion(attraction=a, repulsion=b)
    moved = flow(start, law, times, tolerance=1e-11)
    found = [sum_of_squares(x) for x in moved]
    end = b * (n - 1) / (2 * a)
    wanted = end + (found[0] - end) * np.exp(-2 * a * n * times)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        bounds.sum_of_squares(times, found[0], n, a, b), wanted, rtol=1e-14
    )
    assert bounds.resting_sum_of_squares(n, a, b) == pytest.approx(end)


def test_a_swarm_in_steps_comes_to_the_same_sum_of_squares() -> None:
    field = Field(30, time_step=2e-4)
    run(AggregatingAgents(UnboundedRepulsion(repulsion=0.6)), field, 20_000, 0)
    end = float(bounds.resting_sum_of_squares(30, 1.0, 0.6))
    assert sum_of_squares(field.positions) == pytest.approx(end, abs=1e-6)


def test_small_steps_tend_to_the_flow() -> None:
    start = np.random.default_rng(1).normal(size=(6, 2))
    exact = flow(start, BoundedRepulsion(), [0.4])[0]
    errors = []
    for steps in (200, 400, 800):
        field = Field(start, time_step=0.4 / steps)
        run(AggregatingAgents(), field, steps)
        errors.append(np.abs(field.positions - exact).max())
    # Of first order: half the step, half the error.
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.1)


# --- the centre ------------------------------------------------------------------------

SYMMETRIC = [
    Everyone(),
    Everyone(include_self=False),
    Ring(2),
    Radius(1.3),
    Lossy(Everyone(), 0.4, symmetric=True),
    Lossy(Radius(1.3), 0.4, symmetric=True),
]
ASYMMETRIC = [
    Nearest(5),
    Radius(np.linspace(0.6, 1.6, 20)),
    Lossy(Everyone(), 0.3),
    Delayed(Everyone(), 1),
]


def drift(channel: Any, stale: bool = False, law: Any = None, seed: int = 1) -> float:
    """How far the centre of a swarm has moved from where it was, at most."""
    field = Field(20, time_step=0.01)
    agents = AggregatingAgents(law)
    history = run(agents, field, 500, seed, channel, stale=stale, record=("x",))
    centres = history["x"].mean(axis=1)
    return float(np.abs(centres - centres[0]).max())


@pytest.mark.parametrize("channel", SYMMETRIC, ids=repr)
def test_symmetric_links_keep_the_centre(channel: Any) -> None:
    assert drift(channel) < 1e-12


@pytest.mark.parametrize("channel", ASYMMETRIC, ids=repr)
def test_other_links_do_not(channel: Any) -> None:
    assert drift(channel) > 1e-3


def test_messages_that_are_a_step_old_move_the_centre() -> None:
    """Definition 6.2 read literally: y = x_i(k) - x_j(k - 1) is not odd in i and j."""
    assert drift(Everyone()) < 1e-14
    assert drift(Everyone(), stale=True) > 1e-3
    # The same as a channel that is a step late.
    assert drift(Everyone(), stale=True) == drift(Delayed(Everyone(), 1))


def test_agents_that_differ_do_not_keep_it_either() -> None:
    for law in (
        BoundedRepulsion(attraction=np.linspace(0.9, 1.1, 20)),
        BoundedRepulsion(repulsion=np.linspace(19.0, 21.0, 20)),
        BoundedRepulsion(spread=np.linspace(0.19, 0.21, 20)),
    ):
        assert drift(Everyone(), law=law) > 1e-3
    alike = BoundedRepulsion(attraction=np.ones(20), repulsion=np.full(20, 20.0))
    assert drift(Everyone(), law=alike) == drift(Everyone())


def test_the_centre_in_a_bowl_decays_exponentially() -> None:
    goal, curvature = np.array([2.0, -1.0]), 0.7
    bowl = Quadratic(goal, curvature)
    start = np.random.default_rng(4).normal(size=(9, 2))
    times = np.linspace(0.0, 3.0, 7)
    moved = flow(start, BoundedRepulsion(), times, bowl, tolerance=1e-11)
    away = moved.mean(axis=1) - goal
    wanted = np.exp(-curvature * times)[:, None] * (start.mean(axis=0) - goal)
    np.testing.assert_allclose(away, wanted, rtol=0, atol=1e-9)
    # In steps it decays by 1 - A dt each.
    field = Field(start, profile=bowl, time_step=0.01)
    history = run(AggregatingAgents(), field, 300, record=("x",))
    away = history["x"].mean(axis=1) - goal
    wanted = (1.0 - 0.007) ** np.arange(301)[:, None] * (start.mean(axis=0) - goal)
    np.testing.assert_allclose(away, wanted, rtol=0, atol=1e-12)


# --- in the framework -------------------------------------------------------------------


@pytest.mark.parametrize("channel", [*SYMMETRIC, *ASYMMETRIC], ids=repr)
def test_the_seed_decides_every_bit(channel: Any) -> None:
    runs = []
    for _ in range(2):
        field = Field(20, PointMass(), time_step=0.02)
        history = run(AggregatingAgents(), field, 60, 7, channel, record=("x",))
        runs.append(history["x"].tobytes())
    assert runs[0] == runs[1]


def test_the_links_of_a_radius_and_the_grid_of_cells_move_alike() -> None:
    start = np.random.default_rng(3).uniform(0, 6, (80, 2))
    field = Field(start, time_step=0.005)
    run(AggregatingAgents(), field, 50, channel=Radius(1.5))
    x = start.copy()
    for _ in range(50):
        x += 0.005 * forces_within(x, BoundedRepulsion(), 1.5)
    np.testing.assert_allclose(field.positions, x, rtol=0, atol=1e-11)


def test_within_a_radius_a_swarm_keeps_its_distance() -> None:
    """Where all attract all, many agents are pressed together; neighbours are not."""
    law = BoundedRepulsion()
    crowded = Field(120, time_step=5e-4, bounds=(-2, 2))
    run(AggregatingAgents(law), crowded, 3_000, 0)
    loose = Field(120, time_step=5e-3, bounds=(-2, 2))
    run(AggregatingAgents(law), loose, 3_000, 0, Radius(0.9))
    assert nearest_distances(crowded.positions).mean() < 0.1 * DELTA
    assert nearest_distances(loose.positions).mean() > 0.9 * DELTA


def test_one_agent_stays_and_descends_alone() -> None:
    field = Field([[1.0, 1.0]], time_step=0.1)
    run(AggregatingAgents(), field, 10)
    assert field.positions.tolist() == [[1.0, 1.0]]
    field = Field([[1.0, 1.0]], profile=Quadratic([0.0, 0.0]), time_step=0.1)
    run(AggregatingAgents(), field, 10, channel=Radius(1.0))
    np.testing.assert_allclose(field.positions, np.full((1, 2), 0.9**10))


def test_a_swarm_goes_around_an_obstacle_to_its_food() -> None:
    rock = Obstacles([[0.0, 0.1]], 0.8, strength=40.0, reach=0.4)
    start = np.random.default_rng(2).uniform(-3.5, -2.0, (15, 2)) * [1.0, 0.3]
    field = Field(
        start, obstacles=rock, profile=Quadratic([3.0, 0.0], 1.5), time_step=0.01
    )
    for _ in range(3):
        run(AggregatingAgents(), field, 600, 0, Radius(2.0))
        assert not rock.inside(field.positions).any()
    np.testing.assert_allclose(centre(field.positions), [3.0, 0.0], atol=0.1)


def test_agents_take_positions_alone_from_an_environment_of_ones_own() -> None:
    agents = AggregatingAgents()
    agents.reset(2, np.random.default_rng(0))
    x = np.array([[0.0, 0.0], [1.0, 0.0]])
    agents.observe(x)
    from acl_gym.swarm import Inbox

    agents.hear(Inbox(Links.everyone(2), agents.send()))
    u = agents.decide(np.random.default_rng(0))
    g = BoundedRepulsion()(x[0] - x[1])
    np.testing.assert_allclose(u, [g, -g], rtol=1e-14)


def test_agents_for_another_number_are_refused_before_they_move() -> None:
    agents = AggregatingAgents(BoundedRepulsion(spread=[0.1, 0.2]))
    with pytest.raises(ValueError, match="spread must be a number or have one value"):
        run(agents, Field(3), 1, 0)
    with pytest.raises(TypeError, match="must be an Interaction"):
        AggregatingAgents(20.0)  # type: ignore[arg-type]


def test_a_swarm_that_bursts_is_stopped_with_a_reason() -> None:
    touching = [[0.0, 0.0], [1e-160, 0.0]]
    field = Field(touching, time_step=0.1)
    with pytest.raises(ValueError, match="too close for b / r\\^2"):
        run(AggregatingAgents(UnboundedRepulsion()), field, 3)
    # A step that is too large for the attraction: a dt M > 2.
    field = Field(20, time_step=0.2)
    with pytest.raises(ValueError, match="positions must be numbers of at most"):
        run(AggregatingAgents(), field, 1_000, 0)


# --- measures, bounds and flow -----------------------------------------------------------


def test_measures() -> None:
    x = np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 3.0]])
    assert centre(x).tolist() == [2.0, 1.0]
    assert size(x) == math.sqrt(5.0)
    assert sum_of_squares(x) == pytest.approx(5.0 + 5.0 + 4.0)
    assert rms_distance(x) == pytest.approx(math.sqrt(14.0 / 3.0))
    np.testing.assert_allclose(
        nearest_distances(x), [math.sqrt(13.0), math.sqrt(13.0), math.sqrt(13.0)]
    )
    assert nearest_distances([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]).tolist() == [0, 0, 1]
    assert nearest_distances([[1.0, 1.0]]).tolist() == [math.inf]


def test_bounds_take_arrays_and_refuse_what_is_out_of_range() -> None:
    assert size_bound([1, 2, 4], 1.0, 2.0, 0.5).shape == (3,)
    assert size_bound(1, 1.0, 2.0, 0.5) == 0.0
    with pytest.raises(ValueError, match="n_agents must be >= 1, got 0"):
        rms_bound(0, 1.0, 2.0, 0.5)
    with pytest.raises(ValueError, match="attraction must be > 0, got 0"):
        rms_bound(3, 0.0, 2.0, 0.5)
    with pytest.raises(ValueError, match="time must be >= 0, got -1"):
        bounds.sum_of_squares(-1.0, 1.0, 3, 1.0, 1.0)


def test_the_flow_over_links_is_that_of_pairs_apart() -> None:
    x = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 5.0], [5.0, 6.5]])
    links = Links.from_lists([[1], [0], [3], [2]])
    both = flow(x, BoundedRepulsion(), [0.0, 0.5], links=links)
    np.testing.assert_array_equal(both[0], x)
    for pair in (slice(0, 2), slice(2, 4)):
        alone = flow(x[pair], BoundedRepulsion(), [0.5])[0]
        np.testing.assert_allclose(both[1, pair], alone, atol=1e-8)


def test_the_flow_refuses() -> None:
    x = np.zeros((2, 2))
    for times in ([-1.0], [1.0, 0.5], [math.nan]):
        with pytest.raises(ValueError, match="times must be"):
            flow(x, BoundedRepulsion(), times)
    assert flow(x, BoundedRepulsion(), [0.0, 0.0]).shape == (2, 2, 2)
    with pytest.raises(TypeError, match="interaction must be an Interaction"):
        flow(x, "x", [1.0])
    with pytest.raises(TypeError, match="profile must be of a subclass of Profile"):
        flow(x, BoundedRepulsion(), [1.0], BoundedRepulsion())


def test_a_flow_does_not_run_for_ever() -> None:
    with pytest.raises(ValueError, match=r"1,000 evaluations, got to .* of 1e\+09 s"):
        flow(STARTS[3], BoundedRepulsion(), [1e9], most_evaluations=1_000)
    with pytest.raises(ValueError, match="most_evaluations must be at least 1"):
        flow(STARTS[3], BoundedRepulsion(), [1.0], most_evaluations=0)


def test_observations_without_positions_are_refused() -> None:
    with pytest.raises(ValueError, match="observations must have a 'position'"):
        AggregatingAgents().observe({"value": np.zeros(3)})


def test_arrays_that_do_not_fit_each_other() -> None:
    law = BoundedRepulsion(spread=[0.1, 0.2])
    other = UnboundedRepulsion(attraction=[0.1, 0.2])
    for call in (
        law.net_attraction,
        law.potential,
        other.potential,
        other.net_attraction,
    ):
        with pytest.raises(
            ValueError, match=r"distance must be a number or have shape"
        ):
            call([1.0, 2.0, 3.0])
    assert law.potential([[1.0], [2.0], [3.0]]).shape == (3, 2)
    for call in (
        lambda: size_bound([1, 2, 3], [1, 2], 1, 1),
        lambda: rms_bound(3, [1, 2], 1, [1, 2, 3]),
        lambda: bounds.sum_of_squares([1, 2], 1.0, 3, [1, 1, 1], 1),
        lambda: bounds.sum_of_squares([1, 2], 1.0, 3, 1, [1, 1, 1]),
    ):
        with pytest.raises(ValueError, match="must be numbers or arrays of one shape"):
            call()


class Sloped(Profile):
    """A profile whose gradient a test gives."""

    def __init__(self, gradient: Any) -> None:
        self._gradient = gradient

    def value(self, positions: Any) -> Any:
        return np.zeros(len(positions))

    def gradient(self, positions: Any) -> Any:
        return self._gradient(positions)


@pytest.mark.parametrize(
    ("gradient", "message"),
    [
        (lambda x: None, "the gradient of Sloped must be real numbers of the shape"),
        (lambda x: [1.0, 0.0], "the gradient of Sloped must be real numbers"),
        (lambda x: [[1.0], [2.0, 3.0]], "the gradient of Sloped must be real numbers"),
        (lambda x: x.astype(complex), "the gradient of Sloped must be real numbers"),
        (lambda x: x * math.nan, "the gradient of Sloped must be finite, got"),
    ],
)
def test_gradients_of_a_users_profile_are_checked(gradient: Any, message: str) -> None:
    x = [[0.0, 0.0], [1.0, 0.0]]
    with pytest.raises(ValueError, match=message):
        flow(x, BoundedRepulsion(), [0.1], Sloped(gradient))


def spoil(positions: np.ndarray) -> np.ndarray:
    positions[:] = 7.0
    return np.zeros_like(positions)


def test_a_profile_that_changes_its_argument_moves_nobody() -> None:
    x = np.array([[0.0, 0.0], [1.0, 0.0]])
    without = flow(x, BoundedRepulsion(), [0.1])
    np.testing.assert_array_equal(
        flow(x, BoundedRepulsion(), [0.1], Sloped(spoil)), without
    )
    field = Field(x, profile=Sloped(spoil))
    field.reset(np.random.default_rng(0))
    field.observe()
    np.testing.assert_array_equal(field.positions, x)


def test_equal_times_have_equal_positions() -> None:
    x = [[0.0, 0.0], [1.0, 0.0]]
    once = flow(x, BoundedRepulsion(), [0.0, 0.1])
    twice = flow(x, BoundedRepulsion(), [0.0, 0.0, 0.1, 0.1])
    np.testing.assert_array_equal(twice, once[[0, 0, 1, 1]])


def test_nothing_drives_agents_in_one_place_apart() -> None:
    """b / r^2 has no direction there, and its flow no solution that would last."""
    x = np.array([[0.0, 1.0], [2.0, 1.0], [-0.0, 1.0]])
    apart = Links.from_lists([[1], [0, 2], [1]])
    near = Links.from_lists([[], [], [0]])
    only_the_first = UnboundedRepulsion(repulsion=[0.6, 0.0, 0.0])
    only_the_second = UnboundedRepulsion(repulsion=[0.0, 0.6, 0.0])
    for links, law in (
        (None, UnboundedRepulsion()),
        (Links.everyone(3, include_self=False), only_the_first),
        (near, UnboundedRepulsion()),
    ):
        with pytest.raises(ValueError, match="drives apart must differ"):
            flow(x, law, [0.1], links=links)
    for links, law in (
        (apart, UnboundedRepulsion()),
        (None, UnboundedRepulsion(repulsion=0.0)),
        (None, only_the_second),
        (None, BoundedRepulsion()),
    ):
        assert np.isfinite(flow(x, law, [0.1], links=links)).all()


class Deaf(Everyone):
    """A channel that drops the message that agents need."""

    def deliver(self, sent: Any, x: Any, rng: Any) -> Inbox:
        return Inbox(self.links(x), {})


def test_a_channel_that_drops_a_message() -> None:
    with pytest.raises(ValueError, match="there must be a message 'position', got"):
        run(AggregatingAgents(), Field(3), 1, 0, Deaf())


@pytest.mark.parametrize("tolerance", [0.0, 1e-300, 5e-324, 2.0, 1e308, math.nan])
def test_tolerances_that_no_solver_can_keep(tolerance: float) -> None:
    with pytest.raises(ValueError, match=r"tolerance must lie in \[1e-15, 1\]"):
        flow([[0.0], [1.0]], BoundedRepulsion(), [0.1], tolerance=tolerance)


@pytest.mark.parametrize("a", [1e-300, 1.0, 1e300])
@pytest.mark.parametrize("b", [0.0, 1e-300, 1e300])
@pytest.mark.parametrize("c", [1e-300, 1e300])
def test_bounds_of_extreme_parameters_are_numbers(a: float, b: float, c: float) -> None:
    for m in (1, 2, 10**6):
        found = size_bound(m, a, b, c), rms_bound(m, a, b, c)
        assert all(each >= 0.0 for each in found)
        assert bounds.resting_sum_of_squares(m, a, b) >= 0.0
        if m == 1 or b == 0.0:
            assert found == (0.0, 0.0)
