"""What all local searches do to a tour: kernels on an array of cities and their places.

`tour[p]` is the city at place p, `places[c]` the place of city c. Places go round, so
that the last is followed by the first. A tour may be walked forwards (`direction` 1) or
backwards (-1); where distances are symmetric, it is the same tour.
"""

from __future__ import annotations

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import CellArray

NONE, TWO, REVERSED, EXCHANGED, BOTH_REVERSED = range(5)
"""Kinds of moves, see `apply`."""

TOLERANCE = 1e-12
"""A move must gain more than this share of what it removes.

Rounding is a thousand times smaller, so that each move makes the tour shorter indeed,
and a search among ties comes to an end.
"""


@njit
def beside(tour: CellArray, places: CellArray, city: int, direction: int) -> int:
    """The next city in a direction, 1 or -1."""
    place = places[city] + direction
    if place == tour.size:
        place = 0
    elif place < 0:
        place = tour.size - 1
    other: int = tour[place]
    return other


@njit
def ahead(places: CellArray, start: int, city: int, direction: int) -> int:
    """Steps from one city to another in a direction, 0 to n - 1."""
    steps: int = direction * (places[city] - places[start])
    return steps + places.size if steps < 0 else steps


@njit
def reverse(tour: CellArray, places: CellArray, first: int, last: int) -> None:
    """Turn round the path from one place forwards to another.

    Turning round all others instead gives the same tour, walked the other way: the
    shorter of both is done.
    """
    n = tour.size
    length = last - first
    if length < 0:
        length += n
    length += 1
    if 2 * length > n:
        first, last = last + 1, first - 1
        if first == n:
            first = 0
        if last < 0:
            last = n - 1
        length = n - length
    for _ in range(length // 2):
        left, right = tour[first], tour[last]
        tour[first], tour[last] = right, left
        places[right], places[left] = first, last
        first += 1
        if first == n:
            first = 0
        last -= 1
        if last < 0:
            last = n - 1


@njit
def exchange_two(
    tour: CellArray, places: CellArray, a: int, b: int, c: int, d: int
) -> None:
    """Replace the arcs a-b and d-c by b-c and d-a: a 2-opt move.

    In the direction in which b follows a, c follows d.
    """
    if beside(tour, places, a, 1) == b:
        reverse(tour, places, places[b], places[d])
    else:
        reverse(tour, places, places[d], places[b])


@njit
def exchange_segments(
    tour: CellArray,
    places: CellArray,
    first: int,
    left: int,
    right: int,
    kept: CellArray,
) -> None:
    """Let two neighbouring segments change places; the direction of each stays.

    The tour is these two and the rest of it, and each pair of the three may be
    exchanged with the same result: the longest stays where it is.

    Args:
        tour: changed in place.
        places: changed in place.
        first: place where the left segment begins.
        left: its number of cities.
        right: number of cities of the segment behind it.
        kept: room for n cities.
    """
    n = tour.size
    rest = n - left - right
    if left > right and left > rest:
        first, left, right = first + left, right, rest
    elif right > rest:  # the rest and the left segment, then
        first, left, right = first + left + right, rest, left
    if first >= n:
        first -= n
    place = first
    for i in range(left):
        kept[i] = tour[place]
        place += 1
        if place == n:
            place = 0
    to = first
    for _ in range(right):
        city = tour[place]
        tour[to] = city
        places[city] = to
        place += 1
        if place == n:
            place = 0
        to += 1
        if to == n:
            to = 0
    for i in range(left):
        city = kept[i]
        tour[to] = city
        places[city] = to
        to += 1
        if to == n:
            to = 0


@njit
def apply(
    tour: CellArray,
    places: CellArray,
    t1: int,
    direction: int,
    move: CellArray,
    kept: CellArray,
) -> None:
    """Replace the arcs t1-t2, t3-t4 and t5-t6 by t2-t3, t4-t5 and t6-t1.

    Walked in the direction in which t2 follows t1, the tour becomes, by kind:

    - `TWO`: t1, t4 .. t2, t3, two arcs only.
    - `EXCHANGED`: t1, t6 .. t3, t2 .. t5, t4.
    - `BOTH_REVERSED`: t1, t6 .. t2, t3 .. t5, t4.
    - `REVERSED`: t1, t6 .. t4, t5 .. t2, t3 or t1, t6 .. t3, t2 .. t4, t5.

    Args:
        tour: changed in place.
        places: changed in place.
        t1: where the first arc begins.
        direction: where t2 is, 1 ahead or -1 behind.
        move: the kind and t2 to t6.
        kept: room for n cities.
    """
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
def find_places(tour: CellArray, places: CellArray) -> bool:
    """Fill in the places of all cities; False where the tour is no permutation."""
    n = tour.size
    places[:] = -1
    for place in range(n):
        city = tour[place]
        if not 0 <= city < n or places[city] >= 0:
            return False
        places[city] = place
    return True
