"""Plants of which some parameters are known and others drawn for each episode."""

from __future__ import annotations

import copy
import math
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

import acl_gym
from acl_gym import Fuzzy, QLearning, ReturningACL, fuzzy_q_iteration
from acl_gym.envs.wrappers.perturbations import HiddenVariables, ObservationNoise
from acl_gym.evaluation import record_trajectory
from tests.envs.plant.plants import (
    KNOWN,
    PENDULUM,
    UNCERTAIN,
    compiled_pendulum,
    compiled_pendulum_with,
    make_mass,
    make_uncertain,
    pendulum,
    pendulum_with,
)

BOTH = pytest.mark.parametrize("dynamics", [pendulum_with, compiled_pendulum_with])
MODES = pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
LOW, HIGH = np.array(list(UNCERTAIN.values())).T


@settings(max_examples=30)
@given(
    st.integers(1, 5),
    st.integers(1, 4),
    st.integers(1, 4),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_each_slot_follows_its_own_equation(
    size: int, count: int, substeps: int, has_known: bool, seed: int
) -> None:
    """One step of Runge-Kutta on x' = a x + b u is the Taylor polynomial of degree 4."""
    rng = np.random.default_rng(seed)
    names = [f"rate_{i}" for i in range(count)]
    rows = [i % count for i in range(size)]

    def linear(x: Any, u: Any, p: Any) -> Any:
        gain = p.gain if has_known else 1.5
        return [getattr(p, names[r]) * x[i] + gain * u[0] for i, r in enumerate(rows)]

    env = acl_gym.plant(
        linear,
        low=np.full(size, -1e6),
        high=np.full(size, 1e6),
        inputs=[-1.0, 0.5],
        sampling_time=0.3,
        substeps=substeps,
        goal=None,
        parameters={"gain": 1.5} if has_known else None,
        uncertain=dict.fromkeys(names, (-2.0, 2.0)),
        max_episode_steps=5,
        num_envs=4,
    )
    x, own = rng.normal(size=(4, size)), rng.uniform(-2, 2, (4, count))
    actions = rng.integers(0, 2, 4)
    env.reset(options={"state": np.concatenate([x, own], axis=1)})
    observed = env.step(actions)[0]
    h, rates = 0.3 / substeps, own[:, rows]
    growth = sum((h * rates) ** k / math.factorial(k) for k in range(5))
    push = sum(h * (h * rates) ** k / math.factorial(k + 1) for k in range(4))
    for _ in range(substeps):
        x = x * growth + 1.5 * np.array([-1.0, 0.5])[actions, None] * push
    np.testing.assert_allclose(observed, x, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(env.states[:, size:], own)


@BOTH
@pytest.mark.parametrize("discrete_time", [False, True])
def test_slots_are_plants_with_known_parameters(
    dynamics: Any, discrete_time: bool
) -> None:
    """Also where the numbers stand in the equation, to the last bit but rounding."""
    count, rng = 6, np.random.default_rng(0)
    env = make_uncertain(dynamics=dynamics, num_envs=count, discrete_time=discrete_time)
    env.reset(seed=1, options={"finished": "wait"})
    begin = env.states
    actions = rng.integers(0, 3, (20, count))
    observed = np.array([env.step(each)[0] for each in actions])
    for slot, (x, own) in enumerate(zip(begin[:, :2], begin[:, 2:], strict=True)):
        known = env.with_parameters(**dict(zip(UNCERTAIN, own.tolist(), strict=True)))
        assert known.system.fully_observed
        known.reset(options={"state": np.tile(x, (count, 1)), "finished": "wait"})
        for t in range(20):
            row = known.step(np.full(count, actions[t, slot]))[0][0]
            np.testing.assert_allclose(row, observed[t, slot], rtol=1e-12)


@pytest.mark.parametrize(
    ("with_p", "without"),
    [(pendulum_with, pendulum), (compiled_pendulum_with, compiled_pendulum)],
)
def test_known_parameters_only(with_p: Any, without: Any) -> None:
    values = {"gain": 0.1, "damping": 0.01, "mass": 0.1}
    envs = [
        acl_gym.plant(with_p, parameters=values, num_envs=5, **PENDULUM),
        acl_gym.plant(without, num_envs=5, **PENDULUM),
    ]
    observed = [env.reset(seed=3)[0] for env in envs]
    assert (observed[0] == observed[1]).all()
    for _ in range(5):
        observed = [env.step([0, 1, 2, 0, 1])[0] for env in envs]
    np.testing.assert_allclose(*observed, rtol=1e-11)
    assert envs[0].states.shape == (5, 2)


@BOTH
@MODES
def test_parameters_are_drawn_for_each_episode(dynamics: Any, mode: str) -> None:
    env = make_uncertain(
        dynamics=dynamics, num_envs=40, autoreset_mode=mode, max_episode_steps=3
    )
    env.reset(seed=0)
    seen = [env.states[:, 2:]]
    for _ in range(3):
        _, _, terminated, truncated, _ = env.step([0, 1] * 20)
        if mode != "SameStep":
            assert (env.states[:, 2:] == seen[0]).all()
    finished = terminated | truncated
    assert finished.sum() >= 30  # a few may have reached the goal before
    if mode == "Disabled":
        env.reset(options={"reset_mask": finished})
    elif mode == "NextStep":
        env.step([0, 1] * 20)
    seen.append(env.states[:, 2:])
    assert (seen[1][finished] != seen[0][finished]).all()
    drawn = np.concatenate(seen)
    assert (drawn >= LOW).all()
    assert (drawn <= HIGH).all()
    # Uniform: the mean of 80 draws lies within 4.5 standard errors of the middle.
    error = (HIGH - LOW) / math.sqrt(12 * 80)
    assert (np.abs(drawn.mean(axis=0) - (LOW + HIGH) / 2) < 4.5 * error).all()


@BOTH
def test_resets_leave_other_slots_alone_and_seeds_repeat(dynamics: Any) -> None:
    runs = []
    for _ in range(2):
        env = make_uncertain(dynamics=dynamics, num_envs=4, autoreset_mode="Disabled")
        env.reset(seed=5)
        env.step([0, 1, 2, 0])
        before = env.states
        mask = np.array([False, True, False, True])
        env.reset(options={"reset_mask": mask})
        after = env.states
        assert (after[~mask] == before[~mask]).all()
        assert (after[mask] != before[mask]).all()
        runs.append(after)
    assert (runs[0] == runs[1]).all()


def test_states_with_and_without_parameters() -> None:
    env = make_uncertain(num_envs=3)
    nominal = [0.11, 0.01]
    env.reset(options={"state": [[1.0, 0.0], [2.0, 1.0], [3.0, -1.0]]})
    np.testing.assert_allclose(env.states[:, 2:], [nominal] * 3, rtol=1e-15)
    own = [0.09, 0.011]
    env.reset(options={"state": [[1.0, 0.0, *own]] * 3})
    assert env.states.tolist() == [[1.0, 0.0, *own]] * 3
    # Rows of slots that are not reset may hold anything, in either form.
    for row in ([1.5, 0.5], [1.5, 0.5, *own]):
        state = np.full((3, len(row)), np.nan)
        state[1] = row
        mask = np.array([False, True, False])
        observed, _ = env.reset(options={"state": state, "reset_mask": mask})
        assert observed.tolist() == [[1.0, 0.0], [1.5, 0.5], [1.0, 0.0]]
        expected = [*row, *nominal][:2] + list(row[2:] or nominal)
        np.testing.assert_allclose(env.states[1], expected, rtol=1e-15)
    for state, words in [
        ([[1.0, 0.0, 0.1]] * 3, r"or 4 with the uncertain parameters mass, damping"),
        ([[1.0, 0.0, 0.2, 0.01]] * 3, r"mass must lie in its uncertain range \[0\.08"),
        ([[1.0, 0.0, 0.1, np.nan]] * 3, "states must be finite"),
    ]:
        with pytest.raises(ValueError, match=words):
            env.reset(options={"state": state})


def decay(x: Any, u: Any, p: Any) -> Any:
    return [-p.rate * x[0] + u[0]]


def test_states_of_one_variable() -> None:
    env = acl_gym.plant(
        decay,
        low=[-1.0],
        high=[1.0],
        inputs=[0.0],
        sampling_time=0.1,
        goal=None,
        uncertain={"rate": (1.0, 3.0)},
        max_episode_steps=5,
        num_envs=2,
    )
    env.reset(options={"state": [0.5, -0.5]})
    assert env.states.tolist() == [[0.5, 2.0], [-0.5, 2.0]]
    env.reset(options={"state": [[0.5, 1.0], [-0.5, 3.0]]})
    mask = np.array([True, False])
    env.reset(options={"state": [0.25, np.nan], "reset_mask": mask})
    assert env.states.tolist() == [[0.25, 2.0], [-0.5, 3.0]]


def initial_with_parameters(rng: np.random.Generator, count: int) -> Any:
    return [[1.0, 0.0, 0.08 + 0.01 * rng.random(), 0.01] for _ in range(count)]


def test_initial_and_evaluation_states() -> None:
    nominal = [0.11, 0.01]
    env = make_uncertain(num_envs=50)
    evaluated = env.system.evaluation_states()
    assert evaluated.shape == (100, 4)
    np.testing.assert_allclose(evaluated[:, 2:], [nominal] * 100)
    # Those of the plant without parameters, so that costs can be compared.
    without = acl_gym.plant(pendulum, num_envs=1, **PENDULUM)
    np.testing.assert_array_equal(evaluated[:, :2], without.system.evaluation_states())
    box = spaces.Box(np.array([1.0, -1.0]), np.array([2.0, 1.0]), dtype=np.float64)
    for initial in (box, [1.5, 0.5], [[1.5, 0.5], [2.0, 0.0]]):
        env = make_uncertain(initial=initial, num_envs=50)
        env.reset(seed=0)
        assert len(np.unique(env.states[:, 2])) == 50
        np.testing.assert_allclose(
            env.system.evaluation_states()[:, 2:],
            [nominal] * len(env.system.evaluation_states()),
        )
    env = make_uncertain(
        initial=[[1.5, 0.5, 0.08, 0.01], [1.5, 0.5, 0.14, 0.01]], num_envs=50
    )
    env.reset(seed=0)
    assert set(env.states[:, 2]) == {0.08, 0.14}
    env = make_uncertain(initial=initial_with_parameters, num_envs=50)
    env.reset(seed=0)
    assert (env.states[:, 2] <= 0.09).all()
    given_states = make_uncertain(
        evaluation_states=[[1.0, 0.0, 0.14, 0.01]], num_envs=1
    )
    assert given_states.system.evaluation_states().tolist() == [[1.0, 0.0, 0.14, 0.01]]


@BOTH
def test_one_environment_and_many_are_the_same(dynamics: Any) -> None:
    many, single = (
        make_uncertain(dynamics=dynamics, num_envs=3),
        make_uncertain(dynamics=dynamics),
    )
    state = [[1.0, 0.5, 0.09, 0.011], [2.0, 0.0, 0.12, 0.009], [0.5, 3.0, 0.1, 0.01]]
    many.reset(options={"state": state})
    actions = np.random.default_rng(0).integers(0, 3, (10, 3))
    observed = [many.step(each)[0] for each in actions]
    for slot in range(3):
        single.reset(options={"state": state[slot]})
        for t in range(10):
            row = single.step(actions[t, slot])[0]
            np.testing.assert_allclose(row, observed[t][slot], rtol=1e-12)


@BOTH
def test_copies_pickles_and_other_processes(dynamics: Any) -> None:
    env = make_uncertain(dynamics=dynamics, num_envs=4)
    env.reset(seed=3)
    env.step([0, 1, 2, 0])
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    observed = env.step([1, 1, 2, 0])[0]
    for other in others:
        assert (other.step([1, 1, 2, 0])[0] == observed).all()


def test_it_walks_in_other_processes() -> None:
    env = gym.vector.AsyncVectorEnv([make_uncertain] * 2)
    try:
        assert env.reset(seed=0)[0].shape == (2, 2)
        assert env.step(np.array([0, 1]))[0].shape == (2, 2)
    finally:
        env.close()


def test_planning_needs_known_parameters() -> None:
    env = make_uncertain(num_envs=1)
    grid = Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0])
    with pytest.raises(TypeError, match="env must show its state"):
        fuzzy_q_iteration(env, grid)
    known = env.with_parameters(mass=0.12, damping=0.01)
    assert known.system.parameter("mass") == 0.12
    assert fuzzy_q_iteration(known, grid, max_iterations=2).iterations == 2
    partly = env.with_parameters(mass=0.12)
    assert list(partly.system.parameters.uncertain) == ["damping"]
    with pytest.raises(
        TypeError, match="parameters of this plant are gain, damping, mass"
    ):
        env.with_parameters(length=1.0)


