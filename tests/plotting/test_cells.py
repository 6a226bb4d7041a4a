"""Numbered states: rows, maps and shapes."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym.plotting import plot_pheromone, plot_policy, plot_trajectory
from tests.plotting.agents import colony, q_learning


def quiver(ax: Any) -> Any:
    (found,) = [c for c in ax.collections if type(c).__name__ == "Quiver"]
    return found


def test_a_grid_search_has_walls_and_arrows() -> None:
    agent = colony("acl_gym/GridSearch2D-v0")
    system = agent.env.unwrapped.system
    ax = plot_policy(agent)
    walls = "".join(system.rows).count("#")
    dark = [p for p in ax.patches if p.get_facecolor()[:3] == (0.25, 0.25, 0.25)]
    assert len(dark) == walls
    arrows = system.n_states - 1
    assert quiver(ax).U.size == arrows
    levels = plot_pheromone(agent).images[0].get_array()
    assert np.isfinite(levels.filled(np.nan)).sum() == arrows


def test_a_policy_of_its_own_is_drawn_with_the_map_of_an_env() -> None:
    agent = colony("acl_gym/GridSearch2D-v0")
    single = gym.make("acl_gym/GridSearch2D-v0")
    arrows = agent.partition.n_cells - 1  # none at the goal
    assert quiver(plot_policy(agent.policy, env=single)).U.size == arrows
    bare = plot_policy(agent.policy)
    assert bare.images[0].get_array().shape == (4, 25)  # 87 states in rows of 25


def test_the_lake_has_its_holes() -> None:
    agent = colony("FrozenLake-v1", deposit="return")
    ax = plot_policy(agent)
    assert sorted(text.get_text() for text in ax.texts) == ["goal", *["hole"] * 4]
    assert quiver(ax).U.size == 16 - 5
    best = agent.policy.best_actions()
    left = (quiver(ax).U == -1) & (quiver(ax).V == 0)
    desc = np.asarray(gym.make("FrozenLake-v1").unwrapped.desc).ravel()
    walkable = ~np.isin(desc, [b"H", b"G"])
    assert (left == (best[walkable] == 0)).all()  # action 0 is left


def test_other_numbered_states_are_rows_or_a_shape() -> None:
    agent = q_learning("Taxi-v4" if "Taxi-v4" in gym.registry else "Taxi-v3")
    assert plot_policy(agent).images[0].get_array().shape == (20, 25)
    ax = plot_pheromone(agent, shape=(25, 20))
    assert ax.images[0].get_array().shape == (25, 20)
    row = colony("acl_gym/TwoState-v0")
    assert plot_policy(row).images[0].get_array().shape == (1, 3)


@pytest.mark.parametrize("shape", [(1, 2), (2.0, 2), "12", 3, (3, 1, 1), (0, 3)])
def test_shapes_that_do_not_fit_are_refused(shape: Any) -> None:
    with pytest.raises(ValueError, match="shape must be two integers >= 1"):
        plot_policy(colony("acl_gym/TwoState-v0"), shape=shape)


def test_a_path_goes_from_cell_to_cell() -> None:
    agent = colony("acl_gym/GridSearch1D-v0")
    ax = plot_trajectory(agent, kind="plane", start=[4.0], max_steps=3)
    x = ax.lines[-3].get_xdata()
    assert x[0] == 4.0
    assert set(np.abs(np.diff(x))) <= {0.0, 1.0}
