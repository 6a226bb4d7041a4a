"""The search: cities are looked at until none of them has a move that gains."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.local_search.exchanges import best_exchange
from acl_gym.colony.local_search.moves import TWO, apply, find_places
from acl_gym.colony.local_search.segments import best_insertion, best_segment_exchange
from acl_gym.envs.graph.lengths import tour_length
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray

TWO_OPT, OR_OPT, THREE_OPT = range(3)
DONE = -1
"""What `improve` returns where all rows are tours."""


@njit
def improve(
    tours: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    method: int,
    symmetric: bool,
    lengths: FloatArray,
) -> int:
    """Improve tours in place, each by itself, and fill in their lengths.

    The cities that wait are looked at in turn, first in the order of the tour. All
    others have their don't-look bit set; it is cleared where a move changed an arc.

    Args:
        tours: `(m, n)`.
        distances: `(n, n)`.
        neighbours: candidates of each city, nearest first, `(n, k)`.
        nearby: distances to them, `(n, k)`.
        method: `TWO_OPT`, `OR_OPT`, with 2-opt where symmetric, or `THREE_OPT`.
        symmetric: whether tours may be turned round; must be so for `TWO_OPT`.
        lengths: filled in, `(m,)`.

    Returns:
        `DONE`, or the first row that is no permutation: the search ended there.
    """
    n = tours.shape[1]
    places = np.empty(n, np.int32)
    kept = np.empty(n, np.int32)
    waiting = np.empty(n, np.int32)
    awake = np.empty(n, np.bool_)
    for row in range(len(tours)):
        tour = tours[row]
        if not find_places(tour, places):
            return row
        _improve_tour(
            tour,
            places,
            distances,
            neighbours,
            nearby,
            method,
            symmetric,
            kept,
            waiting,
            awake,
        )
        lengths[row] = tour_length(tour, distances)
    return DONE


@njit
def _improve_tour(
    tour: CellArray,
    places: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    method: int,
    symmetric: bool,
    kept: CellArray,
    waiting: CellArray,
    awake: BoolArray,
) -> None:
    """Make moves, in `tour` and `places`, until no city waits to be looked at.

    The other arguments are those of `improve`, and room for n cities each: `kept`,
    `waiting` and `awake`.
    """
    n = tour.size
    move = np.empty(6, np.int32)
    other = np.empty(6, np.int32)
    waiting[:] = tour
    awake[:] = True
    head, count = 0, n
    while count:
        t1 = waiting[head]
        found = True
        while found:
            found = False
            for direction in (-1, 1):
                gain = 0.0
                if method == OR_OPT and (symmetric or direction == -1):
                    gain = best_insertion(
                        tour,
                        places,
                        distances,
                        neighbours,
                        nearby,
                        symmetric,
                        t1,
                        direction,
                        move,
                    )
                if symmetric:
                    gain_of_other = best_exchange(
                        tour,
                        places,
                        distances,
                        neighbours,
                        nearby,
                        method == THREE_OPT,
                        t1,
                        direction,
                        other,
                    )
                    if gain_of_other > gain:
                        gain = gain_of_other
                        move[:] = other
                elif method == THREE_OPT and direction == 1:
                    gain = best_segment_exchange(
                        tour, places, distances, neighbours, nearby, t1, move
                    )
                if gain > 0.0:
                    apply(tour, places, t1, direction, move, kept)
                    found = True
                    for i in range(1, 4 if move[0] == TWO else 6):
                        city = move[i]
                        if not awake[city]:
                            awake[city] = True
                            waiting[(head + count) % n] = city
                            count += 1
        awake[t1] = False
        head += 1
        if head == n:
            head = 0
        count -= 1