def test_agents_learn_and_are_saved(tmp_path: Path) -> None:
    env = make_uncertain(dynamics=compiled_pendulum_with, num_envs=5)
    colony = ReturningACL(env, seed=0).learn(total_timesteps=600)
    again = ReturningACL(
        make_uncertain(dynamics=compiled_pendulum_with, num_envs=5), seed=0
    ).learn(total_timesteps=600)
    assert np.array_equal(colony.table, again.table)
    colony.save(tmp_path / "pendulum")
    loaded = ReturningACL.load(tmp_path / "pendulum", env)
    for each in (colony, loaded):
        each.learn(total_timesteps=300)
    assert np.array_equal(colony.table, loaded.table)
    wrapped = ObservationNoise(HiddenVariables(make_uncertain(num_envs=5), [0]), [0.1])
    QLearning(wrapped, Fuzzy([np.linspace(-9, 9, 5)]), seed=0).learn(total_timesteps=50)


def test_trajectories_are_recorded_and_drawn() -> None:
    from acl_gym.plotting import plot_policy, plot_trajectory

    env = make_uncertain(num_envs=5)
    agent = QLearning(
        env, Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0]), seed=0
    )
    path = record_trajectory(
        agent, env.with_slots(1), np.array([1.0, 0.0, 0.08, 0.01]), max_steps=4
    )
    assert (path.states[:, 2] == 0.08).all()
    assert len(plot_trajectory(agent, max_steps=4)) == 3  # two variables, the input
    plot_trajectory(path, env=env, kind="plane")
    plot_policy(agent)
    pytest.importorskip("pygame")
    drawn = make_uncertain(render_mode="rgb_array", num_envs=1)
    drawn.reset(options={"state": [[1.0, 0.0, 0.08, 0.01]]})
    other = make_uncertain(render_mode="rgb_array", num_envs=1)
    other.reset(options={"state": [[1.0, 0.0, 0.14, 0.01]]})
    assert (drawn.render()[0] == other.render()[0]).all()


