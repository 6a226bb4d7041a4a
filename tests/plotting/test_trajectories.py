"""One episode over time, and through a plane."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.figure import Figure

from acl_gym.evaluation import record_trajectory
from acl_gym.plotting import plot_policy, plot_trajectory
from tests.plotting.agents import colony, pendulum, q_learning


def test_states_and_inputs_over_time() -> None:
    agent = pendulum()
    theta, omega, torque = plot_trajectory(agent, max_steps=12)
    path = record_trajectory(
        agent, agent.env.unwrapped.with_slots(1), np.zeros(2), max_steps=12
    )
    assert omega.lines[0].get_ydata().tolist() == path.states[:, 1].tolist()
    assert omega.lines[0].get_xdata() == pytest.approx(0.1 * np.arange(13))
    torques = np.array([-0.8, 0.0, 0.8])[path.actions]
    assert torque.lines[0].get_ydata()[:-1].tolist() == torques.tolist()
    assert theta.get_ylabel() == r"$\theta$ (rad)"
    assert torque.get_xlabel() == "time (s)"


def test_a_recorded_trajectory_needs_its_environment() -> None:
    agent = pendulum()
    path = record_trajectory(
        agent, agent.env.unwrapped.with_slots(1), np.ones(2), max_steps=5
    )
    panels = plot_trajectory(path, env=agent.env)
    assert panels[0].lines[0].get_ydata()[0] == 1.0
    with pytest.raises(ValueError, match="env must be given with a Trajectory"):
        plot_trajectory(path)


def test_a_path_is_broken_where_the_angle_turns_over() -> None:
    agent = pendulum()
    path = record_trajectory(
        agent, agent.env.unwrapped.with_slots(1), np.array([6.2, 8.0]), max_steps=5
    )
    assert np.abs(np.diff(path.states[:, 0])).max() > 3.0
    ax = plot_trajectory(path, env=agent.env, kind="plane")
    drawn = ax.lines[0].get_xdata()
    assert np.isnan(drawn).sum() == 1
    kept = drawn[~np.isnan(drawn)]
    assert kept.tolist() == path.states[:, 0].tolist()


def test_environments_that_are_not_ours_are_run() -> None:
    agent = q_learning("MountainCar-v0")
    panels = plot_trajectory(agent, seed=3, max_steps=10)
    assert len(panels) == 3
    assert panels[0].get_title(loc="left") == "10 steps, return -10"
    single = plot_trajectory(
        agent.policy, env=gym.make("MountainCar-v0"), seed=3, max_steps=10, kind="plane"
    )
    assert len(single.lines[0].get_xdata()) == 11


def test_a_policy_runs_to_the_time_limit_of_its_environment() -> None:
    agent = q_learning("MountainCar-v0")
    env = gym.make("MountainCar-v0", max_episode_steps=400)
    panels = plot_trajectory(agent.policy, env=env, seed=3)
    assert panels[0].get_title(loc="left") == "400 steps, return -400"
    with pytest.raises(ValueError, match="max_steps must be at least 1, got 0"):
        plot_trajectory(agent.policy, env=env, max_steps=0)


def test_running_does_not_change_what_is_learned() -> None:
    one, other = q_learning("MountainCar-v0"), q_learning("MountainCar-v0")
    plot_trajectory(one, max_steps=5)
    assert one.learn(trials=2).table.tolist() == other.learn(trials=2).table.tolist()


def test_axes_of_the_caller() -> None:
    agent = pendulum()
    panels = Figure().subplots(3, 1)
    assert (plot_trajectory(agent, panels) == panels).all()
    ax = Figure().subplots()
    assert plot_trajectory(agent, ax) is ax
    assert len(ax.lines) == 2
    with pytest.raises(ValueError, match=r"ax must be one axes or 3, .* got 2"):
        plot_trajectory(agent, panels[:2])


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"kind": "space"}, ValueError, "kind must be one of 'time', 'plane'"),
        ({"axes": (0, 1)}, ValueError, 'axes are for kind="plane"'),
        ({"start": [0.0]}, ValueError, "state"),
        ({"max_steps": 0}, ValueError, "max_steps must be at least 1"),
    ],
)
def test_errors_say_what_is_expected(
    options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        plot_trajectory(pendulum(0), **options)


def test_a_policy_needs_an_environment() -> None:
    with pytest.raises(ValueError, match="env must be given where the agent has none"):
        plot_trajectory(pendulum().policy)
    with pytest.raises(ValueError, match="start can only be set"):
        plot_trajectory(q_learning("MountainCar-v0"), start=[0.0])


def test_the_vehicle_starts_in_a_corner() -> None:
    ax = plot_trajectory(colony("acl_gym/Navigation-v0"), kind="plane", max_steps=3)
    path = ax.lines[0]
    assert (path.get_xdata()[0], path.get_ydata()[0]) == (-5.0, -5.0)


class Chooses:
    """A policy that returns the same for any observations."""

    def __init__(self, found: Any) -> None:
        self._found = found

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        return self._found, None


@pytest.mark.parametrize("found", [[1.7], ["a"], [7], [-1], [], None, [np.nan], [1, 1]])
def test_what_a_policy_returns_is_checked(found: Any) -> None:
    """1.7 would be drawn, and carried out, as the action 1."""
    policy, message = Chooses(found), r"model\.predict must return"
    car = gym.make("MountainCar-v0")
    for env in (car, gym.make_vec("MountainCar-v0", 3, vectorization_mode="sync")):
        with pytest.raises(ValueError, match=message):
            plot_trajectory(policy, env=env, max_steps=5)
    with pytest.raises(ValueError, match=message):
        plot_policy(policy, env=car)


def test_a_start_that_is_no_state_is_refused() -> None:
    vector = gym.make_vec("acl_gym/Pendulum-v0", 1)
    with pytest.raises(
        ValueError, match="start must be an array of finite real numbers"
    ):
        plot_trajectory(Chooses([0]), env=vector, start="rest")
