"""The picture of a tour: the cities, the way so far, and the pheromone on the arcs."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.graph.pictures import checked_levels, places_of, strongest_arcs
from acl_gym.envs.graph.travelling_salesman.kernels import (
    ARCS,
    FIRST,
    HERE,
    RANKS,
    UNVISITED,
)
from acl_gym.envs.graph.travelling_salesman.system import TravellingSalesman
from acl_gym.utils.typing import FloatArray, IntArray

_PAPER = (255, 255, 255)
_CITY = (64, 64, 68)
_FIRST = (0, 158, 115)
_ANT = (213, 94, 0)
_TOUR = (0, 114, 178)
_FAINTEST, _DARKEST = 235, 110  # grey of arcs with little pheromone, and with the most

_MARGIN = 0.06  # of the side of the picture


class TravellingSalesmanPainter(Painter[TravellingSalesman]):
    """Draws the cities, the tour so far, its first city (green) and the ant (orange).

    Args:
        system: what is drawn.
    """

    def __init__(self, system: TravellingSalesman) -> None:
        super().__init__(system)
        places = places_of(system.cities)
        low, high = places.min(axis=0), places.max(axis=0)
        span = float((high - low).max()) or 1.0
        # One scale for both axes, centred; y grows upwards.
        shares = 0.5 + (places - 0.5 * (low + high)) / span * (1.0 - 2.0 * _MARGIN)
        self._shares = np.stack([shares[:, 0], 1.0 - shares[:, 1]], axis=1)

    def draw(
        self, pygame: Any, canvas: Any, state: FloatArray, action: int | None
    ) -> None:
        """See `Painter.draw`."""
        size = canvas.get_width()
        pixels = np.rint(self._shares * size).astype(np.int64)
        canvas.fill(_PAPER)
        way = tour_so_far(state)
        if way.size > 1:
            points = [tuple(pixel) for pixel in pixels[way].tolist()]
            pygame.draw.lines(canvas, _TOUR, False, points, max(2, size // 200))
        small = max(1, size // (120 if len(pixels) <= 500 else 480))
        for pixel in pixels.tolist():
            pygame.draw.circle(canvas, _CITY, pixel, small)
        for row, colour, radius in ((FIRST, _FIRST, 60), (HERE, _ANT, 80)):
            centre = pixels[int(state[row])].tolist()
            pygame.draw.circle(canvas, colour, centre, max(2, size // radius))

    def check_table(self, table: Any) -> None:
        """Refuse anything but a table of levels >= 0, `(n_cities, n_cities)`.

        Raises:
            TypeError: it is not a NumPy array.
            ValueError: it has another shape or holds negative or infinite values.
        """
        checked_levels(table, self.system.n_cities)

    def draw_table(self, pygame: Any, canvas: Any, table: FloatArray) -> None:
        """Draw the arcs with the highest levels of each city, the higher the darker."""
        self.check_table(table)
        size = canvas.get_width()
        pixels = np.rint(self._shares * size).astype(np.int64).tolist()
        arcs, shares = strongest_arcs(table)
        greys = (_FAINTEST + shares * (_DARKEST - _FAINTEST)).astype(np.int64).tolist()
        thin = max(1, size // 480)
        for (tail, head), grey in zip(arcs.tolist(), greys, strict=True):
            colour = (grey, grey, grey)
            pygame.draw.line(canvas, colour, pixels[tail], pixels[head], thin)


def tour_so_far(state: FloatArray) -> IntArray:
    """The cities of a state in the order of the visits, the first one again at the end.

    Args:
        state: `(3 + n_cities,)`.
    """
    ranks = state[RANKS:]
    visited = np.flatnonzero(ranks != UNVISITED)
    way = visited[np.argsort(ranks[visited])]
    if int(state[ARCS]) == ranks.size:
        way = np.append(way, way[0])
    return way
