"""What functions of a plant may not do after they passed their first check."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import njit

from tests.envs.plant.plants import compiled_mass, make_mass, mass

ACTIONS = np.array([2, 0, 1])  # one for each of three slots


@njit
def compiled_writer(x, u):  # type: ignore[no-untyped-def]
    u[0] *= 2.0
    x[1] += 0.5
    return (x[1], u[0])


@njit
def compiled_reader(x, u):  # type: ignore[no-untyped-def]
    return (x[1] + 0.5, 2.0 * u[0])


@njit
def compiled_shrinking(x, u):  # type: ignore[no-untyped-def]
    return np.array([x[1], u[0]])[: 1 if abs(x[0]) < 1e-9 else 2]


@njit
def compiled_goal(x):  # type: ignore[no-untyped-def]
    x[0] += 0.5
    return np.abs(x[0] - 0.5) < 0.1


@pytest.mark.parametrize("discrete_time", [False, True])
def test_compiled_dynamics_write_to_copies(discrete_time: bool) -> None:
    ends = []
    for dynamics in (compiled_writer, compiled_reader):
        env = make_mass(
            dynamics=dynamics, num_envs=3, discrete_time=discrete_time, substeps=2
        )
        env.reset(seed=0, options={"state": np.array([[0.3, 0.1]] * 3)})
        for _ in range(3):
            states, *_ = env.step(ACTIONS)
        assert env.system.inputs.tolist() == [[-1.0], [0.0], [1.0]]
        ends.append(states)
    assert np.array_equal(*ends)


def test_compiled_dynamics_of_another_length_later() -> None:
    env = make_mass(dynamics=compiled_shrinking, num_envs=1)
    env.reset(options={"state": np.array([[0.0, 0.9]])})
    with pytest.raises(ValueError, match="one number for each state variable"):
        env.step(np.array([0]))


class Later:
    """The mass for the first calls, which check it; then something else."""

    def __init__(self, first: Callable[..., Any]) -> None:
        self.now = first

    def __call__(self, *arguments: Any) -> Any:
        return self.now(*arguments)


def add_to_x(x: Any, u: Any = None) -> Any:
    x[0] += 0.5
    return x[0] < 0


def add_to_u(x: Any, u: Any) -> Any:
    u *= 2
    return [x[1], u[0]]


@pytest.mark.parametrize(
    ("later", "words"),
    [
        (add_to_x, r"dynamics must not change x and u.*write to a copy"),
        (add_to_u, r"dynamics must not change x and u.*write to a copy"),
        (lambda x, u: [x[1]], r"return 2 rows of n numbers.*got 1 rows for 3 states"),
        (lambda x, u: [x[1], u[0], u[0]], r"return 2 rows.*got 3 rows for 3 states"),
        (lambda x, u: x.T, r"return 2 rows.*got shape \(3, 2\) of float64"),
        (lambda x, u: [x[1], u[0][:2]], r"return 2 rows.*could not broadcast"),
        (lambda x, u: [x[1], 1j * u[0]], r"return 2 rows.*complex128"),
        (lambda x, u: x * 1j, r"return 2 rows.*got shape \(2, 3\) of complex128"),
        (lambda x, u: None, r"return 2 rows.*got None"),
    ],
)
@pytest.mark.parametrize("discrete_time", [False, True])
def test_dynamics(later: Any, words: str, discrete_time: bool) -> None:
    dynamics = Later(mass)
    env = make_mass(dynamics=dynamics, num_envs=3, discrete_time=discrete_time)
    env.reset(seed=0)
    dynamics.now = later
    with pytest.raises(ValueError, match=words):
        env.step(ACTIONS)


@pytest.mark.parametrize(
    ("later", "words"),
    [
        (
            lambda x, u: 1.0,
            r"cost\(x, u\) must return.*got float64 of shape \(\) for n",
        ),
        (lambda x, u: [1.0], r"cost\(x, u\) must return.*shape \(1,\) for n = 3"),
        (lambda x, u: x[0] * 1j, r"cost\(x, u\) must return finite.*got complex128"),
        (add_to_x, r"cost\(x, u\).*must not change the states x: write to a copy"),
    ],
)
def test_cost(later: Any, words: str) -> None:
    cost = Later(lambda x, u: x[0] ** 2)
    env = make_mass(cost=cost, num_envs=3)
    env.reset(seed=0)
    cost.now = later
    with pytest.raises(ValueError, match=words):
        env.step(ACTIONS)


@pytest.mark.parametrize(
    ("later", "words"),
    [
        (
            lambda x: np.full(x.shape[1], np.nan),
            r"goal\(x\) must return booleans.*float",
        ),
        (lambda x: True, r"goal\(x\) must return booleans.*got bool of shape \(\)"),
        (add_to_x, r"goal\(x\).*must not change the states x: write to a copy"),
    ],
)
def test_goal(later: Any, words: str) -> None:
    goal = Later(lambda x: np.abs(x[0]) < 0.1)
    env = make_mass(goal=goal, tolerance=None, num_envs=3)
    env.reset(seed=0)
    goal.now = later
    with pytest.raises(ValueError, match=words):
        env.step(ACTIONS)
    with pytest.raises(ValueError, match=words):
        env.reset(seed=0)


def test_compiled_goal_writes_to_a_copy() -> None:
    env = make_mass(
        dynamics=compiled_mass, goal=compiled_goal, tolerance=None, num_envs=1
    )
    env.reset(options={"state": np.array([[0.3, 0.0]])})
    states, *_ = env.step(np.array([1]))  # no force: it stays
    assert states.tolist() == [[0.3, 0.0]]


@pytest.mark.parametrize("num_envs", [1, 3, 20_000])
def test_a_goal_that_is_everywhere_later(num_envs: int) -> None:
    goal = Later(lambda x: np.abs(x[0]) < 0.1)
    env = make_mass(goal=goal, tolerance=None, num_envs=num_envs)
    goal.now = lambda x: np.ones(x.shape[1], dtype=bool)
    with pytest.raises(ValueError, match="the goal must leave 1% or more"):
        env.reset(seed=0)


def test_a_goal_that_leaves_one_hundredth() -> None:
    # 1.05%, which the check of 1,000 samples lets pass.
    env = make_mass(
        goal=lambda x: x[0] < 0.979,
        tolerance=None,
        num_envs=200,
        evaluation_states=[[0, 0]],
    )
    assert (env.reset(seed=0)[0][:, 0] >= 0.979).all()
