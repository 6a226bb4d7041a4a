"""Tours of a travelling salesman over the map of the cities, with pheromone on the arcs."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import ArrayLike

from acl_gym.agents.ant_agent import AntAgent
from acl_gym.envs.graph.cities import (
    UNNAMED,
    TravellingSalesmanInstance,
    checked_instance,
    checked_tours,
)
from acl_gym.envs.graph.pictures import checked_levels, places_of, strongest_arcs
from acl_gym.plotting import style
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_FAINTEST, _DARKEST = (
    0.92,
    0.35,
)  # grey of arcs with little pheromone, and with the most

_HEAD = 0.08
"""Length of an arrowhead, inches."""


def plot_tour(
    instance: TravellingSalesmanInstance | AntAgent,
    tour: ArrayLike | None = None,
    pheromone: Any = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a tour over the map, and below it the arcs with much pheromone in grey.

    Cities whose coordinates are unknown lie on a circle. Where roads are longer in one
    direction, arrowheads show that of the tour. The title tells the length of the tour
    and, where the optimum is known, by how much it exceeds that.

    Args:
        instance: the cities; or an `AntSystem`, `AntColonySystem` or `MaxMinAntSystem`
            that looks for their shortest tour: its best tour is then drawn, and its
            pheromone, where nothing else is given.
        tour: each city once, numbered from 0, `(n,)`; None draws the cities only.
        pheromone: levels on the arcs, >= 0, `(n, n)`, such as the table of a colony. Of
            each city the eight highest are drawn, the higher the darker.
        ax: where to draw; None makes a figure, see `plot_policy`.

    Returns:
        The axes.

    Raises:
        TypeError: `instance`, `pheromone` or `ax` is of the wrong kind.
        ValueError: the tour or the pheromone does not fit the instance, or an agent has
            none.
    """
    if isinstance(instance, AntAgent):
        agent, instance = instance, _instance_of(instance)
        tour = agent.best_tour if tour is None else tour
        pheromone = agent.table if pheromone is None else pheromone
    n_cities = checked_instance(instance).n_cities
    order = None if tour is None else checked_tours(tour, n_cities)
    if order is not None and order.ndim != 1:
        raise ValueError(
            f"tour must be one tour, shape ({n_cities},), got shape {order.shape}."
        )
    levels = None if pheromone is None else checked_levels(pheromone, n_cities)
    places = places_of(instance)
    size = float(np.clip(60.0 / np.sqrt(n_cities), 1.0, 5.0))
    with style.axes_or_new(ax, 4.6, 3.9) as ax:
        if levels is not None:
            arcs, shares = strongest_arcs(levels)
            greys = _FAINTEST + shares * (_DARKEST - _FAINTEST)
            lines = LineCollection(
                list(places[arcs]),
                colors=[str(grey) for grey in greys],
                linewidths=1.0,
                zorder=1.0,
            )
            ax.add_collection(lines)
        if order is not None:
            way = places[np.append(order, order[0])]
            ax.plot(*way.T, color=style.BLUE, linewidth=1.2, zorder=2.0)
            if not instance.symmetric:
                _draw_arrowheads(ax, way)
        ax.plot(
            *places.T,
            color="0.25",
            linestyle="",
            marker="o",
            markersize=size,
            zorder=3.0,
        )
        ax.set_aspect("equal")
        ax.grid(visible=False)
        ax.set_xticks([])
        ax.set_yticks([])
        ax.spines[:].set_visible(False)
        ax.set_title(_title(instance, order))
    return ax


def _instance_of(agent: AntAgent) -> TravellingSalesmanInstance:
    if agent.instance is None:
        raise ValueError(
            "an agent must have the travelling salesman's environment for a picture of "
            f"its tour, got {validation.shown(agent)}; call set_env(env), or pass the "
            "instance and the tour."
        )
    return agent.instance


def _draw_arrowheads(ax: Axes, way: FloatArray) -> None:
    """A small arrowhead in the middle of each arc that has a length in the picture."""
    arcs = np.diff(way, axis=0)
    sizes = np.hypot(*arcs.T)
    shown = sizes > 0.0
    middles = (0.5 * (way[1:] + way[:-1]))[shown]
    directions = arcs[shown] / sizes[shown, None]
    ax.quiver(
        *middles.T,
        *directions.T,
        angles="xy",
        units="inches",
        scale_units="inches",
        scale=1.0 / _HEAD,  # as long as its head
        width=_HEAD / 5.0,
        headwidth=4.0,
        headlength=5.0,
        headaxislength=5.0,
        pivot="mid",
        color=style.BLUE,
        zorder=2.5,
    )


def _title(instance: TravellingSalesmanInstance, order: Any) -> str:
    name = "" if instance.name in UNNAMED else instance.name
    if order is None:
        return name
    length, best = instance.length(order), instance.optimum
    title = f"{name}: {length:,.6g}" if name else f"tour of length {length:,.6g}"
    if best and length == best:
        title += ", the optimum"
    elif best:
        title += f", {100.0 * (length / best - 1.0):.1f}% above the optimum"
    return title
