"""Neighborhoods, held against sets of pairs."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm import Links


def as_lists(links: Links) -> list[list[int]]:
    """N_i of each agent, from the sparse rows."""
    ends = zip(links.offsets[:-1], links.offsets[1:], strict=True)
    return [links.sender[begin:end].tolist() for begin, end in ends]


@st.composite
def neighborhoods(draw: st.DrawFn) -> list[list[int]]:
    n = draw(st.integers(1, 8))
    return [draw(st.lists(st.integers(0, n - 1), max_size=10)) for _ in range(n)]


@given(neighborhoods(), st.randoms())
def test_links_are_sets_sorted_by_receiver_then_sender(lists, random) -> None:
    wanted = [sorted(set(each)) for each in lists]
    pairs = [(i, j) for i, each in enumerate(lists) for j in each]
    random.shuffle(pairs)
    receiver, sender = [i for i, _ in pairs], [j for _, j in pairs]
    for links in (
        Links.from_lists(lists),
        Links.from_pairs(len(lists), receiver, sender),
        pickle.loads(pickle.dumps(Links.from_lists(lists))),
    ):
        assert as_lists(links) == wanted
        assert links.receiver.tolist() == [i for i, w in enumerate(wanted) for _ in w]
        assert links.degrees.tolist() == [len(each) for each in wanted]
        assert links.n_links == len(links.sender) == sum(links.degrees)
        assert not links.is_implicit
        back = [[i for i in range(links.n) if j in wanted[i]] for j in range(links.n)]
        assert links.is_symmetric == (back == wanted)


@pytest.mark.parametrize("include_self", [True, False])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_everyone_is_written_out_on_demand(n: int, include_self: bool) -> None:
    links = Links.everyone(n, include_self)
    wanted = [[j for j in range(n) if include_self or j != i] for i in range(n)]
    for each in (links, pickle.loads(pickle.dumps(links))):
        assert (each.complete, each.all_others) == (include_self, not include_self)
        assert as_lists(each) == wanted
        assert each.receiver.tolist() == [i for i in range(n) for _ in wanted[i]]
        assert each.degrees.tolist() == [len(w) for w in wanted]
        assert each.n_links == len(each.sender)
        assert each.is_symmetric
    some = links.subset(links.sender == 0)
    assert as_lists(some) == [[j for j in w if j == 0] for w in wanted]
