"""Tours over the map."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from acl_gym import AntColonySystem, AntSystem, MaxMinAntSystem
from acl_gym.envs.graph import (
    TravellingSalesmanInstance,
    load_instance,
    optimal_tour,
)
from acl_gym.plotting import plot_tour

ATT48, WAY = load_instance("att48"), optimal_tour("att48")


def test_the_tour_is_closed_and_the_title_tells_its_length() -> None:
    ax = plot_tour(ATT48, WAY)
    line, cities = ax.lines
    assert ATT48.coordinates is not None
    np.testing.assert_array_equal(
        np.transpose(line.get_data()), ATT48.coordinates[[*WAY, WAY[0]]]
    )
    assert len(cities.get_xdata()) == 48
    title = ax.get_title(loc="left") or ax.get_title()
    assert title == "att48: 10,628, the optimum"
    ax.figure.canvas.draw()
    longer = [*WAY[1:2], *WAY[:1], *WAY[2:]]
    title = plot_tour(ATT48, longer).get_title(loc="left")
    assert title.startswith("att48: 1")
    assert title.endswith("% above the optimum")


def test_pheromone_lies_below_the_tour() -> None:
    pheromone = 1.0 / (ATT48.distances + np.eye(48))
    figure = Figure()
    ax = figure.subplots()
    assert plot_tour(ATT48, WAY, pheromone, ax) is ax
    (arcs,) = (each for each in ax.collections if isinstance(each, LineCollection))
    assert len(arcs.get_segments()) <= 8 * 48
    assert arcs.get_zorder() < ax.lines[0].get_zorder()
    figure.savefig("/dev/null", format="png")


def test_cities_alone_and_without_an_optimum() -> None:
    instance = TravellingSalesmanInstance.from_distances(np.ones((4, 4)), name="four")
    ax = plot_tour(instance, None)
    assert len(ax.lines) == 1
    assert (ax.get_title(loc="left") or ax.get_title()) == "four"
    ax = plot_tour(instance, [0, 1, 2, 3])
    assert (ax.get_title(loc="left") or ax.get_title()) == "four: 4"


def test_arrowheads_only_where_directions_count() -> None:
    one_way = TravellingSalesmanInstance.from_distances(
        np.arange(16.0).reshape(4, 4),
        # Between two cities at the same place there is nothing to point at.
        coordinates=[[0, 0], [0, 0], [3, 0], [0, 2]],
    )
    ax = plot_tour(one_way, [0, 1, 2, 3])
    (heads,) = (each for each in ax.collections if isinstance(each, Quiver))
    # In the middle of the ways from city 1 to 2, to 3 and back to 0.
    np.testing.assert_allclose(heads.XY, [[1.5, 0.0], [1.5, 1.0], [0.0, 1.0]])
    directions = np.array([[3.0, 0.0], [-3.0, 2.0], [0.0, -2.0]])
    directions /= np.hypot(*directions.T)[:, None]
    np.testing.assert_allclose(np.column_stack([heads.U, heads.V]), directions)
    ax.figure.canvas.draw()
    for ax in (plot_tour(ATT48, WAY), plot_tour(one_way)):
        assert not any(isinstance(each, Quiver) for each in ax.collections)


def test_the_title_without_a_name() -> None:
    places = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    instance = TravellingSalesmanInstance.from_coordinates(places)
    ax = plot_tour(instance, [0, 1, 2])
    assert (ax.get_title(loc="left") or ax.get_title()) == "tour of length 3.41421"
    ax = plot_tour(instance)
    assert (ax.get_title(loc="left") or ax.get_title()) == ""


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("att48", WAY), TypeError, "instance must be a TravellingSalesmanInstance"),
        ((ATT48, [0, 1]), ValueError, "tour must hold"),
        ((ATT48, [WAY, WAY]), ValueError, r"one tour, shape \(48,\)"),
        ((ATT48, WAY, np.ones((2, 2))), ValueError, r"shape \(48, 48\)"),
        ((ATT48, WAY, [[1.0]]), TypeError, "must be a NumPy array"),
        ((ATT48, WAY, None, "axes"), TypeError, "ax must be Matplotlib axes"),
    ],
)
def test_mistakes(
    arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        plot_tour(*arguments)


@pytest.mark.parametrize("kind", [AntSystem, AntColonySystem, MaxMinAntSystem])
def test_an_agent_shows_its_best_tour_and_its_pheromone(kind: Any) -> None:
    env = gym.make_vec("acl_gym/TravellingSalesman-v0", num_envs=10)
    agent = kind(env, seed=0)
    ax = plot_tour(agent)
    assert len(ax.lines) == 1  # the cities; there is no tour yet
    agent.learn(trials=3)
    ax = plot_tour(agent)
    line, _ = ax.lines
    tour, places = agent.best_tour, ATT48.coordinates
    assert places is not None
    np.testing.assert_array_equal(
        np.transpose(line.get_data()), places[[*tour, tour[0]]]
    )
    (arcs,) = (each for each in ax.collections if isinstance(each, LineCollection))
    (expected,) = plot_tour(ATT48, None, agent.table).collections
    assert isinstance(expected, LineCollection)
    np.testing.assert_array_equal(arcs.get_segments(), expected.get_segments())
    assert f"att48: {agent.best_cost:,.6g}" in (
        ax.get_title(loc="left") + ax.get_title()
    )
    # What is given goes before what the agent has.
    line, _ = plot_tour(agent, WAY).lines
    np.testing.assert_array_equal(np.transpose(line.get_data()), places[[*WAY, WAY[0]]])


def test_an_agent_of_another_task_has_no_map() -> None:
    agent = AntSystem(gym.make_vec("acl_gym/DoubleBridge-v0", num_envs=2), seed=0)
    with pytest.raises(ValueError, match="an agent must have the travelling salesman"):
        plot_tour(agent)
