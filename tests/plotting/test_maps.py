"""Policies and pheromone over state variables."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import gymnasium as gym
import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure

from acl_gym import ACL, Crisp, Fuzzy
from acl_gym.plotting import plot_pheromone, plot_policy
from acl_gym.policies import TablePolicy
from tests.plotting.agents import colony, pendulum, q_learning


def mesh(ax: Any) -> Any:
    (found,) = [c for c in ax.collections if type(c).__name__ == "QuadMesh"]
    return found


def test_a_map_shows_the_action_of_each_state() -> None:
    agent = pendulum()
    ax = plot_policy(agent)
    shown = np.asarray(mesh(ax).get_array())
    # Fuzzy cells are divided into four along each axis: 8 and 9 of them.
    assert shown.shape == (36, 32)
    assert mesh(ax).norm(shown).shape == shown.shape
    theta = (np.arange(32) + 0.5) * 2 * math.pi / 32
    omega = -9 + (np.arange(36) + 0.5) * 18 / 36
    states = np.stack(np.meshgrid(theta, omega), axis=-1).reshape(-1, 2)
    # Torques increase with the number of the action, so places are actions.
    assert shown.ravel().tolist() == agent.predict(states)[0].tolist()


def test_names_limits_and_the_bar_of_our_systems() -> None:
    ax = plot_policy(pendulum())
    assert ax.get_xlabel() == r"angle $\theta$ (rad)"
    assert ax.get_ylabel() == r"angular velocity $\omega$ (rad/s)"
    assert ax.get_xlim() == pytest.approx((0.0, 2 * math.pi))
    assert ax.get_title(loc="left") == "Policy, ACL after 2 trials"
    (bar,) = ax.child_axes
    assert [text.get_text() for text in bar.get_yticklabels()] == ["−0.8", "0", "+0.8"]
    assert bar.get_ylabel() == "torque $u$ (N m)"


def test_crisp_cells_are_drawn_as_they_are() -> None:
    agent = pendulum(kind=Crisp)
    x, y = np.moveaxis(mesh(plot_policy(agent)).get_coordinates(), -1, 0)
    # The cell of theta = 0 lies at both ends of the axis: 8 cells give 9 pieces.
    borders = (np.arange(8) + 0.5) * 2 * math.pi / 8
    assert np.allclose(x[0], [0.0, *borders, 2 * math.pi])
    assert y[:, 0].min() == -9.0
    assert y[:, 0].max() == 9.0


def test_levels_have_a_logarithmic_scale_and_values_a_linear_one() -> None:
    agent = pendulum()
    drawn = mesh(plot_pheromone(agent))
    assert isinstance(drawn.norm, LogNorm)
    one = np.asarray(mesh(plot_pheromone(agent, action=2)).get_array())
    best = np.asarray(drawn.get_array())
    assert (one <= best).all()
    assert (one < best).any()
    values = plot_pheromone(q_learning("acl_gym/Pendulum-v0"))
    assert not isinstance(mesh(values).norm, LogNorm)
    assert values.child_axes[0].get_ylabel() == "value of the best action"


def test_limits_make_pictures_comparable() -> None:
    drawn = mesh(plot_pheromone(pendulum(), limits=(1e-5, 2.0)))
    assert (drawn.norm.vmin, drawn.norm.vmax) == (1e-5, 2.0)
    with pytest.raises(ValueError, match=r"limits must be the lowest and the highest"):
        plot_pheromone(pendulum(), limits=(2.0, 1.0))


def test_other_variables_are_in_the_slice_or_in_the_middle() -> None:
    agent = colony("acl_gym/Navigation-v0")
    ax = plot_policy(agent, axes=("c1", "v1"), slice={"c2": 1.0})
    assert ax.get_title(loc="left").splitlines()[1] == (
        "at $c_2$ = 1 m, $v_2$ = 0 m/s (middle)"
    )
    drawn = mesh(ax)
    x, y = np.moveaxis(drawn.get_coordinates(), -1, 0)
    state = np.array([0.5 * (x[0, 3] + x[0, 4]), 0.5 * (y[2, 0] + y[3, 0])])
    action = int(agent.predict([state[0], state[1], 1.0, 0.0])[0])
    assert np.asarray(drawn.get_array())[2, 3] == action


def test_positions_are_preferred_and_forces_are_arrows() -> None:
    ax = plot_policy(colony("acl_gym/Navigation-v0"))
    assert ax.get_xlabel() == "position $c_1$ (m)"
    assert ax.get_ylabel() == "position $c_2$ (m)"
    assert any(type(c).__name__ == "Quiver" for c in ax.collections)


def test_one_variable_is_a_curve() -> None:
    agent = pendulum()
    ax = plot_policy(agent, slice={"omega": 0.0})
    (stairs,) = ax.patches
    assert len(stairs.get_data().values) == 32
    lines = plot_pheromone(agent, slice={1: 0.0}).lines
    assert [line.get_label() for line in lines] == ["−0.8", "0", "+0.8"]
    (one,) = plot_pheromone(agent, slice={1: 0.0}, action=1).lines
    assert one.get_ydata().tolist() == lines[1].get_ydata().tolist()


def test_one_cell_axes_are_drawn() -> None:
    partition = Fuzzy([[0.0], [0.0, 1.0]])
    policy = TablePolicy(partition, np.array([[1.0, 2.0], [2.0, 1.0]]))
    assert mesh(plot_policy(policy)).get_array().shape == (8, 1)


def test_names_of_environments_that_are_not_ours() -> None:
    agent = q_learning("MountainCar-v0")
    assert plot_policy(agent).get_xlabel() == "state 1"
    ax = plot_policy(
        agent, labels={1: "velocity (m/step)"}, actions=("left", "none", "right")
    )
    assert ax.get_ylabel() == "velocity (m/step)"
    (bar,) = ax.child_axes
    names = [text.get_text() for text in bar.get_yticklabels()]
    assert names == ["left", "none", "right"]
    assert ax.get_xlim() == pytest.approx((-1.2, 0.6))


def test_any_model_is_drawn_over_the_states_of_an_env() -> None:
    class ByTheSign:
        def predict(self, observation: Any, deterministic: bool = True) -> Any:
            return np.where(observation[:, 1] > 0, 2, 0), None

    ax = plot_policy(ByTheSign(), env=gym.make("MountainCar-v0"))
    shown = np.asarray(mesh(ax).get_array())
    assert (shown[:120] == 0).all()
    assert (shown[120:] == 2).all()
    with pytest.raises(TypeError, match="must have a partition and a table"):
        plot_pheromone(ByTheSign(), env=gym.make("MountainCar-v0"))
    with pytest.raises(TypeError, match="must have a partition if env is not given"):
        plot_policy(ByTheSign())


def test_an_agent_of_a_file_and_a_soft_policy_are_drawn(tmp_path: Any) -> None:
    agent = pendulum()
    loaded = ACL.load(agent.save(tmp_path / "agent"))
    same = mesh(plot_policy(agent)).get_array()
    assert (mesh(plot_policy(loaded)).get_array() == same).all()
    assert (mesh(plot_policy(loaded, env=agent.env)).get_array() == same).all()
    soft = plot_pheromone(agent.soft_policy(seed=0))
    assert soft.get_title(loc="left") == "Pheromone"


def test_the_axes_of_the_caller_are_used_and_nothing_else_changes() -> None:
    before, figures = dict(mpl.rcParams), plt.get_fignums()
    figure = Figure()
    ax = figure.subplots()
    agent = pendulum()
    assert plot_policy(agent, ax) is ax
    assert plot_pheromone(agent, ax=ax, colorbar=False) is ax
    plot_policy(agent)
    with pytest.raises(ValueError, match="axes"):
        plot_policy(agent, slice={0: 1.0, 1: 1.0})
    assert dict(mpl.rcParams) == before
    assert plt.get_fignums() == figures


def test_new_axes_are_a_picture_in_a_notebook() -> None:
    assert plot_policy(pendulum())._repr_html_().startswith('<img alt="Policy, ACL')


def test_our_style_outlives_the_context() -> None:
    ax = plot_policy(pendulum())
    ax.figure.canvas.draw()
    assert ax.get_xticklabels()[1].get_size() == 7.5
    assert to_hex(ax.figure.get_facecolor()) == "#ffffff"


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"slice": {"speed": 1.0}}, ValueError, r"must be one of 'theta', 'omega'"),
        ({"slice": {7: 1.0}}, ValueError, r"or a number 0\.\.1, got 7"),
        ({"slice": {True: 1.0}}, ValueError, "got True"),
        ({"slice": {"omega": 99.0}}, ValueError, r"slice\['omega'\] must lie in"),
        ({"slice": {"omega": "fast"}}, TypeError, "must be a real number"),
        ({"slice": [0.0]}, TypeError, "slice must be a dict"),
        ({"axes": "theta"}, TypeError, "axes must be one or two state variables"),
        ({"axes": (0, 0)}, ValueError, "one or two state variables"),
        ({"axes": (0,), "slice": {0: 1.0}}, ValueError, "one or two state variables"),
        ({"labels": ("a",)}, ValueError, "labels must be 2 names"),
        ({"labels": {5: "a"}}, ValueError, "labels must be 2 names"),
        ({"actions": ("a",)}, ValueError, "actions must be 3 names"),
        ({"shape": (2, 2)}, ValueError, "shape is for states that are one number"),
        ({"ax": 3}, TypeError, "ax must be Matplotlib axes or None, got 3"),
        ({"env": 3}, TypeError, "env must be a Gymnasium environment"),
        ({"env": gym.make("CartPole-v1")}, ValueError, "takes observations from"),
    ],
)
def test_errors_say_what_is_expected(
    options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        plot_policy(pendulum(0), **options)


@pytest.mark.parametrize("agent", [3, None, "agent", ACL, object()])
def test_what_is_no_agent_is_refused(agent: Any) -> None:
    with pytest.raises(TypeError, match="agent must be an agent or a policy"):
        plot_policy(agent)


@pytest.mark.parametrize("action", [3, -1, "up", True, 1.0])
def test_actions_that_do_not_exist_are_refused(action: Any) -> None:
    with pytest.raises(ValueError, match=r"action must be a number 0\.\.2 or one of"):
        plot_pheromone(pendulum(0), action=action)


def test_plotting_loads_neither_torch_nor_pyplot() -> None:
    code = (
        "import sys, acl_gym.plotting; "
        "sys.exit('torch' in sys.modules or 'matplotlib.pyplot' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
