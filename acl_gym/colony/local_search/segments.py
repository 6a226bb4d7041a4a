"""Moves of segments: up to three cities go elsewhere, or two segments change places.

The moves that keep the direction of all cities work where distances are asymmetric.
"""

from __future__ import annotations

from acl_gym.colony.local_search.moves import (
    EXCHANGED,
    NONE,
    REVERSED,
    TOLERANCE,
    ahead,
    beside,
)
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray, FloatArray

LONGEST = 3
"""Cities of the longest segment that Or-opt moves."""


@njit
def best_insertion(
    tour: CellArray,
    places: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    reversing: bool,
    t1: int,
    direction: int,
    move: CellArray,
) -> float:
    """The Or-opt move that gains most, of the segments that begin beside a city.

    The segment t2 to t5 is taken out from between t1 and t6 and put between t3 and t4,
    t2 beside t3, which must be nearer to it than t1.

    Args:
        tour: the tour.
        places: where its cities are.
        distances: `(n, n)`.
        neighbours: candidates of each city, nearest first, `(n, k)`.
        nearby: distances to them, `(n, k)`.
        reversing: whether a segment may be turned round. Where not, distances may be
            asymmetric, and the direction must be -1: t2 leads to t1.
        t1: the city beside the segment.
        direction: where the segment is, 1 ahead or -1 behind.
        move: filled in with the kind of move and t2 to t6.

    Returns:
        The gain, 0 where no move gains.
    """
    n = tour.size
    best = 0.0
    move[0] = NONE
    t2 = beside(tour, places, t1, direction)
    removed1 = distances[t2, t1]
    t5 = t2
    for length in range(1, min(LONGEST, n - 3) + 1):
        if length > 1:
            t5 = beside(tour, places, t5, direction)
        t6 = beside(tour, places, t5, direction)
        removed2 = distances[t6, t5]
        freed = removed1 + removed2 - distances[t6, t1]
        for i in range(neighbours.shape[1]):
            if nearby[t2, i] >= removed1:
                break
            t3 = neighbours[t2, i]
            o3 = ahead(places, t2, t3, direction)
            if o3 < length:  # it is in the segment
                continue
            # t3 is not t1, which is no nearer, so that t4 is outside, too.
            t4 = beside(tour, places, t3, direction)
            removed3 = distances[t4, t3]
            gain = freed + removed3 - nearby[t2, i] - distances[t4, t5]
            total = removed1 + removed2 + removed3
            if gain > best and gain > TOLERANCE * total:
                best = gain
                move[0], move[1], move[2], move[3] = EXCHANGED, t2, t3, t4
                move[4], move[5] = t5, t6
            if not reversing or o3 == length:  # t3 is t6: only t5 is before it
                continue
            t4 = beside(tour, places, t3, -direction)
            removed3 = distances[t3, t4]
            gain = freed + removed3 - nearby[t2, i] - distances[t4, t5]
            total = removed1 + removed2 + removed3
            if gain > best and gain > TOLERANCE * total:
                best = gain
                move[0], move[1], move[2], move[3] = REVERSED, t2, t3, t4
                move[4], move[5] = t5, t6
    return best


@njit
def best_segment_exchange(
    tour: CellArray,
    places: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    t1: int,
    move: CellArray,
) -> float:
    """The 3-opt move that gains most and turns nothing round, of one city's.

    The arcs t1-t2, t5-t6 and t3-t4, in the order of the tour, are replaced by t1-t6,
    t5-t4 and t3-t2: the segments t2 to t5 and t6 to t3 change places. Numberings of
    the arcs are followed as in `best_exchange`.

    Args:
        tour: the tour.
        places: where its cities are.
        distances: `(n, n)`, symmetric or not.
        neighbours: candidates of each city, nearest first, `(n, k)`.
        nearby: distances to them, `(n, k)`.
        t1: where the first arc begins.
        move: filled in with the kind of move and t2 to t6.

    Returns:
        The gain, 0 where no move gains.
    """
    k = neighbours.shape[1]
    best = 0.0
    move[0] = NONE
    t2 = beside(tour, places, t1, 1)
    removed1 = distances[t1, t2]
    for i in range(k):
        gain1 = removed1 - nearby[t1, i]
        if gain1 <= 0.0:
            break
        t6 = neighbours[t1, i]
        o6 = ahead(places, t2, t6, 1)
        if o6 == 0:
            continue
        t5 = beside(tour, places, t6, -1)
        removed2 = distances[t5, t6]
        gain2 = gain1 + removed2
        for j in range(k):
            gain3 = gain2 - nearby[t5, j]
            if gain3 <= 0.0:
                break
            t4 = neighbours[t5, j]
            if ahead(places, t2, t4, 1) <= o6:
                continue
            t3 = beside(tour, places, t4, -1)
            removed3 = distances[t3, t4]
            gain = gain3 + removed3 - distances[t3, t2]
            total = removed1 + removed2 + removed3
            if gain > best and gain > TOLERANCE * total:
                best = gain
                move[0], move[1], move[2], move[3] = EXCHANGED, t2, t3, t4
                move[4], move[5] = t5, t6
    return best
