"""Neighborhoods, held against sets of pairs."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm import Links


def as_lists(links: Links) -> list[list[int]]:
    """N_i of each agent, from the sparse rows."""
    ends = zip(links.offsets[:-1], links.offsets[1:], strict=True)
    return [links.sender[begin:end].tolist() for begin, end in ends]


@st.composite
def neighbourhoods(draw: st.DrawFn) -> list[list[int]]:
    n = draw(st.integers(1, 8))
    return [draw(st.lists(st.integers(0, n - 1), max_size=10)) for _ in range(n)]


@given(neighbourhoods(), st.randoms())
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


def test_links_do_not_change() -> None:
    links = Links.from_lists([[1], [0]])
    with pytest.raises(AttributeError, match="links do not change"):
        links.n = 3
    for array in (links.sender, links.receiver, links.offsets):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((2, [0], [2]), "sender must hold numbers of agents from 0 to 1, got 2"),
        ((2, [-1], [0]), "receiver must hold numbers of agents from 0 to 1, got -1"),
        ((2, [0, 1], [0]), "equally long.*got 2 and 1"),
        ((2, [0.5], [0]), "receiver must be a list of numbers of agents"),
        ((2, [[0]], [[0]]), "receiver must be a list of numbers of agents"),
        ((0, [], []), "n must be at least 1"),
    ],
)
def test_pairs_must_be_numbers_of_agents(arguments, words) -> None:
    with pytest.raises(ValueError, match=words):
        Links.from_pairs(*arguments)


def test_more_agents_than_memory_holds_are_refused() -> None:
    for make in (
        lambda n: Links.from_pairs(n, [0], [1]),
        Links.everyone,
        lambda n: Links.everyone(n, include_self=False),
    ):
        with pytest.raises(
            ValueError, match=r"fit into .* use fewer|n must be at most"
        ):
            make(10**12)


def test_lists_must_be_numbers_of_agents() -> None:
    with pytest.raises(TypeError, match=r"a list for each agent.*got 3"):
        Links.from_lists(3)
    with pytest.raises(ValueError, match=r"lists\[1\] must hold .*from 0 to 1, got 5"):
        Links.from_lists([[0], [5]])
    with pytest.raises(ValueError, match="the number of lists must be at least 1"):
        Links.from_lists([])


def test_too_many_links_are_not_written_out() -> None:
    links = Links.everyone(10**7)
    assert links.n_links == 10**14
    for name in ("receiver", "sender"):
        with pytest.raises(ValueError, match=r"100,000,000,000,000 links must fit"):
            getattr(links, name)


@pytest.mark.parametrize(
    "kept",
    [np.ones(3, np.bool_), np.ones(2), np.ones((2, 1), bool), [True], None, [1, 0]],
)
def test_a_subset_needs_a_flag_for_each_link(kept) -> None:
    with pytest.raises(ValueError, match="kept must be 2 flags"):
        Links.from_lists([[1], [0]]).subset(kept)


def test_flags_of_a_subset_may_be_a_list() -> None:
    links = Links.from_lists([[1], [0]]).subset([True, False])
    assert as_lists(links) == [[1], []]


def test_repr_says_how_many_there_are() -> None:
    assert repr(Links.from_lists([[1], []])) == "Links(n=2, n_links=1)"


@given(neighbourhoods())
def test_rows_of_senders_are_taken_as_they_are(lists) -> None:
    links = Links.from_lists(lists)
    again = Links(links.n, links.sender.copy(), links.offsets.copy())
    assert as_lists(again) == as_lists(links)


@pytest.mark.parametrize(
    ("sender", "offsets"),
    [
        ([0, 1], [0, 1]),  # a row is missing
        ([0, 1], [0, 1, 1]),  # a sender is left over
        ([0, 1], [1, 1, 2]),
        ([0, 1], [0, 3, 2]),
        ([1, 0], [0, 2, 2]),  # does not ascend
        ([0, 0], [0, 2, 2]),  # twice
        ([0, 2], [0, 1, 2]),  # there is no agent 2
        ([0, -1], [0, 1, 2]),
        ([[0, 1]], [0, 1, 2]),
    ],
)
def test_rows_of_senders_are_checked(sender, offsets) -> None:
    arrays = np.array(sender), np.array(offsets)
    with pytest.raises(ValueError, match=r"offsets must be n \+ 1 = 3 numbers"):
        Links(2, *arrays)
    with pytest.raises(ValueError, match="must be arrays of int64"):
        Links(2, *(each.astype(float) for each in arrays))
    with pytest.raises(ValueError, match="must be arrays of int64"):
        Links(2, sender, offsets)


@given(neighbourhoods())
def test_what_is_changed_afterwards_changes_no_links(lists) -> None:
    made = Links.from_lists(lists)
    sender, offsets = made.sender.copy(), made.offsets.copy()
    links = Links(made.n, sender, offsets)
    sender[:] = 10**9
    offsets[:] = -(10**9)
    assert as_lists(links) == as_lists(made)
    for each in (links, made, links.subset(np.ones(links.n_links, np.bool_))):
        for array in (each.sender, each.offsets, each.receiver, *each.csr()):
            with pytest.raises(ValueError, match="cannot set WRITEABLE flag"):
                array.setflags(write=True)


@pytest.mark.parametrize("include_self", [True, False])
def test_arrays_of_everyone_are_read_only(include_self: bool) -> None:
    links = Links.everyone(3, include_self)
    for array in (links.sender, links.offsets, links.receiver, *links.csr()):
        assert not array.flags.writeable


@given(neighbourhoods())
def test_who_hears_itself(lists) -> None:
    wanted = [i in each for i, each in enumerate(lists)]
    assert Links.from_lists(lists).hears_itself.tolist() == wanted
    assert Links.everyone(3).hears_itself.all()
    assert not Links.everyone(3, include_self=False).hears_itself.any()


def test_pairs_that_fill_the_memory_are_refused_before_they_are_looked_at() -> None:
    many = np.broadcast_to(0, 10**12)
    with pytest.raises(ValueError, match=r"1,000,000,000,000 links must fit"):
        Links.from_pairs(2, many, many)
