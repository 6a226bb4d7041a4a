"""Moves where distances are symmetric: two or three arcs are replaced by others."""

from __future__ import annotations

from acl_gym.colony.local_search.moves import (
    BOTH_REVERSED,
    EXCHANGED,
    NONE,
    REVERSED,
    TOLERANCE,
    TWO,
    ahead,
    beside,
)
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray


@njit
def best_exchange(
    tour: CellArray,
    places: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    three: bool,
    t1: int,
    direction: int,
    move: CellArray,
) -> float:
    """The 2-opt or 3-opt move that gains most, of those that begin with one arc.

    The arcs t1-t2, t3-t4 and t5-t6 are replaced by t2-t3, t4-t5 and t6-t1. The arcs of
    any move that gains can be numbered such that each partial sum of what is removed
    less what is added is positive: other numberings are not followed.

    Args:
        tour: the tour.
        places: where its cities are.
        distances: `(n, n)`, symmetric.
        neighbours: candidates of each city, nearest first, `(n, k)`.
        nearby: distances to them, `(n, k)`.
        three: whether a third arc may be replaced.
        t1: where the first arc begins.
        direction: where its other end t2 is, 1 ahead or -1 behind.
        move: filled in with the kind of move and t2 to t6.

    Returns:
        The gain, 0 where no move gains.
    """
    n = tour.size
    k = neighbours.shape[1]
    best = 0.0
    move[0] = NONE
    t2 = beside(tour, places, t1, direction)
    removed1 = distances[t1, t2]
    for i in range(k):
        gain1 = removed1 - nearby[t2, i]
        if gain1 <= 0.0:
            break
        t3 = neighbours[t2, i]
        o3 = ahead(places, t2, t3, direction)
        if o3 == 1 or o3 == n - 1:  # they are neighbours in the tour
            continue
        # With t4 before t3, the arc t4-t1 closes a tour.
        t4 = beside(tour, places, t3, -direction)
        removed = distances[t3, t4]
        gain2 = gain1 + removed
        total = removed1 + removed
        gain = gain2 - distances[t4, t1]
        if gain > best and gain > TOLERANCE * total:
            best = gain
            move[0], move[1], move[2], move[3] = TWO, t2, t3, t4
        if not three:
            continue
        for j in range(k):
            gain3 = gain2 - nearby[t4, j]
            if gain3 <= 0.0:
                break
            t5 = neighbours[t4, j]
            o5 = ahead(places, t2, t5, direction)
            if o5 <= o3 - 3:
                t6 = beside(tour, places, t5, direction)
            elif o3 < o5 < n - 1:
                t6 = beside(tour, places, t5, -direction)
            else:
                continue
            removed = distances[t5, t6]
            gain = gain3 + removed - distances[t6, t1]
            if gain > best and gain > TOLERANCE * (total + removed):
                best = gain
                move[0], move[1], move[2], move[3] = REVERSED, t2, t3, t4
                move[4], move[5] = t5, t6
        # With t4 behind t3 it would close two tours: the third arc joins them.
        t4 = beside(tour, places, t3, direction)
        removed = distances[t3, t4]
        gain2 = gain1 + removed
        total = removed1 + removed
        for j in range(k):
            gain3 = gain2 - nearby[t4, j]
            if gain3 <= 0.0:
                break
            t5 = neighbours[t4, j]
            o5 = ahead(places, t2, t5, direction)
            if o5 >= o3:
                continue
            t6 = beside(tour, places, t5, direction)
            removed = distances[t5, t6]
            gain = gain3 + removed - distances[t6, t1]
            if gain > best and gain > TOLERANCE * (total + removed):
                best = gain
                move[0], move[1], move[2], move[3] = EXCHANGED, t2, t3, t4
                move[4], move[5] = t5, t6
            if o5 < 2:
                continue
            t6 = beside(tour, places, t5, -direction)
            removed = distances[t5, t6]
            gain = gain3 + removed - distances[t6, t1]
            if gain > best and gain > TOLERANCE * (total + removed):
                best = gain
                move[0], move[1], move[2], move[3] = BOTH_REVERSED, t2, t3, t4
                move[4], move[5] = t5, t6
    return best
