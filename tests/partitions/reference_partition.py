"""Memberships and degrees of fulfilment, written out from (4.7) and (4.8)."""

import itertools
from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from acl_gym.partitions import Partition

FloatArray = NDArray[np.float64]
Periods = Sequence[float | None]


def memberships(x: float, a: FloatArray) -> FloatArray:
    """(4.7): the degree of x to each of the triangles with centres a."""
    n = len(a)
    mu = np.ones(n)  # a lone centre has no neighbour to fall off to
    for i in range(n) if n > 1 else ():
        rising = (x - a[i - 1]) / (a[i] - a[i - 1]) if i > 0 else 1.0
        falling = (a[i + 1] - x) / (a[i + 1] - a[i]) if i < n - 1 else 1.0
        mu[i] = max(0.0, min(1.0, rising, falling))
    return mu


def circular_memberships(x: float, a: FloatArray, period: float) -> FloatArray:
    """(4.7) on a circle: the last centre also lies before the first, and so on."""
    around = a[0] + np.mod(x - a[0], period)
    mu = memberships(around, np.concatenate([[a[-1] - period], a, [a[0] + period]]))
    folded = mu[1:-1].copy()
    folded[-1] += mu[0]
    folded[0] += mu[-1]
    return folded


def fulfilment(
    state: FloatArray, centres: Sequence[FloatArray], periods: Periods
) -> FloatArray:
    """(4.8): the vector of all products of memberships, the last variable fastest."""
    beta = np.ones(1)
    for x, a, period in zip(state, centres, periods, strict=True):
        mu = memberships(x, a) if period is None else circular_memberships(x, a, period)
        beta = np.outer(beta, mu).ravel()
    return beta


def nearest_distance(x: float, a: FloatArray, period: float | None) -> FloatArray:
    """How far x lies from each centre, along the circle if there is one."""
    away = np.abs(x - a)
    return away if period is None else np.abs((away + period / 2) % period - period / 2)


def dense(partition: Partition, states: FloatArray) -> FloatArray:
    """The vector (4.8) of each state, `(n, n_cells)`, from `(index, degree)`."""
    index, degree = partition(states)
    beta = np.zeros((len(states), partition.n_cells))
    for row, cells, degrees in zip(beta, index, degree, strict=True):
        np.add.at(row, cells, degrees)
    return beta


def discrete_states(sizes: Sequence[int], starts: Sequence[int]) -> FloatArray:
    """All combinations of values in the order of the cells, the last one fastest."""
    ranges = [range(a, a + n) for n, a in zip(sizes, starts, strict=True)]
    return np.array(list(itertools.product(*ranges)))


@st.composite
def axes(draw: st.DrawFn) -> tuple[FloatArray, float | None]:
    """Strictly increasing centres, regular or not, and a period or None."""
    n = draw(st.integers(1, 7))
    gap = st.floats(0.05, 3.0)
    if draw(st.booleans()):
        gaps = np.full(n, draw(gap))
    else:
        gaps = np.array([draw(gap) for _ in range(n)])
    centres = draw(st.floats(-5.0, 5.0)) + np.concatenate([[0.0], np.cumsum(gaps)])
    period = float(centres[n] - centres[0]) if draw(st.booleans()) else None
    return centres[:n], period


@st.composite
def positions(draw: st.DrawFn, centres: FloatArray) -> float:
    """Anywhere near the centres, on one, half-way, at an end or far outside."""
    i = draw(st.integers(0, len(centres) - 1))
    j = draw(st.integers(0, len(centres) - 1))
    fraction = draw(st.one_of(st.sampled_from([0.0, 0.5, 1.0]), st.floats(0.0, 1.0)))
    inside = float(centres[i] + fraction * (centres[j] - centres[i]))
    return draw(st.one_of(st.just(inside), st.floats(-60.0, 60.0)))


@st.composite
def grids(
    draw: st.DrawFn,
) -> tuple[list[FloatArray], list[float | None], FloatArray]:
    """Centres and periods of 1 to 4 variables, and some states (n, d)."""
    drawn = [draw(axes()) for _ in range(draw(st.integers(1, 4)))]
    centres = [a for a, _ in drawn]
    n = draw(st.integers(1, 5))
    states = [[draw(positions(a)) for a in centres] for _ in range(n)]
    return centres, [period for _, period in drawn], np.array(states)
