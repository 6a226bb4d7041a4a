"""`minimize` against a swarm written from the equations, against `run`, and its ends."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import OptimizeResult

from acl_gym.swarm import (
    Channel,
    Delayed,
    Everyone,
    Inbox,
    Links,
    Lossy,
    Nearest,
    Radius,
    Ring,
    VonNeumann,
    run,
)
from acl_gym.swarm.pso import (
    Landscape,
    ParticleSwarm,
    minimize,
)
from acl_gym.swarm.pso.benchmark_functions import BENCHMARK_FUNCTIONS, rastrigin, sphere
from acl_gym.swarm.pso.landscape import ExplosionError
from tests.swarm.pso import reference


def bumpy(points: np.ndarray) -> np.ndarray:
    """With exactly rounded operations only, so that rows and points have the same bits;
    minimum away from the middle."""
    shifted = points - 0.3
    total = np.zeros(points.shape[:-1])
    for k in range(points.shape[-1]):
        each = shifted[..., k]
        total = total + each * each + np.abs(each * 4.0 - np.round(each * 4.0))
    return total


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 6),
    st.integers(1, 4),
    st.sampled_from(["reflect", "absorb", "clip", "none"]),
    st.sampled_from(["standard", "literal"]),
    st.booleans(),
    st.booleans(),
)
def test_it_is_the_swarm_of_the_equations(
    seed: int,
    n: int,
    d: int,
    boundary: str,
    order: str,
    asynchronous: bool,
    ring: bool,
) -> None:
    """Synchronous and not, heterogeneous, everyone and a ring; after 15 iterations."""
    parameters = np.random.default_rng(seed)
    w = parameters.uniform(0.3, 0.8, n)
    c1, c2 = parameters.uniform(0.1, 1.5, (2, n))
    lower = parameters.uniform(-2, 0, d)
    upper = lower + parameters.uniform(0, 2, d)
    if ring:
        hears = [sorted({(i - 1) % n, i, (i + 1) % n}) for i in range(n)]
    else:
        hears = [list(range(n))] * n
    point, value, best = reference.swarm(
        bumpy,
        lower,
        upper,
        hears,
        np.random.default_rng(seed),
        15,
        w=w,
        c1=c1,
        c2=c2,
        boundary=boundary,
        order=order,
        asynchronous=asynchronous,
    )
    found = minimize(
        bumpy,
        np.column_stack([lower, upper]),
        n_particles=n,
        max_iterations=15,
        seed=seed,
        inertia=w,
        cognitive=c1,
        social=c2,
        topology="ring" if ring else "global",
        boundary=boundary,
        order=order,
        update="asynchronous" if asynchronous else "synchronous",
        history=True,
    )
    assert found.nfev == 16 * n
    np.testing.assert_allclose(found.history["fun"], best, rtol=1e-9, atol=1e-12)
    assert found.fun == pytest.approx(value, rel=1e-9, abs=1e-12)
    np.testing.assert_allclose(found.x, point, atol=1e-9)


CHANNELS: list[Channel] = [
    Everyone(),
    Everyone(include_self=False),
    Ring(2),
    VonNeumann(),
    Radius(1.5),
    Nearest(3),
    Lossy(Ring(), 0.3),
    Delayed(Everyone(), 4),
]


@pytest.mark.parametrize("channel", CHANNELS, ids=repr)
@pytest.mark.parametrize(
    ("boundary", "order"),
    [
        ("reflect", "standard"),
        ("absorb", "standard"),
        ("clip", "standard"),
        ("none", "standard"),
        ("reflect", "literal"),
        ("none", "literal"),
    ],
)
def test_run_makes_the_same_bits(channel: Channel, boundary: str, order: str) -> None:
    """With every channel, and with an inertia that falls."""

    def inertia(k: int) -> float:
        return 0.9 - 0.01 * k

    bounds = [(-5.0, 5.0)] * 4
    landscape = Landscape(
        rastrigin,
        bounds,
        n_particles=12,
        inertia=inertia,
        boundary=boundary,
        order=order,
    )
    swarm = ParticleSwarm(1.2, 1.7)
    run(swarm, landscape, 31, 8, channel)
    found = minimize(
        rastrigin,
        bounds,
        n_particles=12,
        max_iterations=30,
        seed=8,
        inertia=inertia,
        cognitive=1.2,
        social=1.7,
        topology=channel,
        boundary=boundary,
        order=order,
    )
    best = swarm.best_values.argmin()
    assert found.fun == swarm.best_values[best]
    assert np.array_equal(found.x, swarm.best_positions[best])
    assert found.nfev == landscape.objective.evaluations == 31 * 12


def test_stale_messages_make_another_swarm() -> None:
    """The strict reading of Definition 6.2 in `run`: bests are heard a step late."""
    found = []
    for stale in (False, True):
        swarm = ParticleSwarm()
        landscape = Landscape(sphere, [(-5.0, 5.0)] * 3)
        run(swarm, landscape, 100, 1, stale=stale)
        found.append(swarm.best_values.min())
    assert found[0] != found[1]
    assert max(found) < 1e-6


@pytest.mark.parametrize(
    ("name", "d", "topology", "evaluations", "below"),
    [
        ("sphere", 30, "global", 80_000, 1e-25),
        ("sphere", 30, "ring", 120_000, 1e-20),
        ("rosenbrock", 5, "ring", 120_000, 0.1),
        ("rastrigin", 5, "von_neumann", 40_000, 1e-6),
        ("ackley", 10, "ring", 60_000, 1e-9),
        ("griewank", 30, "ring", 200_000, 0.05),
    ],
)
def test_it_finds_minima(
    name: str, d: int, topology: str, evaluations: int, below: float
) -> None:
    each = BENCHMARK_FUNCTIONS[name]
    for seed in range(3):
        found = minimize(
            each.function,
            each.bounds(d),
            max_evaluations=evaluations,
            seed=seed,
            topology=topology,
        )
        assert found.success
        assert found.fun == each.function(found.x[None])[0] < below


def test_the_literal_order_explodes() -> None:
    """As the theory says, with the usual coefficients; not with small accelerations."""
    found = minimize(
        sphere,
        [(-5, 5)] * 3,
        order="literal",
        boundary="none",
        seed=0,
        max_iterations=10_000,
        history=True,
    )
    assert not found.success
    assert "the swarm has exploded" in found.message
    assert 1e145 < found.history["spread"][-1] < 1e151
    assert found.nit == len(found.history["spread"]) - 1 < 10_000
    assert math.isfinite(found.fun)
    small = minimize(
        sphere,
        [(-5, 5)] * 3,
        order="literal",
        boundary="none",
        cognitive=0.2,
        social=0.2,
        seed=0,
        history=True,
    )
    assert small.success
    assert small.history["spread"][-1] < 1e-3


@pytest.mark.parametrize("channel", CHANNELS, ids=repr)
def test_run_and_minimize_explode_in_the_same_iteration(channel: Channel) -> None:
    """Whether or not the channel looks at positions."""
    found = minimize(
        sphere,
        [(-5, 5)] * 2,
        n_particles=12,
        order="literal",
        boundary="none",
        topology=channel,
        max_iterations=3_000,
        seed=0,
        social=3.0,
    )
    assert "the swarm has exploded" in found.message
    assert not found.success
    landscape = Landscape(
        sphere, [(-5, 5)] * 2, n_particles=12, order="literal", boundary="none"
    )
    with pytest.raises(ExplosionError) as raised:
        run(ParticleSwarm(social=3.0), landscape, 3_000, 0, channel)
    assert landscape.iteration == found.nit + 1
    assert str(raised.value) == found.message
    assert isinstance(raised.value, ValueError)


@pytest.mark.parametrize("update", ["synchronous", "asynchronous"])
def test_an_explosion_names_the_particle(update: str) -> None:
    found = minimize(
        sphere,
        [(-5, 5)] * 2,
        n_particles=6,
        order="literal",
        boundary="none",
        inertia=[0.5, 0.5, 0.5, 1e80, 0.5, 1e80],
        update=update,
        seed=0,
    )
    assert "exploded in iteration 3, first seen at particle 3" in found.message


def test_the_printed_order_does_not_converge_within_bounds() -> None:
    settings: Any = {"max_iterations": 300, "seed": 0, "history": True}
    bounds = [(-100, 100)] * 30
    printed = minimize(sphere, bounds, order="literal", **settings)
    usual = minimize(sphere, bounds, **settings)
    assert printed.nit == 300
    assert printed.history["spread"][-1] > 0.5 * printed.history["spread"][0]
    assert usual.history["spread"][-1] < 0.1 * usual.history["spread"][0]


def test_a_step_of_a_run_less_one_is_an_iteration() -> None:
    found = minimize(sphere, [(-5, 5)] * 2, max_iterations=6, seed=0)
    landscape, swarm = Landscape(sphere, [(-5, 5)] * 2), ParticleSwarm()
    run(swarm, landscape, 7, 0, VonNeumann())
    assert swarm.best_values.min() == found.fun
    assert landscape.objective.evaluations == found.nfev == 7 * 40


def test_one_particle_has_nobody_to_agree_with() -> None:
    message = "n_particles must be at least 2 with a tolerance, got 1"
    with pytest.raises(ValueError, match=message):
        minimize(sphere, [(-5, 5)], n_particles=1, tolerance=1e-3)


@pytest.mark.parametrize("update", ["synchronous", "asynchronous"])
def test_a_channel_of_ones_own_is_checked(update: str) -> None:
    class Own(Channel):
        def deliver(self, sent: Any, x: Any, rng: Any) -> Any:
            n = 3_000_000
            values = {"value": np.zeros(n), "position": np.zeros((n, 1))}
            return Inbox(Links.everyone(n), values)

    class Nothing(Channel):
        def deliver(self, sent: Any, x: Any, rng: Any) -> Any:
            return None

    with pytest.raises(ValueError, match=r"the 40 agents .* got links of 3000000"):
        quickly(topology=Own(), update=update)
    with pytest.raises(TypeError, match=r"Nothing.deliver must return an Inbox"):
        quickly(topology=Nothing(), update=update)


@pytest.mark.parametrize("update", ["synchronous", "asynchronous"])
def test_the_same_seed_gives_the_same_bits(update: str) -> None:
    arguments: Any = {
        "function": rastrigin,
        "bounds": [(-5, 5)] * 3,
        "max_iterations": 40,
        "topology": Lossy(Ring(), 0.2),
        "update": update,
    }
    first, again = (minimize(**arguments, seed=3) for _ in range(2))
    other = minimize(**arguments, seed=4)
    generator = minimize(**arguments, seed=np.random.default_rng(3))
    assert np.array_equal(first.x, again.x)
    assert np.array_equal(first.x, generator.x)
    assert not np.array_equal(first.x, other.x)


def test_one_point_at_a_time_is_the_same_search() -> None:
    arguments: Any = {"bounds": [(-5, 5)] * 3, "max_iterations": 30, "seed": 3}
    rows = minimize(bumpy, **arguments)
    points = minimize(lambda x: float(bumpy(x)), vectorized=False, **arguments)
    assert rows.nfev == points.nfev
    assert np.array_equal(rows.x, points.x)


def test_an_asynchronous_swarm_calls_with_one_point_at_a_time() -> None:
    shapes = []

    def function(points: np.ndarray) -> np.ndarray:
        shapes.append(points.shape)
        return sphere(points)

    found = minimize(
        function, [(-5, 5)] * 3, target=1e-8, seed=0, update="asynchronous"
    )
    assert found.success
    assert shapes[0] == (40, 3)
    assert set(shapes[1:]) == {(1, 3)}
    assert len(shapes) == found.nfev - 39


# How it ends


def quickly(**changes: Any) -> OptimizeResult:
    arguments = {"function": sphere, "bounds": [(-5, 5)] * 2, "seed": 0, **changes}
    return minimize(**arguments)


def test_iterations_and_evaluations_are_limits() -> None:
    assert quickly().nit == 1_000
    assert quickly(max_iterations=0).nfev == 40
    for most, nfev in ((40, 40), (79, 40), (80, 80), (1_000, 1_000)):
        found = quickly(max_evaluations=most)
        assert (found.nfev, found.nit) == (nfev, nfev // 40 - 1)
        assert found.success
    found = quickly(max_iterations=7, max_evaluations=10_000)
    assert found.nit == 7
    assert found.message == "All 7 iterations were made."


def test_it_ends_at_the_target() -> None:
    found = quickly(target=1e-3)
    assert found.success
    assert found.fun <= 1e-3
    assert found.nit < 100
    assert found.message == "The target was reached."
    never = quickly(target=-1.0, max_iterations=5)
    assert not never.success
    assert never.nit == 5
    assert quickly(target=100.0).nit == 0


def test_it_ends_when_the_swarm_agrees() -> None:
    values: list[float] = []

    def function(points: np.ndarray) -> np.ndarray:
        found = sphere(points)
        values.extend(found)
        return found

    found = quickly(function=function, tolerance=1e-6)
    assert found.success
    assert found.message == "All personal bests lie within the tolerance."
    bests = np.minimum.accumulate(np.reshape(values, (-1, 40)), axis=0)
    ranges = np.ptp(bests, axis=1)
    assert ranges[-1] <= 1e-6 < ranges[:-1].min()
    flat = quickly(function=lambda x: np.full(len(x), math.inf), tolerance=1.0)
    assert flat.nit == 1_000, "infinite values agree about nothing"
    deep = quickly(function=lambda x: np.full(len(x), -math.inf), tolerance=1.0)
    assert deep.nit == 1_000
    assert "got -inf" in deep.message


def test_the_callback_sees_each_iteration_and_may_end_the_search() -> None:
    seen: list[OptimizeResult] = []
    quickly(callback=seen.append, max_iterations=5)
    assert [each.nit for each in seen] == [1, 2, 3, 4, 5]
    assert [each.nfev for each in seen] == [80, 120, 160, 200, 240]
    assert all(b.fun <= a.fun for a, b in itertools.pairwise(seen))
    assert all(each.fun == sphere(each.x[None])[0] for each in seen)

    def stop(result: OptimizeResult) -> bool:
        return bool(result.nit == 3)

    def raise_stop(result: OptimizeResult) -> None:
        if result.nit == 3:
            raise StopIteration

    def stop_by_numpy(result: OptimizeResult) -> Any:
        return np.bool_(result.nit == 3)

    for callback in (stop, stop_by_numpy, raise_stop):
        found = quickly(callback=callback)
        assert found.nit == 3
        assert found.success
        assert found.message == "The callback has ended the search."


def test_the_history() -> None:
    found = quickly(max_iterations=30, history=True)
    history = found.history
    assert history["nfev"].tolist() == list(range(40, 1241, 40))
    assert history["fun"][-1] == found.fun
    assert (np.diff(history["fun"]) <= 0).all()
    assert history["spread"][0] == pytest.approx(math.sqrt(2 * 100 / 12), rel=0.2)
    assert history["spread"][-1] < 0.5 * history["spread"][0]
    last = quickly(max_iterations=3, n_particles=1, x0=[3.0, 4.0], history=True)
    assert last.history["spread"].tolist() == [0.0] * 4
    assert "history" not in quickly()


# Odd cases


def test_one_particle_searches_alone() -> None:
    """Its own best is all that attracts it, in any topology."""
    for topology in ("global", "ring", "von_neumann", Radius(1.0)):
        found = quickly(
            n_particles=1, topology=topology, max_iterations=20, history=True
        )
        assert found.nfev == 21
        assert found.success
        assert found.fun < found.history["fun"][0]


def test_fixed_variables_stay_and_the_others_are_optimized() -> None:
    for boundary in ("reflect", "absorb", "clip", "none"):
        found = quickly(bounds=[(1.5, 1.5), (-5, 5)], boundary=boundary)
        assert found.x[0] == 1.5
        assert abs(found.x[1]) < 1e-6
    alone = quickly(bounds=[(2, 2)], max_iterations=5)
    assert alone.x.tolist() == [2.0]
    assert alone.fun == 4.0


def test_without_bounds_it_goes_where_the_minimum_is() -> None:
    x0 = np.random.default_rng(0).normal(size=(40, 2))
    found = quickly(
        function=lambda x: sphere(x - 100.0), bounds=[(-math.inf, math.inf)] * 2, x0=x0
    )
    np.testing.assert_allclose(found.x, 100.0, atol=1e-6)


def test_infinity_is_worse_than_all() -> None:
    """A feasible region of a sixteenth of the square."""

    def function(points: np.ndarray) -> np.ndarray:
        inside = (points > 2.5).all(axis=1)
        return np.where(inside, sphere(points - 3.0), math.inf)

    found = quickly(function=function, topology="global")
    np.testing.assert_allclose(found.x, 3.0, atol=1e-6)


def test_where_no_value_is_finite_there_is_no_success() -> None:
    found = quickly(function=lambda x: np.full(len(x), math.inf), max_iterations=3)
    assert not found.success
    assert found.fun == math.inf
    assert "must be finite at some point, got inf or NaN at all" in found.message
    assert ((found.x >= -5) & (found.x <= 5)).all()
    unbounded = quickly(function=lambda x: np.full(len(x), -math.inf), max_iterations=3)
    assert not unbounded.success
    assert unbounded.fun == -math.inf


def test_nan_is_worse_than_all_and_warns_once() -> None:
    def function(points: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return sphere(points) + np.sqrt(points[:, 0])

    with pytest.warns(RuntimeWarning, match="NaN counts as infinity") as caught:
        found = quickly(function=function)
    assert len(caught) == 1
    assert found.success
    assert found.fun < 1e-4


def test_errors_of_the_function_are_its_own() -> None:
    calls = []

    def function(points: np.ndarray) -> np.ndarray:
        calls.append(points)
        if len(calls) == 3:
            raise OverflowError("mine")
        return sphere(points)

    with pytest.raises(OverflowError, match="mine"):
        quickly(function=function)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"max_iterations": -1}, ValueError, "max_iterations must be at least 0"),
        ({"max_iterations": 1.5}, TypeError, "max_iterations must be an integer"),
        (
            {"max_evaluations": 39},
            ValueError,
            "max_evaluations must be at least n_part",
        ),
        ({"target": math.nan}, ValueError, "target must lie in"),
        ({"tolerance": -1.0}, ValueError, "tolerance must lie in"),
        ({"seed": -1}, ValueError, "seed must be at least 0"),
        ({"seed": "x"}, TypeError, "seed must be an integer"),
        ({"topology": "star"}, ValueError, "topology must be one of 'global', 'ring'"),
        ({"topology": 3}, TypeError, "or a Channel, such as Radius"),
        ({"topology": Nearest(40)}, ValueError, "k must be less than"),
        ({"callback": 3}, TypeError, "callback must be a function of"),
        ({"history": "yes"}, TypeError, "history must be"),
        ({"vectorized": 2}, TypeError, "vectorized must be"),
        ({"update": "never"}, ValueError, "update must be one of"),
        ({"cognitive": [1.0, 2.0]}, ValueError, "one for each of the 40 particles"),
    ],
)
def test_bad_arguments_are_refused(
    arguments: dict[str, Any], error: Any, message: str
) -> None:
    with pytest.raises(error, match=message):
        quickly(**arguments)


@pytest.mark.parametrize("boundary", ["none", "clip", "absorb", "reflect"])
@pytest.mark.parametrize("topology", ["global", Radius(1.0)], ids=["global", "radius"])
@pytest.mark.parametrize("upper", [np.inf, 1.0], ids=["no bounds", "one bound"])
def test_bounds_that_are_infinite_hold_no_swarm_back(
    boundary: str, topology: Any, upper: float
) -> None:
    start = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 3))
    found = minimize(
        sphere,
        [(-np.inf, upper)] * 3,
        x0=start,
        order="literal",
        boundary=boundary,
        topology=topology,
        max_iterations=1_500,
        seed=0,
    )
    assert np.isfinite(found.x).all()
    assert found.success != ("the swarm has exploded" in found.message)
    if upper == np.inf:
        assert not found.success


def test_a_function_without_a_least_value() -> None:
    result = minimize(
        lambda x: np.where(x[:, 0] > 0, -math.inf, 1.0),
        [(-1, 1)] * 2,
        seed=0,
        max_iterations=3,
    )
    assert not result.success
    assert "The least value must be finite, got -inf at x = array(" in result.message
    assert "change the bounds" in result.message


def test_values_of_other_formats() -> None:
    """Kernels know float64 only, and no warning tells of a value beyond it."""

    def long(x: np.ndarray) -> np.ndarray:
        values = np.asarray(sphere(x), np.longdouble)
        values[0] = np.longdouble("1e4000")
        return values

    settings: dict[str, Any] = {"seed": 0, "max_iterations": 5}
    assert math.isfinite(minimize(long, [(-1, 1)] * 2, **settings).fun)
    plain = minimize(sphere, [(-1, 1)] * 2, **settings)
    foreign = minimize(lambda x: sphere(x).astype(">f8"), [(-1, 1)] * 2, **settings)
    assert foreign.fun == plain.fun
