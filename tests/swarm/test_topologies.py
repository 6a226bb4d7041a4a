"""Who hears whom, held against double loops over agents."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm import Everyone, Nearest, Radius, Ring, Topology, VonNeumann
from tests.swarm.test_links import as_lists


def heard(n: int, hears: Callable[[int, int], bool]) -> list[list[int]]:
    """N_i of each agent, by asking for each pair."""
    return [[j for j in range(n) if hears(i, j)] for i in range(n)]


def distance(a, b) -> float:
    return math.sqrt(sum((p - q) ** 2 for p, q in zip(a, b, strict=True)))


@st.composite
def positions(draw: st.DrawFn, least: int = 1) -> np.ndarray:
    n, dim = draw(st.integers(least, 25)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    x = 4.0 * rng.random((n, dim))
    if draw(st.booleans()):  # on a grid: coincident agents, equal distances
        x = np.round(x)
    return x * draw(st.sampled_from([1.0, 1e-3, 1e6]))


@given(positions(), st.booleans())
def test_everyone(x, include_self) -> None:
    links = Everyone(include_self).links(x)
    assert (links.complete, links.all_others) == (include_self, not include_self)
    assert as_lists(links) == heard(len(x), lambda i, j: include_self or i != j)


@given(st.integers(1, 12), st.integers(1, 7), st.booleans())
def test_ring(n, k, include_self) -> None:
    def hears(i: int, j: int) -> bool:
        apart = min((i - j) % n, (j - i) % n)
        return apart <= k and (include_self or i != j)

    links = Ring(k, include_self).links(np.zeros((n, 1)))
    assert as_lists(links) == heard(n, hears)
    assert links.is_symmetric


@given(st.integers(1, 5), st.integers(1, 5), st.booleans())
def test_von_neumann(rows, columns, include_self) -> None:
    def hears(i: int, j: int) -> bool:
        if i == j:
            return include_self
        down, right = (i // columns - j // columns) % rows, (i - j) % columns
        same_row, same_column = i // columns == j // columns, right == 0
        beside_in_row = same_row and right in (1, columns - 1)
        beside_in_column = same_column and down in (1, rows - 1)
        return beside_in_row or beside_in_column

    n = rows * columns
    links = VonNeumann(rows, include_self).links(np.zeros((n, 1)))
    assert as_lists(links) == heard(n, hears)
    assert links.is_symmetric


@pytest.mark.parametrize(("n", "rows"), [(1, 1), (12, 3), (13, 1), (16, 4), (40, 5)])
def test_von_neumann_makes_the_grid_most_like_a_square(n, rows) -> None:
    x = np.zeros((n, 2))
    assert as_lists(VonNeumann().links(x)) == as_lists(VonNeumann(rows).links(x))


@given(positions(), st.booleans(), st.data())
def test_radius(x, include_self, data) -> None:
    n, scale = len(x), float(np.abs(x).max()) or 1.0
    one = st.sampled_from([0.0, 1e-9, 0.1, 0.25, 0.5, 1.0, 10.0, math.inf])
    same = data.draw(st.booleans())
    each = [data.draw(one) for _ in range(n)]
    radii = [each[0]] * n if same else each
    radii = [scale * radius for radius in radii]
    sigma = radii[0] if same else radii
    links = Radius(sigma, include_self).links(x)
    wanted = heard(
        n,
        lambda i, j: distance(x[i], x[j]) < radii[i] and (include_self or i != j),
    )
    assert as_lists(links) == wanted
    assert not same or links.is_symmetric


@given(positions(least=2), st.booleans(), st.data())
def test_nearest(x, include_self, data) -> None:
    n = len(x)
    k = data.draw(st.integers(1, n - 1))
    links = Nearest(k, include_self).links(x)
    for i, found in enumerate(as_lists(links)):
        assert found == sorted(set(found))
        assert (i in found) == include_self
        others = [j for j in found if j != i]
        assert len(others) == k
        # Of equally distant ones it may be any, so distances are compared.
        all_distances = sorted(distance(x[i], x[j]) for j in range(n) if j != i)
        np.testing.assert_allclose(
            sorted(distance(x[i], x[j]) for j in others), all_distances[:k], rtol=1e-12
        )


@pytest.mark.parametrize(
    "topology",
    [Everyone(), Ring(), VonNeumann(), Radius(0.1), Nearest(2)],
    ids=str,
)
def test_agents_hear_themselves_unless_told_otherwise(topology: Topology) -> None:
    x = np.random.default_rng(0).random((12, 2))
    assert all(i in found for i, found in enumerate(as_lists(topology.links(x))))


def test_different_radii_make_links_of_one_direction() -> None:
    x = np.array([[0.0], [1.0], [5.0]])
    links = Radius([2.0, 0.5, 100.0]).links(x)
    assert as_lists(links) == [[0, 1], [1], [0, 1, 2]]
    assert not links.is_symmetric


def test_one_agent() -> None:
    x = np.zeros((1, 2))
    assert as_lists(Radius(1.0).links(x)) == [[0]]
    assert as_lists(Radius(1.0, include_self=False).links(x)) == [[]]
    assert as_lists(Everyone(include_self=False).links(x)) == [[]]
    assert as_lists(Ring().links(x)) == as_lists(VonNeumann().links(x)) == [[0]]
    with pytest.raises(ValueError, match="k must be less than the number of agents"):
        Nearest(1).links(x)


def test_agents_in_one_place_hear_each_other() -> None:
    x = np.full((6, 2), 3.0)
    everyone = [list(range(6))] * 6
    assert as_lists(Radius(1e-300).links(x)) == everyone
    assert as_lists(Radius([1e-300, *[1.0] * 5]).links(x)) == everyone
    assert as_lists(Radius(0.0).links(x)) == [[]] * 6
    for i, found in enumerate(as_lists(Nearest(2).links(x))):
        assert i in found
        assert len(set(found) - {i}) == 2


def test_a_large_swarm_is_a_small_list() -> None:
    """Time and memory follow the number of links, not of pairs of agents."""
    x = np.random.default_rng(0).random((100_000, 2))
    assert Radius(0.002).links(x).n_links < 300_000
    assert Nearest(3).links(x).n_links == 400_000


def test_too_many_links_are_refused_before_they_are_made() -> None:
    # 600,000 agents of which each hears all: 3.6e11 links.
    x = np.random.default_rng(0).random((600_000, 1))
    with pytest.raises(
        ValueError, match=r"links must fit into .* use a smaller radius"
    ):
        Radius(2.0).links(x)
    with pytest.raises(ValueError, match=r"links must fit into .* use a smaller k"):
        Nearest(599_999).links(x)


ANY = [Everyone(), Ring(2), VonNeumann(), Radius(0.5), Nearest(3)]


@pytest.mark.parametrize("topology", ANY, ids=str)
def test_the_number_of_agents_may_change(topology: Topology) -> None:
    rng = np.random.default_rng(0)
    for n in (6, 15, 6):
        assert topology.links(rng.random((n, 2))).n == n


@pytest.mark.parametrize("topology", [Radius(1.0), Nearest(1)], ids=str)
@pytest.mark.parametrize(
    ("x", "words"),
    [
        ([[0.0], [math.nan]], r"at most 1e\+150, got \[nan\] for agent 1"),
        ([[0.0], [math.inf]], "for agent 1; look for what makes it diverge"),
        ([[-1e151], [0.0]], "for agent 0"),
        ([0.0, 1.0], r"of shape \(n, dim\), a row for each agent"),
        (np.empty((0, 2)), "there must be at least one agent"),
        ([["a"], ["b"]], "must be real numbers, got .* of dtype"),
    ],
)
def test_positions_must_be_numbers(topology, x, words) -> None:
    with pytest.raises(ValueError, match=words):
        topology.links(np.asarray(x))


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: Ring(0), ValueError, "k must be at least 1, got 0"),
        (lambda: Ring(1.5), TypeError, "k must be an integer"),
        (lambda: Ring(1, 2), TypeError, "include_self must be True or False, got 2"),
        (lambda: Nearest(0), ValueError, "k must be at least 1, got 0"),
        (lambda: VonNeumann(0), ValueError, "rows must be at least 1"),
        (lambda: Radius(-1.0), ValueError, r"sigma must lie in \[0, inf\), or be inf"),
        (lambda: Radius([1.0, math.nan]), ValueError, "sigma must lie in .*, got nan"),
        (
            lambda: Radius([[1.0]]),
            ValueError,
            "sigma must be a number, or one for each",
        ),
        (lambda: Radius("wide"), ValueError, "sigma must be an array of real numbers"),
    ],
)
def test_parameters_out_of_range_are_refused(make, error, words) -> None:
    with pytest.raises(error, match=words):
        make()


def test_parameters_must_fit_the_number_of_agents() -> None:
    x = np.zeros((6, 2))
    with pytest.raises(ValueError, match=r"each of the 6 agents, got .*\(5,\)"):
        Radius(np.ones(5)).links(x)
    with pytest.raises(ValueError, match="got 4 rows for 6 agents"):
        VonNeumann(4).links(x)
    with pytest.raises(ValueError, match="got 6 for 6 agents; use Everyone"):
        Nearest(6).links(x)


@pytest.mark.parametrize("topology", ANY, ids=str)
def test_repr_is_the_call_that_makes_it(topology: Topology) -> None:
    assert repr(eval(repr(topology))) == repr(topology)


def test_a_ring_counts_its_links_before_it_makes_them() -> None:
    x = np.broadcast_to(0.0, (10**6, 1))
    with pytest.raises(ValueError, match=r"200,001,000,000 links .* use a smaller k"):
        Ring(100_000).links(x)


@pytest.mark.parametrize(
    ("channel", "name", "value"),
    [
        (Everyone(), "include_self", False),
        (Ring(), "include_self", False),
        (Ring(), "k", 2),
        (VonNeumann(), "include_self", False),
        (VonNeumann(), "rows", 1),
    ],
    ids=repr,
)
def test_an_attribute_that_is_changed_counts(channel, name, value) -> None:
    x = np.zeros((12, 2))
    kept = channel.links(x)
    assert channel.links(x) is kept
    setattr(channel, name, value)
    wanted = type(channel)(**{name: value}).links(x)
    for attribute in ("receiver", "sender"):
        found = getattr(channel.links(x), attribute)
        assert np.array_equal(found, getattr(wanted, attribute))
    assert wanted.n_links != kept.n_links
