"""The sums over neighbours: three kernels against the equation written out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.swarm import Links, Radius
from acl_gym.swarm.aggregation import (
    BoundedRepulsion,
    UnboundedRepulsion,
    forces_over_links,
    forces_within,
    kernels,
)
from acl_gym.swarm.cells import Cells, sort_into_cells
from acl_gym.utils import threads
from tests.swarm.aggregation import reference
from tests.swarm.aggregation.cases import interactions, positions

ROUNDING = 1e-14  # of each part of a sum


def assert_force(
    force: np.ndarray, interaction: Any, own: Any, heard: Any, lists: Any
) -> None:
    """Equal to the sum over these neighbours, but for rounding."""
    for i, neighbours in enumerate(lists):
        wanted = reference.force(interaction, i, own, heard, neighbours)
        size = reference.magnitude(interaction, i, own, heard, neighbours)
        np.testing.assert_allclose(
            force[i], wanted, rtol=0, atol=ROUNDING * (1.0 + size)
        )


def within(x: np.ndarray, sigma: np.ndarray) -> list[list[int]]:
    """N_i = {j : |x_i - x_j| < sigma_i}."""
    return [
        [j for j in range(len(x)) if math.dist(x[i], x[j]) < sigma[i]]
        for i in range(len(x))
    ]


@given(st.data(), positions(axes=4), st.booleans())
def test_everyone(data: st.DataObject, x: np.ndarray, include_self: bool) -> None:
    n = len(x)
    interaction = data.draw(interactions(n))
    heard = x + data.draw(st.sampled_from([0.0, 0.3]))
    links = Links.everyone(n, include_self)
    force = forces_over_links(x, heard, links, interaction)
    assert_force(force, interaction, x, heard, [range(n)] * n)


@given(st.data(), positions(axes=4))
def test_links(data: st.DataObject, x: np.ndarray) -> None:
    n = len(x)
    interaction = data.draw(interactions(n))
    heard = x + data.draw(st.sampled_from([0.0, 0.3]))
    one = st.lists(st.integers(0, n - 1), max_size=2 * n)
    links = Links.from_lists(data.draw(st.lists(one, min_size=n, max_size=n)))
    force = forces_over_links(x, heard, links, interaction)
    lists = np.split(links.sender, links.offsets[1:-1])
    assert_force(force, interaction, x, heard, lists)


@given(st.data(), positions())
def test_radius(data: st.DataObject, x: np.ndarray) -> None:
    n = len(x)
    interaction = data.draw(interactions(n))
    radii = st.sampled_from([0.125, 0.5, 1.0, 2.5, 10.0, math.inf])
    if data.draw(st.booleans()):
        given = sigma = np.array(data.draw(st.lists(radii, min_size=n, max_size=n)))
    else:
        given = data.draw(radii)
        sigma = np.full(n, given)
    force = forces_within(x, interaction, given)
    assert_force(force, interaction, x, x, within(x, sigma))
    over = forces_over_links(x, x, Radius(given).links(x), interaction)
    size = [reference.magnitude(interaction, i, x, x, range(n)) for i in range(n)]
    assert (np.abs(force - over).max(axis=1) <= ROUNDING * (1.0 + np.array(size))).all()


def test_more_neighbours_than_a_kernel_weighs_at_a_time() -> None:
    rng = np.random.default_rng(0)
    n = 2 * kernels.BATCH + 50
    x = rng.normal(size=(n, 2))
    for interaction in (BoundedRepulsion(), UnboundedRepulsion()):
        every = forces_over_links(x, x, Links.everyone(n), interaction)
        pairs = np.indices((n, n)).reshape(2, -1)
        links = Links.from_pairs(n, *pairs)
        scale = np.abs(every).max()
        for other in (
            forces_over_links(x, x, links, interaction),
            forces_within(x, interaction, 100.0),
        ):
            np.testing.assert_allclose(other, every, rtol=0, atol=1e-11 * scale)


@given(positions(), st.sampled_from([0.1, 0.5, 1.0, 3.0, 100.0, math.inf]))
def test_cells_hold_everyone_and_are_wide_enough(x: np.ndarray, radius: float) -> None:
    cells = Cells(*sort_into_cells(x, radius))
    n, dim = x.shape
    assert sorted(cells.agent) == list(range(n))
    np.testing.assert_array_equal(cells.place[3 - dim :].T, x[cells.agent])
    assert not cells.place[: 3 - dim].any()
    assert cells.first[0] == 0
    assert cells.first[-1] == n
    assert (cells.shape[: 3 - dim] == 1).all()
    assert cells.shape.prod() == cells.first.size - 1 <= 2 * n + 1
    for cell in range(cells.first.size - 1):
        inside = slice(cells.first[cell], cells.first[cell + 1])
        assert (cells.cell[inside] == cell).all()
        assert (np.diff(cells.agent[inside]) > 0).all()
    # Those within the radius lie in cells beside each other.
    at = np.stack(np.unravel_index(cells.cell, tuple(cells.shape)), axis=1)
    for i in range(n):
        for j in range(n):
            near = math.dist(cells.place[:, i], cells.place[:, j]) < radius
            assert not near or np.abs(at[i] - at[j]).max() <= 1


def test_agents_far_apart_need_no_more_cells() -> None:
    x = np.array([[0.0, 0.0], [1e150, -1e150], [0.5, 0.0]])
    assert sort_into_cells(x, 1.0)[0].prod() <= 7
    force = forces_within(x, BoundedRepulsion(), 1.0)
    g = BoundedRepulsion()([0.5, 0.0])
    np.testing.assert_allclose(force, [-g, [0.0, 0.0], g], rtol=1e-14)


@pytest.fixture
def two_threads() -> Iterator[Callable[[int], None]]:
    before = threads.get_num_threads()
    yield threads.set_num_threads
    threads.set_num_threads(before)


@pytest.mark.parametrize("kind", ["everyone", "links", "radius"])
@pytest.mark.parametrize("interaction", [BoundedRepulsion(), UnboundedRepulsion()])
def test_threads_change_no_bit(
    kind: str, interaction: Any, two_threads: Callable[[int], None]
) -> None:
    n = threads.LEAST_ANTS + 77
    x = np.random.default_rng(1).uniform(0, 40.0, (n, 2))
    links = Links.everyone(n) if kind == "everyone" else Radius(2.0).links(x)

    def force() -> bytes:
        if kind == "radius":
            return forces_within(x, interaction, 2.0).tobytes()
        return forces_over_links(x, x, links, interaction).tobytes()

    one = force()
    two_threads(2)
    assert force() == one


@settings(max_examples=20)
@given(st.data(), positions(most=12))
def test_kernels_are_plain_python_too(data: st.DataObject, x: np.ndarray) -> None:
    """Compiled or not, they compute the same."""
    n = len(x)
    law = tuple(data.draw(interactions(n)).coefficients(n))
    radius = np.full(n, 1.5)
    cells = sort_into_cells(x, 1.5)
    turned = np.ascontiguousarray(x.T)
    links = Radius(1.5).links(x)
    calls = (
        (kernels.of_everyone, (turned, turned, law)),
        (kernels.of_links, (x, x, *links.csr(), law)),
        (kernels.of_radius, (cells, radius, law)),
    )
    for kernel, arguments in calls:
        compiled, plain = np.empty_like(x), np.empty_like(x)
        kernel(*arguments, compiled, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            kernel.py_func(*arguments, plain, 0)
        np.testing.assert_allclose(plain, compiled, rtol=1e-13, atol=1e-12)
    plain_cells = sort_into_cells.py_func(x, 1.5)
    for mine, other in zip(cells, plain_cells, strict=True):
        np.testing.assert_array_equal(mine, other)


def test_one_agent_and_those_that_hear_nobody_feel_nothing() -> None:
    alone = np.array([[3.0, 4.0]])
    for radius in (1.0, math.inf):
        assert forces_within(alone, BoundedRepulsion(), radius).tolist() == [[0.0, 0.0]]
    nobody = Links.from_lists([[], [0], []])
    x = np.arange(6.0).reshape(3, 2)
    force = forces_over_links(x, x, nobody, BoundedRepulsion())
    assert force[[0, 2]].tolist() == [[0.0, 0.0]] * 2
    assert force[1].any()


@pytest.mark.parametrize("radius", [1.0, math.inf])
def test_agents_in_one_place_have_no_direction_to_part_in(radius: float) -> None:
    x = np.zeros((3, 2))
    for interaction in (BoundedRepulsion(), UnboundedRepulsion()):
        assert not forces_within(x, interaction, radius).any()


def test_bad_input() -> None:
    law = BoundedRepulsion()
    x = np.zeros((3, 2))
    with pytest.raises(ValueError, match="positions must be numbers of at most 1e"):
        forces_within([[0.0, math.nan]], law, 1.0)
    with pytest.raises(ValueError, match=r"shape \(4, dim\)"):
        forces_over_links(x, x, Links.everyone(4), law)
    with pytest.raises(
        ValueError, match=r"radius must lie in \(0, inf\), or be infinite, got 0"
    ):
        forces_within(x, law, 0.0)
    with pytest.raises(ValueError, match="radius must be a number, or one for each"):
        forces_within(x, law, [1.0, 2.0])
    with pytest.raises(ValueError, match="1 to 3 coordinates where there is a radius"):
        forces_within(np.zeros((3, 4)), law, 1.0)
    with pytest.raises(
        ValueError, match="heard must have 2 coordinates for each agent"
    ):
        forces_over_links(x, np.zeros((3, 1)), Links.everyone(3), law)
    with pytest.raises(TypeError, match="links must be Links, such as"):
        forces_over_links(x, x, [[0], [1], [2]], law)
    for call in (
        lambda: forces_over_links(x, x, Links.everyone(3), None),
        lambda: forces_within(x, None),
        lambda: forces_within(x, 20.0, 1.0),
    ):
        with pytest.raises(TypeError, match="interaction must be an Interaction"):
            call()


@pytest.mark.parametrize("distance", [5e-324, 1e-320, 1e-310])
def test_agents_that_no_cell_can_tell_apart(distance: float) -> None:
    """Where the inverse of a distance is infinite all agents are in one cell."""
    n = 2_000
    x = np.zeros((n, 2))
    x[:, 0] = np.arange(n) * distance
    for kernel in (sort_into_cells, sort_into_cells.py_func):
        with np.errstate(over="ignore"):
            cells = Cells(*kernel(x, distance))
        assert sorted(cells.agent) == list(range(n))
        assert (cells.cell >= 0).all()
        assert (cells.cell < cells.shape.prod()).all()
    assert np.isfinite(forces_within(x, BoundedRepulsion(), distance)).all()
    assert Radius(distance).links(x[:50]).n == 50


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (np.zeros((0, 2)), "there must be at least one agent"),
        ([["a", "b"]], "positions must be real numbers, got .* of dtype <U1"),
        (np.zeros((2, 2), np.complex128), "real numbers, got .* of dtype complex128"),
        (np.zeros((3, 0)), r"of shape \(n, dim\), a row for each agent and dim >= 1"),
        ([1.0, 2.0], r"of shape \(n, dim\), a row for each agent and dim >= 1"),
    ],
)
def test_what_is_wrong_with_positions_is_said(x: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        forces_within(x, BoundedRepulsion())
