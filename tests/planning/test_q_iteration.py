"""Fuzzy Q-iteration against a reference, a closed form and the known optimum."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from acl_gym import Crisp, Fuzzy, evaluate_policy_cost, fuzzy_q_iteration
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.system import ControlSystem
from acl_gym.partitions import Partition
from acl_gym.planning import q_iteration
from tests.agents import reference_colony as reference


def pendulum(**parameters: object) -> ControlVectorEnv:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, **parameters).unwrapped
    assert isinstance(env, ControlVectorEnv)
    return env


def grid(kind: type[Fuzzy] | type[Crisp], env: ControlVectorEnv, *cells: int):
    return kind.from_box(env.single_observation_space, cells, circular=[0])


def reference_sweep(
    env: ControlVectorEnv, partition: Partition, values: np.ndarray, discount: float
) -> np.ndarray:
    """(3.40) with dense degrees, one cell and action at a time, in place."""
    values = values.copy()
    single = gym.make("acl_gym/Pendulum-v0", **env.parameters)
    for cell, state in enumerate(partition.cell_states()):
        for u in range(values.shape[1]):
            single.reset(options={"state": state})
            after, reward, terminated, _, _ = single.step(u)
            index, degree = partition(after[None])
            dense = np.zeros(partition.n_cells)
            np.add.at(dense, index[0], degree[0])
            future = 0.0 if terminated else (dense @ values).max()
            values[cell, u] = reward + discount * future
    return values


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
@pytest.mark.parametrize("discount", [1.0, 0.9])
def test_sweeps_equal_the_reference(kind, discount) -> None:
    env = pendulum(goal_bounds=(0.5, 3.0))
    partition = grid(kind, env, 6, 7)
    expected = np.zeros((partition.n_cells, 3))
    for _ in range(3):
        expected = reference_sweep(env, partition, expected, discount)
    found = fuzzy_q_iteration(env, partition, discount=discount, max_iterations=3)
    np.testing.assert_allclose(found.policy.table, expected, rtol=1e-12)
    assert found.iterations == 3


class Puck(ControlSystem):
    """Position and velocity in the plane, pushed in nine ways, towards the origin.

    The numbers keep every state off the borders between crisp cells.
    """

    PUSHES = np.array([[x, y] for x in (-0.31, 0.0, 0.31) for y in (-0.31, 0.0, 0.31)])
    observation_space = spaces.Box(-1.0, 1.0, (4,), np.float64)
    action_space = spaces.Discrete(9)
    max_stage_cost = 2.0

    def sample_states(self, rng, count):
        return rng.uniform(-1, 1, (4, count))

    def checked_states(self, states):
        return np.asarray(states, dtype=np.float64)

    def advance(self, states, actions, uniforms, rewards, reached):
        states[2:] = np.clip(states[2:] + self.PUSHES[actions].T, -1, 1)
        states[:2] = np.clip(states[:2] + 0.47 * states[2:], -1, 1)
        rewards[:] = -(states[:2] ** 2).sum(axis=0) - 0.1
        reached[:] = np.abs(states).max(axis=0) < 0.85

    def evaluation_states(self):
        return np.zeros((1, 4))


class PuckVectorEnv(ControlVectorEnv):
    system_type = Puck


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_four_dimensions_and_nine_actions(kind: Any) -> None:
    """As navigation has them: k = 16; each axis with centres of its own."""
    env, cells = PuckVectorEnv(1), (4, 3, 2, 3)
    partition = kind.from_box(env.single_observation_space, cells)
    axes = [(np.linspace(-1, 1, n), None) for n in cells]
    states = partition.cell_states()
    values = np.zeros((72, 9))
    after, rewards, ends = np.empty((72, 9, 72)), np.empty((72, 9)), np.empty((72, 9))
    for cell, u in np.ndindex(values.shape):
        state, reward, reached = states[cell][:, None].copy(), np.empty(1), np.empty(1)
        env.system.advance(state, np.array([u]), None, reward, reached)
        after[cell, u] = reference.fuzzify(state[:, 0], axes, kind is Crisp)
        rewards[cell, u], ends[cell, u] = reward[0], reached[0]
    for _ in range(4):
        for cell, u in np.ndindex(values.shape):
            future = 0.0 if ends[cell, u] else (after[cell, u] @ values).max()
            values[cell, u] = rewards[cell, u] + 0.9 * future
    found = fuzzy_q_iteration(env, partition, discount=0.9, max_iterations=4)
    np.testing.assert_allclose(found.policy.table, values, rtol=1e-9)
    assert 0 < ends.sum() < ends.size


def test_batches_of_cells_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    env = pendulum()
    partition = grid(Fuzzy, env, 9, 7)
    at_once = fuzzy_q_iteration(env, partition, max_iterations=20)
    monkeypatch.setattr(q_iteration, "_SLOTS", 10)
    parts = fuzzy_q_iteration(env, partition, max_iterations=20)
    np.testing.assert_array_equal(at_once.policy.table, parts.policy.table)


def test_discounted_values_of_a_system_that_cannot_move() -> None:
    """No gravity, no torque: a resting pendulum pays the same cost forever."""
    env = pendulum(gravity=0.0, torques=(0.0,), torque_weight=0.0)
    partition = Fuzzy([[0.0, 1.0, 2.0, 3.0], [0.0]], [2 * np.pi, None])
    found = fuzzy_q_iteration(env, partition, discount=0.8, tolerance=1e-12)
    error = partition.centres[0] - np.pi
    # From 3.0 the error is 0.14 rad: outside the goal, so it pays as well.
    np.testing.assert_allclose(
        found.policy.table[:, 0], -(error**2) / (1 - 0.8), rtol=1e-9
    )
    assert found.change <= 1e-12


def test_a_finer_grid_comes_closer_to_the_optimum() -> None:
    """J* of the evaluation set is 38.4; 64 x 65 cells are within 6% of it."""
    env = pendulum()
    costs = []
    for cells in ((64, 65), (200, 201)):
        result = evaluate_policy_cost(
            fuzzy_q_iteration(env, grid(Fuzzy, env, *cells)).policy, env
        )
        assert result.success_rate == 1.0
        costs.append(result.cost)
    assert 38.0 < costs[1] < costs[0] < 1.06 * costs[1]
    assert costs[1] == pytest.approx(38.6, abs=0.3)


def test_not_reaching_the_tolerance_is_reported() -> None:
    env = pendulum()
    found = fuzzy_q_iteration(env, grid(Fuzzy, env, 10, 11), max_iterations=5)
    assert found.iterations == 5
    assert found.change > 1.0


def test_kernel_equals_its_python() -> None:
    env = pendulum()
    model = q_iteration._try_all(env, grid(Fuzzy, env, 5, 5))
    compiled, plain = np.zeros((2, *model.reward.shape))
    for _ in range(2):
        arrays = (model.reward, model.terminated, model.index, model.degree, 0.95)
        a = q_iteration._sweep(*arrays, compiled)
        b = q_iteration._sweep.py_func(*arrays, plain)
        assert a == pytest.approx(b, rel=1e-12)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12)


def test_only_environments_with_a_state_door() -> None:
    env = gym.make_vec("CartPole-v1", num_envs=1)
    with pytest.raises(TypeError, match="deterministic vector environment of acl_gym"):
        fuzzy_q_iteration(env, Fuzzy([[0.0, 1.0]] * 4))
    env.close()


@pytest.mark.parametrize(
    ("name", "value"),
    [("discount", 1.1), ("discount", -0.1), ("tolerance", 0.0), ("max_iterations", 0)],
)
def test_bad_parameters(name: str, value: float) -> None:
    env = pendulum()
    with pytest.raises(ValueError, match=name):
        fuzzy_q_iteration(env, grid(Fuzzy, env, 3, 3), **{name: value})
