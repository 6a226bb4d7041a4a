"""Pictures of the inputs that an interpolated policy sets."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.colors import to_hex

from acl_gym import Discrete, Fuzzy, InterpolatedPolicy
from acl_gym.plotting import plot_pheromone, plot_policy, plot_trajectory
from acl_gym.policies import TablePolicy
from acl_gym.utils.pictures import action_colours
from tests.plotting.agents import colony, pendulum
from tests.plotting.test_maps import mesh


def plane(inputs: Any = None) -> InterpolatedPolicy:
    """A policy over two variables whose best action changes from cell to cell."""
    grid = Fuzzy([np.linspace(-1, 1, 6), np.linspace(0, 5, 4)])
    table = np.random.default_rng(0).uniform(1.0, 2.0, (24, 4))
    values = [[-2.0, 0.0], [-2.0, 3.0], [1.0, 0.0], [1.0, 3.0]]
    return InterpolatedPolicy(
        TablePolicy(grid, table), values if inputs is None else inputs
    )


def test_the_colours_are_the_inputs_of_each_state() -> None:
    policy = pendulum().interpolated_policy()
    ax = plot_policy(policy)
    drawn = mesh(ax)
    shown = np.asarray(drawn.get_array())
    theta = (np.arange(32) + 0.5) * 2 * np.pi / 32
    omega = -9 + (np.arange(36) + 0.5) * 18 / 36
    states = np.stack(np.meshgrid(theta, omega), axis=-1).reshape(-1, 2)
    expected = policy.predict(states)[0][:, 0]
    np.testing.assert_allclose(shown.ravel(), expected, rtol=1e-9)
    # The point is to see what lies between the actions.
    assert (~np.isin(shown, [-0.8, 0.0, 0.8])).any()
    assert (drawn.norm.vmin, drawn.norm.vmax) == (-0.8, 0.8)


def test_the_colours_are_those_of_the_actions_where_it_sets_their_inputs() -> None:
    drawn = mesh(plot_policy(pendulum().interpolated_policy()))
    ends = [to_hex(drawn.cmap(drawn.norm(value))) for value in (-0.8, 0.8)]
    assert [end.upper() for end in ends] == action_colours(3, [-0.8, 0.0, 0.8])[::2]


def test_names_are_those_of_the_plant_also_without_it() -> None:
    ax = plot_policy(pendulum().interpolated_policy())
    assert ax.get_xlabel() == r"angle $\theta$ (rad)"
    assert ax.get_ylabel() == r"angular velocity $\omega$ (rad/s)"
    assert ax.get_title(loc="left") == "Policy between 3 actions"
    assert ax.child_axes[0].get_ylabel() == "torque $u$ (N m)"
    env = gym.make("Pendulum-v1")
    policy = InterpolatedPolicy(
        colony("acl_gym/Pendulum-v0").policy, inputs=[-2.0, 0.0, 2.0]
    )
    with pytest.raises(ValueError, match="observation"):
        plot_policy(policy, env=env)
    assert not plot_policy(policy, colorbar=False).child_axes


@pytest.mark.parametrize(
    ("input", "column"), [(None, 0), (0, 0), (1, 1), ("u[1]", 1), ("u[0]", 0)]
)
def test_one_of_several_inputs_is_drawn(input: Any, column: int) -> None:
    policy = plane()
    ax = plot_policy(policy, input=input)
    shown = np.asarray(mesh(ax).get_array())
    x = (np.arange(24) + 0.5) / 12 - 1
    y = (np.arange(16) + 0.5) * 5 / 16
    states = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(shown.ravel(), policy.predict(states)[0][:, column])
    assert ax.child_axes[0].get_ylabel() == f"u[{column}]"
    assert mesh(ax).norm.vmax == (1.0, 3.0)[column]


def test_forces_of_the_navigation_are_arrows() -> None:
    agent = colony("acl_gym/Navigation-v0")
    policy = agent.interpolated_policy()
    (arrows,) = [
        each
        for each in plot_policy(policy, env=agent.env).collections
        if type(each).__name__ == "Quiver"
    ]
    forces = np.stack([arrows.U, arrows.V], axis=1)
    assert (~np.isin(forces, [-1.0, 0.0, 1.0])).any()
    ax = plot_policy(policy, env=agent.env, input="force u2")
    assert ax.child_axes[0].get_ylabel() == "force $u_2$ (N)"
    assert mesh(ax).norm.vmin == -1.0


def test_over_one_variable_it_is_a_curve() -> None:
    policy = plane()
    ax = plot_policy(policy, axes=["state 2"], slice={"state 1": 0.25}, input=1)
    (line,) = ax.lines
    x, y = line.get_data()
    states = np.stack([np.full(len(x), 0.25), x], axis=1)
    np.testing.assert_allclose(y, policy.predict(states)[0][:, 1])
    assert ax.get_ylabel() == "u[1]"
    low, high = ax.get_ylim()
    assert low < 0.0 < 3.0 < high


def test_an_input_that_no_action_changes_has_one_colour() -> None:
    drawn = mesh(plot_policy(plane([[i, 7.0] for i in range(4)]), input=1))
    assert (np.asarray(drawn.get_array()) == 7.0).all()
    assert drawn.norm.vmin < 7.0 < drawn.norm.vmax


def test_what_cannot_be_drawn_is_refused() -> None:
    policy = plane()
    with pytest.raises(ValueError, match=r"input must be one of 'u\[0\]', 'u\[1\]'"):
        plot_policy(policy, input="u[2]")
    with pytest.raises(ValueError, match=r"or a number 0\.\.1, got 2"):
        plot_policy(policy, input=2)
    with pytest.raises(ValueError, match="input is for an InterpolatedPolicy"):
        plot_policy(policy.greedy, input=0)
    with pytest.raises(ValueError, match="shape is for states that are one number"):
        plot_policy(policy, shape=(2, 2))
    numbered = InterpolatedPolicy(
        TablePolicy(Discrete(3), np.eye(3)), [[0.0], [1.0], [2.0]]
    )
    with pytest.raises(ValueError, match=r"draw policy\.greedy"):
        plot_policy(numbered)
    for plot in (plot_pheromone, plot_trajectory):
        with pytest.raises(TypeError, match=r"pass policy\.greedy"):
            plot(policy)
