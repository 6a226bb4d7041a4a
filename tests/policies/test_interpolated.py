"""Policies between actions: the kernel against the equation, and its edges."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import (
    ACL,
    ActionGrid,
    Crisp,
    Discrete,
    Fuzzy,
    InterpolatedPolicy,
    QLearning,
    ReturningACL,
    WaitingVectorEnv,
)
from acl_gym.colony.interpolation import vertex
from acl_gym.policies import TablePolicy
from acl_gym.utils import archives
from tests.export.policies import hard_observations, random_policy

ONE_CELL = Crisp([[0.0]])


def grid_of(counts: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    axes = [np.cumsum(rng.uniform(0.1, 2.0, n)) - 2.0 for n in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return points.reshape(-1, len(counts))


def reference(policy: InterpolatedPolicy, observation: np.ndarray) -> list[float]:
    """The vertex of the parabola that NumPy fits through three points."""
    index, degree = policy.greedy.partition(observation[None])
    values = degree[0] @ policy.greedy.table[index[0]]
    best = policy.greedy.predict(observation)[0] - policy.greedy.first_action
    points = policy.grid.values
    chosen = []
    for i in range(points.shape[1]):
        others = np.delete(points, i, axis=1)
        line = np.flatnonzero((others == others[best]).all(axis=1))
        line = line[np.argsort(points[line, i])]
        at = int(np.flatnonzero(line == best)[0])
        u = points[best, i]
        three = line[at - 1 : at + 2]
        if 0 < at < len(line) - 1 and np.ptp(values[three]) > 0:
            a, b, _ = np.polyfit(points[three, i] - u, values[three] - values[best], 2)
            u -= b / (2 * a)
        chosen.append(u)
    return chosen


@settings(max_examples=60)
@given(
    st.sampled_from([Fuzzy, Crisp]),
    st.lists(st.integers(1, 5), min_size=1, max_size=3),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_the_kernel_follows_the_equation(
    kind: type, counts: list[int], shuffled: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    inputs = grid_of(tuple(counts), rng)
    if shuffled:
        inputs = rng.permutation(inputs)
    greedy = random_policy(kind, (5, 4), (True, False), len(inputs), seed)
    # Levels of order 1, so that a fit by least squares is good to about 1e-8.
    greedy = TablePolicy(
        greedy.partition, rng.random(greedy.table.shape), greedy.ranks, 2
    )
    policy = InterpolatedPolicy(greedy, inputs)
    states = hard_observations(greedy, 20, seed)
    found, _ = policy.predict(states)
    wanted = np.array([reference(policy, x) for x in states])
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6)
    # Never farther than halfway to a neighbour.
    best = greedy.predict(states)[0] - 2
    for i in range(inputs.shape[1]):
        for side in (policy.grid.below, policy.grid.above):
            other = np.where(side[best, i] < 0, best, side[best, i])
            far = np.abs(inputs[other, i] - inputs[best, i]) / 2
            moved = found[:, i] - inputs[best, i]
            towards = np.sign(inputs[other, i] - inputs[best, i])
            assert (moved * towards <= far + 1e-12).all()


@settings(max_examples=200)
@given(
    st.floats(0.01, 10.0),
    st.floats(0.01, 10.0),
    *[st.floats(allow_nan=False, allow_infinity=True) for _ in range(3)],
)
def test_any_levels_give_an_input_in_between(
    down: float, up: float, low: float, best: float, high: float
) -> None:
    best = max(low, best, high)
    found = vertex(-down, 0.0, up, low, best, high)
    assert -down / 2 <= found <= up / 2
    assert found == vertex.py_func(-down, 0.0, up, low, best, high)
    if not np.isfinite([low, best, high]).all() or low == best == high:
        assert found == 0.0
    # The same for costs of another unit, and mirrored: levels may have any sign.
    if all(abs(v) < 1e300 and (v == 0 or abs(v) > 1e-290) for v in (low, best, high)):
        assert found == vertex(-down, 0.0, up, 8 * low, 8 * best, 8 * high)
        mirrored = vertex(-up, 0.0, down, high, best, low)
        assert found == pytest.approx(-mirrored, abs=1e-12 * max(up, down))


def test_a_quadratic_value_has_its_maximum_found() -> None:
    inputs = np.array([-2.0, -0.5, 0.25, 1.0, 2.0])
    for peak in np.linspace(-0.7, 1.2, 25):
        table = -3.0 * (inputs - peak)[None] ** 2 + 100.0
        policy = InterpolatedPolicy(TablePolicy(ONE_CELL, table), inputs)
        nearest = inputs[np.argmin(np.abs(inputs - peak))]
        if abs(peak - nearest) < 1e-9 or nearest not in inputs[[0, -1]]:
            assert policy.predict([0.0])[0] == pytest.approx(peak, abs=1e-12)


def test_it_does_not_jump_from_one_neighbour_to_the_next() -> None:
    """Values -(u - x)^2, linear in x but for what is the same for all u: u = x is best."""
    inputs, states = np.linspace(-0.5, 1.5, 9), np.linspace(0.0, 1.0, 501)
    table = -((inputs - np.array([[0.0], [1.0]])) ** 2)
    greedy = TablePolicy(Fuzzy([[0.0, 1.0]]), table)
    assert len(np.unique(greedy.predict(states[:, None])[0])) == 5
    found, _ = InterpolatedPolicy(greedy, inputs).predict(states[:, None])
    np.testing.assert_allclose(found[:, 0], states, atol=1e-12)


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ([1.0, 0.0, 0.0], -1.0),  # at an end there is nothing to go by
        ([0.0, 0.0, 1.0], 1.0),
        ([0.0, 1.0, 0.0], 0.0),
        ([0.0, 1.0, 1.0], 0.5),  # ties: halfway, if the middle one is preferred
        ([1.0, 1.0, 1.0], 0.0),
        ([-np.inf, 1.0, 0.0], 0.0),
        ([-1.7e308, 1.7e308, -1.7e308], 0.0),
        ([-1.7e308, 1.7e308, 1.7e308], 0.5),
        ([0.0, 5e-324, 0.0], 0.0),
    ],
)
def test_edges_and_ties(levels: list[float], expected: float) -> None:
    ranks = np.array([[1, 0, 2]])  # the middle one wins ties
    greedy = TablePolicy(ONE_CELL, np.array([levels]), ranks)
    policy = InterpolatedPolicy(greedy, [-1.0, 0.0, 1.0])
    assert policy.predict([[3.0]])[0].tolist() == [[expected]]


def test_shapes_state_and_numbers() -> None:
    greedy = TablePolicy(Fuzzy([[0.0, 1.0]]), np.eye(2, 4), first_action=7)
    policy = InterpolatedPolicy(greedy, [[0, 0], [0, 1], [1, 0], [1, 1]])
    inputs, state = policy.predict([[0.0], [0.3], [1.0]], state="kept")
    assert inputs.shape == (3, 2)
    assert inputs.dtype == np.float64
    assert state == "kept"
    assert policy.predict([0.2])[0].shape == (2,)
    assert policy.predict(np.empty((0, 1)))[0].shape == (0, 2)
    assert (
        repr(policy)
        == "InterpolatedPolicy(Fuzzy(2 cells, circular=[]), between 2 x 2 actions)"
    )
    for bad in ([np.nan], [[0.0, 1.0]], "up"):
        with pytest.raises(ValueError, match=r"observation|states"):
            policy.predict(bad)


def test_a_copy_no_longer_follows_the_table() -> None:
    table = np.array([[0.0, 1.0, 0.0]])
    policy = InterpolatedPolicy(TablePolicy(ONE_CELL, table), [-1.0, 0.0, 1.0])
    kept, packed = policy.copy(), pickle.loads(pickle.dumps(policy))
    table[:] = [[0.0, 0.0, 1.0]]
    assert policy.predict([0.0])[0] == 1.0
    assert kept.predict([0.0])[0] == packed.predict([0.0])[0] == 0.0
    with pytest.raises(AttributeError, match="grid"):
        policy.grid = kept.grid


@pytest.mark.parametrize(
    ("inputs", "match"),
    [
        (None, "ActionGrid"),
        ([0.0, 1.0], "each of the 3 actions, got 2"),
        ([0.0, 1.0, 1.0], "form a grid"),
        ([[0, 0], [0, 1], [1, 0]], "2 x 2 = 4 actions, got 3"),
        ([0.0, np.nan, 1.0], "finite"),
        ([0.0, 1e31, 1.0], "1e30"),
        ("abc", "inputs"),
    ],
)
def test_inputs_that_are_no_grid(inputs: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        InterpolatedPolicy(TablePolicy(ONE_CELL, np.zeros((1, 3))), inputs)


def test_only_a_table_can_be_interpolated() -> None:
    with pytest.raises(TypeError, match=r"agent\.policy"):
        InterpolatedPolicy("greedy", [1.0])  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [ACL, ReturningACL, QLearning])
def test_files_keep_what_it_needs(kind: type, tmp_path: Any) -> None:
    env = ActionGrid(gym.make_vec("acl_gym/Pendulum-v0", 3, continuous=True), 5)
    agent = kind(env, max_steps=30, seed=0).learn(trials=2)
    states = np.random.default_rng(0).uniform([0, -9], [6, 9], (50, 2))
    inputs, _ = agent.interpolated_policy().predict(states)
    loaded = kind.load(agent.save(tmp_path / "agent"))
    np.testing.assert_array_equal(
        loaded.interpolated_policy().predict(states)[0], inputs
    )
    own = loaded.interpolated_policy(inputs=10 * env.values)
    np.testing.assert_allclose(own.predict(states)[0], 10 * inputs, rtol=1e-12)


def test_the_type_is_that_of_the_environment(tmp_path: Any) -> None:
    env = ActionGrid(WaitingVectorEnv.make("Pendulum-v1", 2), 3)
    agent = ReturningACL(env, max_steps=5, seed=0).learn(trials=1)
    loaded = ReturningACL.load(agent.save(tmp_path / "agent"))
    for each in (agent, loaded):
        inputs, _ = each.interpolated_policy().predict([1.0, 0.0, 0.0])
        assert inputs.dtype == np.float32
        assert env.env.single_action_space.contains(inputs)


def test_actions_without_known_inputs() -> None:
    env = WaitingVectorEnv.make("FrozenLake-v1", 2)
    agent = ReturningACL(env, Discrete(16), seed=0)
    with pytest.raises(ValueError, match="inputs of the actions must be known"):
        agent.interpolated_policy()
    assert agent.interpolated_policy([1, 2, 3, 4]).grid.counts == (4,)


def changed(agent: Any, path: Path, monkeypatch: Any, change: Any) -> Path:
    """The file of an agent, its header changed before it is written."""
    write = archives.save

    def save(path: Path, header: dict[str, Any], arrays: Any) -> Any:
        change(header)
        return write(path, header, arrays)

    with monkeypatch.context() as patch:
        patch.setattr(archives, "save", save)
        return Path(agent.save(path))


def test_older_files_know_no_inputs(tmp_path: Path, monkeypatch: Any) -> None:
    env = ActionGrid(gym.make_vec("acl_gym/Pendulum-v0", 1, continuous=True), 3)
    agent = QLearning(env, max_steps=5, seed=0)
    path = changed(agent, tmp_path / "old", monkeypatch, lambda h: h.pop("signals"))
    loaded = QLearning.load(path)
    with pytest.raises(ValueError, match="must be known"):
        loaded.interpolated_policy()
    loaded.set_env(env)
    assert loaded.interpolated_policy().grid.counts == (3,)


@pytest.mark.parametrize(
    "damage",
    [
        {"values": [[0.0]]},
        {"values": [[0.0], [float("nan")], [1.0]]},
        {"values": "abc"},
        {"dtype": "int64"},
        {"inputs": []},
        {"more": 1},
    ],
)
def test_damaged_files_are_refused(
    damage: dict[str, Any], tmp_path: Path, monkeypatch: Any
) -> None:
    env = ActionGrid(gym.make_vec("acl_gym/Pendulum-v0", 1, continuous=True), 3)
    agent = QLearning(env, max_steps=5, seed=0)
    path = changed(
        agent, tmp_path / "bad", monkeypatch, lambda h: h["signals"].update(damage)
    )
    with pytest.raises(ValueError, match="damaged"):
        QLearning.load(path)