def explodes_if_heavy(x: Any, u: Any, p: Any) -> Any:
    """Infinite for heavy plants beyond 0.9; they are sampled elsewhere."""
    return [np.where((p.mass > 1.5) & (x[0] > 0.9), np.inf, u[0])]


def test_an_error_names_slot_and_parameters() -> None:
    env = acl_gym.plant(
        explodes_if_heavy,
        low=[-1.0],
        high=[0.95],
        inputs=[1.0],
        sampling_time=0.1,
        goal=None,
        uncertain={"mass": (1.0, 2.0)},
        max_episode_steps=5,
        num_envs=3,
    )
    env.reset(options={"state": [[0.92, 1.0], [0.92, 2.0], [0.5, 2.0]]})
    words = r"in slot 1, from the state \[0\.92\] .* and Parameters\(mass=2\.0\)"
    with pytest.raises(ValueError, match=words):
        env.step([0, 0, 0])


def forgets_p(x: Any, u: Any) -> Any:
    return [x[1], u[0]]


def wants_p(x: Any, u: Any, p: Any) -> Any:
    return [x[1], p.mass * u[0]]


def mixes_slots(x: Any, u: Any, p: Any) -> Any:
    return [x[1], u[0] * np.mean(p.mass)]


def overwrites_p(x: Any, u: Any, p: Any) -> Any:
    p.mass[:] = 1.0
    return [x[1], u[0]]


