"""Neighbours within a radius where there are too many to reserve room for all pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acl_gym.swarm import Radius, near
from acl_gym.swarm.aggregation import (
    BoundedRepulsion,
    forces_over_links,
    forces_within,
)
from acl_gym.swarm.cells import sort_into_cells, squared_reach
from tests.swarm.test_links import as_lists

TENTHS = st.integers(-10, 10).map(lambda k: k / 10.0)


@pytest.mark.parametrize("include_self", [True, False])
def test_the_links_of_a_crowd(include_self: bool) -> None:
    x = np.random.default_rng(0).random((2_300, 2))
    sigma = np.full(len(x), 0.9)
    cells = sort_into_cells(x, 0.9)
    assert near._pairs(sigma, cells, 10**9) > near._FEW_PAIRS
    links = Radius(0.9, include_self).links(x)
    distance = np.linalg.norm(x[:, None] - x, axis=2)
    wanted = distance < 0.9
    np.fill_diagonal(wanted, include_self)
    receiver, sender = np.nonzero(wanted)
    np.testing.assert_array_equal(links.receiver, receiver)
    np.testing.assert_array_equal(links.sender, sender)


def test_kernels_are_plain_python_too() -> None:
    x = np.random.default_rng(1).integers(-4, 5, (20, 4)) / 2.0
    sigma = np.linspace(0.0, 2.5, 20)
    cells = sort_into_cells(np.ascontiguousarray(x[:, :3]), 1.0)
    room = near._pairs.py_func(sigma, cells, 10**6)
    assert room == near._pairs(sigma, cells, 10**6)
    found = []
    for kernel in (near._within, near._within.py_func):
        counts, sender = np.empty(20, np.int64), np.empty(room, np.int64)
        n_links = kernel(x, sigma, True, cells, 1, counts, sender)
        found.append((sender[:n_links].tolist(), counts.tolist()))
    assert found[0] == found[1]
    arguments = (np.array(found[0][0]), np.array(found[0][1]), cells[2])
    for mine, other in zip(
        near._by_sender(*arguments), near._by_sender.py_func(*arguments), strict=True
    ):
        np.testing.assert_array_equal(mine, other)


@given(st.floats(0.0, allow_nan=False))
def test_the_limit_of_squares_says_the_same_as_the_distance(radius: float) -> None:
    limit = squared_reach(radius)
    assert limit == squared_reach.py_func(radius)
    assert math.sqrt(limit) >= radius
    assert limit == 0.0 or math.sqrt(math.nextafter(limit, 0.0)) < radius


@given(
    arrays(float, st.tuples(st.integers(1, 8), st.integers(1, 3)), elements=TENTHS),
    st.sampled_from([0.1, 0.3, 0.5, math.sqrt(0.02), 1e-200, 0.7]),
    st.booleans(),
)
def test_channels_and_forces_agree_about_pairs_at_the_radius(x, radius, each) -> None:
    """Distances are multiples of a tenth, rounded: many are the radius or next to it."""
    sigma = np.full(len(x), radius) if each else radius
    links = Radius(sigma).links(x)
    wanted = [
        [j for j, there in enumerate(x) if math.sqrt(_square(here - there)) < radius]
        for here in x
    ]
    assert as_lists(links) == wanted
    law = BoundedRepulsion()
    over_links = forces_over_links(x, x, links, law)
    np.testing.assert_allclose(
        forces_within(x, law, sigma), over_links, rtol=1e-12, atol=1e-12
    )


COORDINATES = st.floats(1e-3, 1e3)


@given(COORDINATES, COORDINATES)
def test_a_pair_at_the_radius_is_not_within_it(a: float, b: float) -> None:
    """Although the square of the rounded radius may be larger than that of the distance."""
    x = np.array([[0.0, 0.0], [a, b]])
    at = math.sqrt(a * a + b * b)
    for radius, n_links in ((at, 0), (math.nextafter(at, math.inf), 2)):
        assert Radius(radius, include_self=False).links(x).n_links == n_links
        force = forces_within(x, BoundedRepulsion(repulsion=0.0), radius)
        assert np.count_nonzero(force) == 2 * n_links


def _square(y: np.ndarray) -> float:
    total = 0.0
    for each in np.concatenate([np.zeros(3 - y.size), y]):  # in the order of the cells
        total += float(each) * float(each)
    return total
