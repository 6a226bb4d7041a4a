"""The thesis's partitions against what it says of them."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import Crisp, Fuzzy
from acl_gym.partitions import Grid, named

KINDS = pytest.mark.parametrize("kind", [Crisp, Fuzzy])


@KINDS
@pytest.mark.parametrize(("n_theta", "n_omega"), [(40, 41), (16, 17), (3, 3), (7, 10)])
def test_pendulum_has_the_centres_of_the_equations(
    kind: Any, n_theta: int, n_omega: int
) -> None:
    omega_max = 7.5
    grid = named.pendulum(n_theta, n_omega, kind=kind, omega_max=omega_max)
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
    space = gym.make("acl_gym/Pendulum-v0").observation_space
    expected = kind.from_box(space, (40, 41), circular=[0])
    assert named.pendulum(kind=kind).settings() == expected.settings()


@KINDS
@pytest.mark.parametrize(
    ("name", "cells", "pairs"),
    [("regular", (9, 3, 9, 3), 6561), ("damping", (12, 3, 14, 3), 13608)],
)
def test_navigation_has_as_many_pairs_as_the_thesis(
    kind: Any, name: str, cells: tuple[int, ...], pairs: int
) -> None:
    grid = named.navigation(name, kind=kind)
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


def test_the_regular_one_is_symmetric() -> None:
    centres = named.navigation("regular").centres
    assert centres[0].tolist() == centres[2].tolist() == (-centres[0][::-1]).tolist()


@pytest.mark.parametrize("name", ["Regular", "", None, 4, ["regular"]])
def test_unknown_names_are_refused(name: Any) -> None:
    with pytest.raises(ValueError, match=r"name must be one of 'regular', 'damping'"):
        named.navigation(name)


@pytest.mark.parametrize("kind", ["Fuzzy", None, Fuzzy([[0.0]]), dict, Grid])
def test_other_kinds_are_refused(kind: Any) -> None:
    for make in (named.pendulum, lambda **k: named.navigation("regular", **k)):
        with pytest.raises(TypeError, match="kind must be the class Crisp or Fuzzy"):
            make(kind=kind)


@pytest.mark.parametrize(
    "arguments",
    [{"n_theta": 2}, {"n_omega": 2}, {"n_theta": 4.0}, {"omega_max": 0.0}],
)
def test_bad_numbers_are_refused(arguments: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=f"^{next(iter(arguments))} must"):
        named.pendulum(**arguments)