@njit
def compiled_wants_length(x, u, p):  # type: ignore[no-untyped-def]
    return x[1], p.length * u[0]


@njit
def compiled_infinite(x, u, p):  # type: ignore[no-untyped-def]
    return x[1], p.mass * np.inf


MASS = {"mass": (1.0, 2.0)}


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"uncertain": 3}, TypeError, "uncertain must be a dict from names to values"),
        ({"uncertain": {"mass": 1.0}}, ValueError, r"must be a pair \(low, high\)"),
        ({"uncertain": {"mass": (2.0, 1.0)}}, ValueError, "finite with low < high"),
        (
            {"uncertain": {"mass": (1.0, 1.0)}},
            ValueError,
            "give what is known in parameters=",
        ),
        ({"uncertain": {"mass": (1.0, np.nan)}}, ValueError, "finite with low < high"),
        ({"uncertain": {"mass": (-1e308, 1e308)}}, ValueError, "finite with low"),
        ({"uncertain": {"mass": ("a", "b")}}, ValueError, "a pair .* of numbers"),
        ({"uncertain": {"ma ss": (1.0, 2.0)}}, ValueError, r"p\.name can be written"),
        ({"uncertain": {"_mass": (1.0, 2.0)}}, ValueError, "without an underscore"),
        ({"uncertain": {"class": (1.0, 2.0)}}, ValueError, "rename it"),
        ({"uncertain": {3: (1.0, 2.0)}}, ValueError, "got 3; rename it"),
        (
            {"parameters": {"mass": np.inf}},
            ValueError,
            r"parameters\['mass'\] must lie",
        ),
        ({"parameters": {"mass": "heavy"}}, TypeError, r"\['mass'\] must be a real"),
        (
            {"parameters": {"mass": 3.0}, "uncertain": MASS},
            ValueError,
            r"parameters\['mass'\] must lie in its uncertain range \[1, 2\], got 3",
        ),
        (
            {"dynamics": forgets_p, "uncertain": MASS},
            ValueError,
            r"parameters p, such as p\.mass of all n, and return.*3 were given",
        ),
        (
            {"dynamics": wants_p},
            ValueError,
            "third argument needs parameters= or uncertain=",
        ),
        (
            {"dynamics": wants_p, "parameters": {"length": 1.0}},
            ValueError,
            "has no attribute 'mass'",
        ),
        (
            {"dynamics": mixes_slots, "uncertain": MASS},
            ValueError,
            "each column of x, u and p by itself",
        ),
        ({"dynamics": overwrites_p, "uncertain": MASS}, ValueError, "read-only"),
        (
            {"dynamics": compiled_wants_length, "uncertain": MASS},
            ValueError,
            r"parameters p with numbers such as p\.mass, and return.*it failed",
        ),
        (
            {"dynamics": compiled_infinite, "uncertain": MASS},
            ValueError,
            r"Parameters\(mass=",
        ),
    ],
)
def test_what_is_refused(changes: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=rf"(?s){words}"):
        make_mass(**changes)


