"""Neighbours within a radius where there are too many to reserve room for all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from acl_gym.swarm import Radius, near
from acl_gym.swarm.cells import sort_into_cells


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
