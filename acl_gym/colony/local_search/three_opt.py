"""3-opt where distances are symmetric: all ways to replace two or three arcs."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.local_search.moves import (
    TOLERANCE,
    ahead,
    beside,
    exchange_segments,
    exchange_two,
    find_places,
    length_of,
    wake,
)
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray

NONE, TWO, REVERSED, EXCHANGED, BOTH_REVERSED = range(5)


@njit
def _best_move(
    tour: CellArray,
    places: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    t1: int,
    direction: int,
    move: CellArray,
) -> float:
    """The largest gain of the moves that begin with the arc from t1 in a direction.

    The arcs t1-t2, t3-t4 and t5-t6 are replaced by t2-t3, t4-t5 and t6-t1. Of any move
    that gains, the arcs can be numbered such that each partial sum of what is removed
    less what is added is positive: other numberings are not followed.
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
        if o3 == 1 or o3 == n - 1:
            continue
        # t4 before t3: t1-t4 closes a tour.
        t4 = beside(tour, places, t3, -direction)
        removed = distances[t3, t4]
        gain2 = gain1 + removed
        total = removed1 + removed
        gain = gain2 - distances[t4, t1]
        if gain > best and gain > TOLERANCE * total:
            best = gain
            move[0], move[1], move[2], move[3] = TWO, t2, t3, t4
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
        # t4 behind t3: t1-t4 would close two tours, which the third arc joins.
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


@njit
def _apply(
    tour: CellArray,
    places: CellArray,
    t1: int,
    direction: int,
    move: CellArray,
    kept: CellArray,
) -> None:
    kind, t2, t3, t4, t5, t6 = move
    if kind == EXCHANGED:
        left = ahead(places, t2, t5, direction) + 1
        right = ahead(places, t6, t3, direction) + 1
        if direction == 1:
            exchange_segments(tour, places, places[t2], left, right, kept)
        else:
            exchange_segments(tour, places, places[t3], right, left, kept)
    elif kind == BOTH_REVERSED:
        exchange_two(tour, places, t1, t2, t5, t6)
        exchange_two(tour, places, t2, t5, t4, t3)
    else:
        exchange_two(tour, places, t1, t2, t3, t4)
        if kind == REVERSED:
            exchange_two(tour, places, t1, t4, t5, t6)


@njit
def improve_by_three(
    tours: CellArray,
    distances: FloatArray,
    neighbours: CellArray,
    nearby: FloatArray,
    lengths: FloatArray,
) -> int:
    """Improve tours in place and fill in their lengths; -1, or a tour that is none."""
    n = tours.shape[1]
    places = np.empty(n, np.int32)
    kept = np.empty(n, np.int32)
    waiting = np.empty(n, np.int32)
    awake = np.empty(n, np.bool_)
    move = np.empty(6, np.int32)
    for row in range(len(tours)):
        tour = tours[row]
        if not find_places(tour, places):
            return row
        waiting[:] = tour
        awake[:] = True
        head, count = 0, n
        while count:
            t1 = waiting[head]
            improved = True
            while improved:
                improved = False
                for direction in (1, -1):
                    gain = _best_move(
                        tour, places, distances, neighbours, nearby, t1, direction, move
                    )
                    if gain > 0.0:
                        _apply(tour, places, t1, direction, move, kept)
                        improved = True
                        for i in range(1, 6 if move[0] > TWO else 4):
                            count = wake(waiting, awake, head, count, move[i])
            awake[t1] = False
            head += 1
            if head == n:
                head = 0
            count -= 1
        lengths[row] = length_of(tour, distances)
    return -1