def test_models_of_python_control_take_them_as_params() -> None:
    control = pytest.importorskip("control")

    def update(t: Any, x: Any, u: Any, params: Any) -> Any:
        push = params["gain"] * u[0] - 0.981 * params["mass"] * np.sin(x[0])
        return [x[1], (push - params["damping"] * x[1]) / 0.005]

    def one_by_one(t: Any, x: Any, u: Any, params: Any) -> Any:
        return np.zeros(2) if x[0] > 7.0 else np.array(update(t, x, u, params))

    wanted = make_uncertain(num_envs=3)
    wanted.reset(seed=0)
    for function in (update, one_by_one):
        system = control.nlsys(
            function,
            None,
            inputs=1,
            states=2,
            params={"gain": 0.3, "mass": 0.3, "damping": 0.3},
        )
        env = make_uncertain(dynamics=system, num_envs=3)
        env.reset(options={"state": wanted.states})
        other = copy.deepcopy(wanted)
        for _ in range(3):
            np.testing.assert_allclose(
                env.step([0, 1, 2])[0], other.step([0, 1, 2])[0], rtol=1e-11
            )
    with pytest.raises(
        ValueError, match=r"among the params \['gain', 'mass', 'damping'\]"
    ):
        make_uncertain(dynamics=system, uncertain={"length": (1.0, 2.0)})
    linear = control.ss(np.eye(2), np.ones((2, 1)), np.eye(2), np.zeros((2, 1)))
    with pytest.raises(ValueError, match=r"make a control\.nlsys with params"):
        make_uncertain(dynamics=linear)


def test_parameters_of_other_systems() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
    heavy = env.unwrapped.with_parameters(mass=0.2)
    assert heavy.system.mass == 0.2
    assert env.unwrapped.system.mass == 0.1
    assert env.unwrapped.system.parameter("mass") == 0.1
    with pytest.raises(TypeError, match="Did you mean 'mass'"):
        env.unwrapped.with_parameters(mas=0.2)
    with pytest.raises(TypeError, match=r"got 'substeps'"):
        env.unwrapped.system.parameter("substeps")
    assert KNOWN.keys() < set(make_uncertain(num_envs=1).system.parameters.names)
