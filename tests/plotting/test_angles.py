"""Pictures of policies whose grids make one variable of a cosine and a sine."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from acl_gym import ACL, Crisp, Fuzzy
from acl_gym.agents.notebook import page_of
from acl_gym.envs.control.signals import Signals
from acl_gym.partitions import Grid
from acl_gym.plotting import animate, plot_pheromone, plot_policy, plot_trajectory
from acl_gym.plotting.subject import subject_of
from acl_gym.policies import TablePolicy
from tests.plotting.test_maps import mesh

ANGLES = [(0, 1), (2, 3)]  # of Acrobot-v1, before two velocities


def acrobot(kind: type[Grid] = Fuzzy) -> ACL:
    env = gym.make_vec("Acrobot-v1", num_envs=3)
    circle = np.linspace(-np.pi, np.pi, 6, endpoint=False)
    grid = kind([circle, circle + 0.5, [-4, 0, 4], [-9, 0, 9]], angles=ANGLES)
    return ACL(env, grid, seed=0, max_steps=20).learn(trials=2)


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_a_map_over_two_angles(kind: type[Grid]) -> None:
    agent = acrobot(kind)
    ax = plot_policy(agent, slice={"state 5": 2.0})
    assert ax.get_xlabel() == "angle 1 (rad)"
    assert ax.get_ylabel() == "angle 3 (rad)"
    assert ax.get_xlim() == pytest.approx((-np.pi, np.pi))
    assert ax.get_ylim() == pytest.approx((-np.pi + 0.5, np.pi + 0.5))
    assert "at state 5 = 2, state 6 = 0 (middle)" in ax.get_title(loc="left")
    edges = [mesh(ax).get_coordinates()[0, :, 0], mesh(ax).get_coordinates()[:, 0, 1]]
    x, y = np.meshgrid(*((line[1:] + line[:-1]) / 2 for line in edges))
    fixed = [np.full(x.shape, 2.0), np.zeros(x.shape)]
    seen = np.stack([np.cos(x), np.sin(x), np.cos(y), np.sin(y), *fixed], axis=-1)
    actions = agent.predict(seen.reshape(-1, 6))[0]
    # Names of actions have no order of their own, so places are actions.
    assert np.asarray(mesh(ax).get_array()).ravel().tolist() == actions.tolist()
    assert len(np.unique(actions)) > 1


def test_bounds_are_those_of_the_column_that_shows_a_variable() -> None:
    """The velocities, numbers 4 and 5 of an observation, have bounds 4 pi and 9 pi."""
    ax = plot_pheromone(acrobot(), axes=(2, 3))
    assert ax.get_xlim() == pytest.approx((-4 * np.pi, 4 * np.pi))
    assert ax.get_ylim() == pytest.approx((-9 * np.pi, 9 * np.pi))
    assert "at angle 1 = 0 rad, angle 3 = 0.5 rad" in ax.get_title(loc="left")


def test_a_curve_over_an_angle() -> None:
    grid = Crisp([[-1.0, 2.0]], angles=[(1, 0)])  # borders at 0.5 and at 0.5 - pi
    ax = plot_policy(TablePolicy(grid, np.eye(2)))
    assert ax.get_xlabel() == "angle 2 (rad)"
    (steps,) = ax.patches
    values, edges, _ = steps.get_data()  # type: ignore[attr-defined]
    assert edges == pytest.approx([-1.0, 0.5, 0.5 + np.pi, 2 * np.pi - 1.0])
    assert values.tolist() == [0, 1, 0]


def test_episodes_are_drawn_as_angles() -> None:
    agent = acrobot()
    panels = plot_trajectory(agent, seed=3, max_steps=30)
    names = [panel.get_ylabel() for panel in panels]
    assert names == ["angle 1 (rad)", "angle 3 (rad)", "state 5", "state 6", "action"]
    drawn = np.array([panel.lines[0].get_ydata() for panel in panels[:4]])
    env: Any = agent.env
    first = env.reset(seed=3)[0][0].astype(np.float64)
    start = [np.arctan2(first[1], first[0]), np.arctan2(first[3], first[2]), *first[4:]]
    assert drawn[:, 0] == pytest.approx(start)
    # Small at the start, the angles go on without jumps.
    assert np.abs(np.diff(drawn[:2], axis=1)).max() < np.pi
    ax = plot_trajectory(agent, kind="plane", seed=3, max_steps=30)
    path = np.array(ax.lines[0].get_data())
    assert path[:, 0] == pytest.approx(start[:2])


def test_values_are_within_the_axes_of_a_picture() -> None:
    grid = Fuzzy([[1.0, 3.0, 5.0], [0.0, 1.0]], angles=[(0, 2)])
    subject = subject_of(TablePolicy(grid, np.ones((6, 2))))
    turn = np.array([1.0, 3.5, 7.0])  # 1 to 1 + 2 pi
    seen = np.stack([np.cos(turn), [0.1, 0.2, 0.3], np.sin(turn)], axis=1)
    assert np.allclose(
        subject.values(seen), np.stack([turn, [0.1, 0.2, 0.3]], axis=1), atol=1e-12
    )
    assert np.allclose(subject.observations(subject.values(seen)), seen)


def test_names_of_signals_and_of_the_user() -> None:
    class Named(gym.Env[Any, Any]):
        observation_space = spaces.Box(-1.0, 1.0, (3,))
        action_space = spaces.Discrete(2)

    grid = Fuzzy([[0.0, 1.0], [0.0, 2.0]], angles=[(2, 1)])
    policy = TablePolicy(grid, np.ones((4, 2)))
    own = subject_of(policy, Named())
    assert [v.name for v in own.variables] == ["state 1", "angle 3 (rad)"]
    given = subject_of(policy, Named(), labels={1: "tilt (rad)"})
    assert [v.name for v in given.variables] == ["state 1", "tilt (rad)"]
    with pytest.raises(ValueError, match="labels must be 2 names"):
        subject_of(policy, Named(), labels=["a", "b", "c"])


def test_names_of_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("speed, m/s", "sin theta", "cos theta")
    signals = Signals(names, ("force, N",), ((-1.0,), (1.0,)))
    monkeypatch.setattr("acl_gym.plotting.subject.signals_of", lambda env: signals)
    grid = Fuzzy([[0.0, 1.0], [0.0, 2.0]], angles=[(2, 1)])
    env = gym.make_vec("CartPole-v1", num_envs=1)
    env.single_observation_space = spaces.Box(-1.0, 1.0, (3,))
    subject = subject_of(TablePolicy(grid, np.ones((4, 2))), env)
    assert [v.name for v in subject.variables] == [
        "speed (m/s)",
        "angle of cos theta (rad)",
    ]
    assert subject.variables[1].symbol == "theta"


def test_a_film(tmp_path: Any) -> None:
    path = animate(acrobot(), tmp_path / "a.gif", seconds=0.3, dpi=30)
    assert path.stat().st_size > 0


def test_notebooks_name_the_angles() -> None:
    agent = acrobot()
    page = page_of(agent, agent.policy.best_actions(), [])
    assert "variables 1 (angle) and 2 (angle), others in the middle" in page
    table = agent.partition._repr_html_()
    assert "angle, from observations 1 and 2" in table
    assert "angle, from observations 3 and 4" in table
    assert "observation 6" in table
    assert "observation" not in Fuzzy([[0.0, 1.0]] * 2)._repr_html_()
