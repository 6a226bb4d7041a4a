"""The partitions of the thesis, against what it says of them."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import FlattenObservation

from acl_gym import Crisp, Discrete, Fuzzy, ScaledObservation
from acl_gym.envs.wrappers.perturbations import (
    HiddenVariables,
    ObservationNoise,
    perturbed,
)
from acl_gym.partitions import Grid
from acl_gym.partitions.automatic import thesis_partition

PENDULUM, NAVIGATION = "acl_gym/Pendulum-v0", "acl_gym/Navigation-v0"
KINDS = pytest.mark.parametrize("kind", [Crisp, Fuzzy])


@KINDS
@pytest.mark.parametrize(("n_theta", "n_omega"), [(40, 41), (16, 17), (3, 3), (7, 10)])
def test_pendulum_has_the_centres_of_the_equations(
    kind: Any, n_theta: int, n_omega: int
) -> None:
    omega_max = 7.5
    env = gym.make(PENDULUM, omega_max=omega_max)
    grid: Any = thesis_partition(env, (n_theta, n_omega), kind=kind)
    assert type(grid) is kind
    assert grid.n_cells == n_theta * n_omega
    theta = [2 * np.pi * i / n_theta for i in range(n_theta)]  # (5.2)
    step = 2 * omega_max / (n_omega - 1)
    omega = [-omega_max + step * j for j in range(n_omega)]  # (5.3)
    np.testing.assert_allclose(grid.centres[0], theta, rtol=0, atol=1e-14)
    np.testing.assert_allclose(grid.centres[1], omega, rtol=0, atol=1e-14)
    assert grid.periods == (2 * np.pi, None)


@KINDS
def test_pendulum_is_what_from_box_makes_of_the_environment(kind: Any) -> None:
    env = gym.make(PENDULUM)
    expected = kind.from_box(env.observation_space, (40, 41), circular=[0])
    assert thesis_partition(env, kind=kind).settings() == expected.settings()


@KINDS
@pytest.mark.parametrize(
    ("name", "cells", "pairs"),
    [("regular", (9, 3, 9, 3), 6561), ("damping", (12, 3, 14, 3), 13608)],
)
def test_navigation_has_as_many_pairs_as_the_thesis(
    kind: Any, name: str, cells: tuple[int, ...], pairs: int
) -> None:
    grid: Any = thesis_partition(gym.make_vec(NAVIGATION, 2), name, kind=kind)
    assert type(grid) is kind
    assert tuple(axis.size for axis in grid.centres) == cells
    assert grid.n_cells * 9 == pairs  # 9 actions
    assert grid.periods == (None,) * 4
    for velocity in (1, 3):
        assert grid.centres[velocity].tolist() == [-2.0, 0.0, 2.0]
    for position in (0, 2):
        assert grid.centres[position][[0, -1]].tolist() == [-5.0, 5.0]
        # The baseline grid that both share (§4.5.3).
        assert {-5.0, -0.3, 0.0, 0.3, 5.0} <= set(grid.centres[position])
    # The goal, at rest in the origin, is the centre of a cell.
    assert grid(np.zeros((1, 4)))[1].max() == 1.0


def test_the_regular_centres_are_symmetric_and_the_default() -> None:
    grid: Any = thesis_partition(gym.make(NAVIGATION))
    centres = grid.centres
    assert centres[0].tolist() == centres[2].tolist() == (-centres[0][::-1]).tolist()
    named = thesis_partition(gym.make(NAVIGATION), "regular")
    assert grid.settings() == named.settings()


@pytest.mark.parametrize(
    ("name", "states"),
    [("GridSearch1D", 10), ("GridSearch2D", 87), ("TwoState", 3)],
)
def test_where_a_state_is_a_cell_the_partition_is_discrete(
    name: str, states: int
) -> None:
    for make in (gym.make, gym.make_vec):
        env = make(f"acl_gym/{name}-v0")
        partition = thesis_partition(env, kind=Crisp)
        assert partition.settings() == Discrete(states).settings()
        with pytest.raises(ValueError, match="cells must be None"):
            thesis_partition(env, (3, 3))


@KINDS
def test_centres_may_be_given(kind: Any) -> None:
    centres = [[0.0, 2.0, 4.0], (-1.0, 0.0, 5.0)]
    for cells in (centres, np.array(centres), [np.array(axis) for axis in centres]):
        grid = thesis_partition(gym.make(PENDULUM), cells, kind=kind)
        assert grid.settings() == kind(centres, [2 * np.pi, None]).settings()
    with pytest.raises(ValueError, match="centres of 2 variables, got 3 sequences"):
        thesis_partition(gym.make(PENDULUM), [*centres, [1.0]])
    with pytest.raises(ValueError, match="increase strictly"):
        thesis_partition(gym.make(PENDULUM), [[0.0, 1.0], [1.0, 0.0]])


def test_wrappers_may_perturb_and_hide_variables() -> None:
    env: Any = gym.make_vec(NAVIGATION, 2)
    regular: Any = thesis_partition(env)
    for wrapped in (
        perturbed(env, {"noise": [0.1] * 4, "hidden": [3]}),
        HiddenVariables(ObservationNoise(env, [0.1] * 4), [3]),
    ):
        grid: Any = thesis_partition(wrapped)
        grid.check_space(wrapped.single_observation_space)
        assert grid.settings() == Fuzzy(regular.centres[:3]).settings()
    twice: Any = HiddenVariables(HiddenVariables(env, [0]), [1])
    grid = thesis_partition(twice, "damping")
    expected: Any = thesis_partition(env, "damping")
    assert [axis.size for axis in grid.centres] == [3, 3]
    assert grid.settings() == Fuzzy(expected.centres[1::2]).settings()
    given = thesis_partition(twice, [[-1.0, 1.0], [0.0]])
    assert given.settings() == Fuzzy([[-1.0, 1.0], [0.0]]).settings()
    # What is circular stays so where another variable is hidden.
    angle: Any = thesis_partition(HiddenVariables(gym.make_vec(PENDULUM, 2), [1]))
    assert angle.periods == (2 * np.pi,)
    assert thesis_partition(FlattenObservation(gym.make(PENDULUM))).n_cells == 1640


def test_transformed_variables_and_other_environments_are_refused() -> None:
    with pytest.raises(ValueError, match="must show variables of its system as they"):
        thesis_partition(ScaledObservation(gym.make(PENDULUM), circular=[0]))
    with pytest.raises(TypeError, match="control environment of this package"):
        thesis_partition(gym.make("CartPole-v1"))
    with pytest.raises(TypeError, match="must be a Gymnasium environment"):
        thesis_partition("acl_gym/Pendulum-v0")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["Regular", "", 4, ["regular"], (9, 3, 9, 3)])
def test_unknown_names_are_refused(name: Any) -> None:
    with pytest.raises(ValueError, match=r"cells must be one of 'regular', 'damping'"):
        thesis_partition(gym.make(NAVIGATION), name)


@pytest.mark.parametrize("kind", ["Fuzzy", None, Fuzzy([[0.0]]), dict, Grid])
def test_other_kinds_are_refused(kind: Any) -> None:
    for env_id in (PENDULUM, NAVIGATION):
        with pytest.raises(TypeError, match="kind must be the class Crisp or Fuzzy"):
            thesis_partition(gym.make(env_id), kind=kind)


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ((2, 41), "n_theta must be at least 3"),
        ((40, 2), "n_omega must be at least 3"),
        ((4.0, 5), "n_theta must be an integer"),
        ((40,), "two integers"),
        (40, "two integers"),
        ("regular", "two integers"),
    ],
)
def test_bad_numbers_of_centres_are_refused(cells: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        thesis_partition(gym.make(PENDULUM), cells)
