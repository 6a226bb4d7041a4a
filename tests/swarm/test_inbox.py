"""What agents hear, held against double loops over neighbourhoods."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm import Inbox, Links
from tests.swarm.test_links import as_lists

VALUES = st.sampled_from([-2.0, -0.1, 0.0, 0.1, 1 / 3, 1e16, math.inf])


@st.composite
def any_links(draw: st.DrawFn, most: int = 8) -> Links:
    n = draw(st.integers(1, most))
    kind = draw(st.sampled_from(["everyone", "others", "lists"]))
    if kind != "lists":
        return Links.everyone(n, include_self=kind == "everyone")
    agents = st.lists(st.integers(0, n - 1), max_size=n)
    return Links.from_lists([draw(agents) for _ in range(n)])


@given(any_links(), st.data())
def test_best_is_the_least_value_heard_and_the_lowest_number_of_it(links, data) -> None:
    values = [data.draw(VALUES) for _ in range(links.n)]
    found = Inbox(links, {"cost": np.array(values)}).best("cost")
    assert found.dtype == np.int64
    wanted = [
        min(heard, key=lambda j: (values[j], j)) if heard else -1
        for heard in as_lists(links)
    ]
    assert found.tolist() == wanted


@given(any_links(), st.sampled_from([(), (1,), (3,), (2, 3), (0,)]), st.integers(0, 99))
def test_sums_and_means_are_those_of_loops(links, shape, seed) -> None:
    rows = np.random.default_rng(seed).normal(size=(links.n, *shape))
    inbox = Inbox(links, {"x": rows})
    sums, means = inbox.sum(rows), inbox.mean(rows, default=7.0)
    assert inbox.count.tolist() == [len(heard) for heard in as_lists(links)]
    for i, heard in enumerate(as_lists(links)):
        total = np.zeros(shape)
        for j in heard:
            total = total + rows[j]
        if links.all_others:  # added from both ends
            np.testing.assert_allclose(sums[i], total, rtol=0, atol=1e-13)
        else:
            np.testing.assert_array_equal(sums[i], total)
        mean = total / len(heard) if heard else np.full(shape, 7.0)
        np.testing.assert_allclose(means[i], mean, rtol=0, atol=1e-13)


@given(any_links(), st.randoms(), st.integers(0, 99))
def test_the_order_of_the_agents_changes_sums_by_rounding_only(
    links, random, seed
) -> None:
    rows = np.random.default_rng(seed).normal(size=(links.n, 2))
    place = list(range(links.n))  # where each agent stands in the other order
    random.shuffle(place)
    renamed = Links.from_pairs(
        links.n,
        [place[i] for i in links.receiver],
        [place[j] for j in links.sender],
    )
    elsewhere = np.empty_like(rows)
    elsewhere[place] = rows
    sums = Inbox(links, {}).sum(rows)
    others = Inbox(renamed, {}).sum(elsewhere)
    np.testing.assert_allclose(others[place], sums, rtol=0, atol=1e-13)


@given(st.integers(1, 30), st.integers(0, 99))
def test_everyone_gives_the_bits_of_a_list_of_all_links(n: int, seed: int) -> None:
    rows = np.random.default_rng(seed).normal(size=(n, 2))
    messages = {"cost": rows[:, 0].copy()}
    complete = Inbox(Links.everyone(n), messages)
    listed = Inbox(Links.from_lists([range(n)] * n), messages)
    np.testing.assert_array_equal(complete.sum(rows), listed.sum(rows))
    np.testing.assert_array_equal(complete.mean(rows), listed.mean(rows))
    np.testing.assert_array_equal(complete.best("cost"), listed.best("cost"))


@pytest.mark.parametrize("dtype", [np.float32, np.int64, np.uint8, np.bool_])
def test_other_numbers_are_added_as_float64(dtype) -> None:
    rows = np.array([3, 0, 1]).astype(dtype)
    inbox = Inbox(Links.from_lists([[0, 2], [], [0, 1, 2]]), {"a": rows})
    sums = inbox.sum(rows)
    assert sums.dtype == np.float64
    assert sums.tolist() == [float(rows[0]) + 1, 0, float(rows[0]) + 1]
    assert inbox.best("a").tolist() == [2 if rows[0] > 1 else 0, -1, 1]


def test_rows_in_any_memory_layout_give_the_same_bits() -> None:
    rows = np.random.default_rng(0).normal(size=(50, 3))
    for links in (Links.everyone(50), Links.from_lists([range(50)] * 50)):
        inbox = Inbox(links, {})
        np.testing.assert_array_equal(
            inbox.sum(np.asfortranarray(rows)), inbox.sum(rows)
        )
        np.testing.assert_array_equal(
            inbox.sum(np.repeat(rows, 2, axis=0)[::2]), inbox.sum(rows)
        )


def test_pairs_are_the_messages_link_by_link() -> None:
    inbox = Inbox(Links.from_lists([[2, 1], [], [0]]), {"x": np.eye(3)})
    np.testing.assert_array_equal(inbox.pairs("x"), np.eye(3)[[1, 2, 0]])


def test_everyone_hears_everyone_without_a_list_of_links() -> None:
    """100,000 agents: 10^10 links would need 160 GB."""
    n = 100_000
    values = np.arange(n, 0.0, -1.0)
    for links in (Links.everyone(n), Links.everyone(n, include_self=False)):
        inbox = Inbox(links, {"cost": values})
        left_out = 0.0 if links.complete else values
        np.testing.assert_allclose(
            inbox.sum(values), n * (n + 1) / 2 - left_out, rtol=1e-12
        )
        best = inbox.best("cost")
        assert set(best[:-1]) == {n - 1}
        assert best[-1] == (n - 1 if links.complete else n - 2)
        assert set(inbox.count) == {n - (not links.complete)}


@pytest.mark.parametrize(
    ("messages", "error", "words"),
    [
        ([], TypeError, "must be a dict of arrays"),
        ({"x": [1.0, 2.0]}, TypeError, "message 'x' must be an array with a row"),
        ({"x": np.ones(3)}, ValueError, r"each of the 2 agents, got .*\(3,\)"),
        ({"x": np.array(1.0)}, ValueError, "a row for each of the 2 agents"),
    ],
)
def test_messages_must_have_a_row_for_each_agent(messages, error, words) -> None:
    with pytest.raises(error, match=words):
        Inbox(Links.everyone(2), messages)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.array([1.0, math.nan]), "must not be NaN, got NaN from agent 1"),
        (np.ones((2, 1)), "one real number for each agent"),
        (np.ones(2, complex), "one real number for each agent"),
        (np.array(["a", "b"]), "one real number for each agent"),
    ],
)
@pytest.mark.parametrize("links", [Links.everyone(2), Links.from_lists([[0], [1]])])
def test_best_refuses_what_has_no_order(links, values, words) -> None:
    with pytest.raises(ValueError, match=words):
        Inbox(links, {"cost": values}).best("cost")


def test_errors_name_the_messages_there_are() -> None:
    inbox = Inbox(Links.everyone(2), {"x": np.ones(2)})
    for ask in (inbox.best, inbox.pairs):
        with pytest.raises(ValueError, match=r"a message 'cost', got \['x'\]"):
            ask("cost")


@pytest.mark.parametrize("rows", [np.ones(3), 1.0, ["a", "b"], [1j, 2.0], [[1], []]])
def test_sums_need_numbers_with_a_row_for_each_agent(rows) -> None:
    with pytest.raises(ValueError, match="rows must be real numbers"):
        Inbox(Links.everyone(2), {}).sum(rows)


@pytest.mark.parametrize("default", [np.ones(5), "a", None, 1j, [[1], []]])
def test_the_default_of_a_mean_must_fit(default) -> None:
    inbox = Inbox(Links.from_lists([[0], []]), {})
    with pytest.raises(ValueError, match=r"default must be .* shape \(2, 3\) of rows"):
        inbox.mean(np.ones((2, 3)), default=default)
    assert inbox.mean(np.ones((2, 3)), default=[2, 3, 4])[1].tolist() == [2, 3, 4]


def test_an_inbox_needs_links() -> None:
    with pytest.raises(TypeError, match=r"links must be Links, .* got 3"):
        Inbox(3, {})


def test_messages_that_were_replaced_are_not_read_past_their_end() -> None:
    inbox = Inbox(Links.from_lists([[0], [1]]), {"cost": np.ones(2)})
    inbox.messages["cost"] = np.ones(1)
    with pytest.raises(ValueError, match="one real number for each agent"):
        inbox.best("cost")


@pytest.mark.parametrize("include_self", [True, False])
@pytest.mark.parametrize(
    "kind", ["f2", ">f4", ">f8", "g", "?", "i1", ">i2", "u1", ">u8", ">i8"]
)
def test_numbers_of_any_format(kind: str, include_self: bool) -> None:
    """Kernels know the formats of this machine only."""
    values = np.array([1, 0, 1]).astype(kind)
    lists = [[0, 2], [0, 1, 2], [2]]
    inbox = Inbox(Links.from_lists(lists), {"cost": values})
    assert inbox.best("cost").tolist() == [0, 1, 2]
    assert inbox.sum(values).tolist() == [2.0, 2.0, 1.0]
    every = Inbox(Links.everyone(3, include_self), {"cost": values})
    assert every.best("cost").tolist() == [1, 1 if include_self else 0, 1]


def test_numbers_that_float64_would_confuse() -> None:
    close = np.array([2**63 + 1, 2**63], np.uint64)
    assert Inbox(Links.everyone(2), {"cost": close}).best("cost").tolist() == [1, 1]
    signed = np.array([2**53 + 1, 2**53])
    assert Inbox(Links.everyone(2), {"cost": signed}).best("cost").tolist() == [1, 1]
    beyond = np.array([np.longdouble("1e4000"), 1.0])
    inbox = Inbox(Links.everyone(2), {"cost": beyond})
    assert inbox.best("cost").tolist() == [1, 1]
    assert inbox.sum(beyond).tolist() == [math.inf, math.inf]


def test_packed_and_masked_messages() -> None:
    packed = np.zeros(3, np.dtype([("flag", "i1"), ("cost", "f8")]))
    packed["cost"] = [3.0, 1.0, 2.0]  # not at multiples of eight bytes
    inbox = Inbox(Links.everyone(3), {"cost": packed["cost"]})
    assert inbox.best("cost").tolist() == [1, 1, 1]
    hidden = np.ma.array([3.0, 1.0, 2.0], mask=[0, 1, 0])
    with pytest.raises(ValueError, match="must be one real number for each agent"):
        Inbox(Links.everyone(3), {"cost": hidden}).best("cost")


def test_a_message_that_is_missing_among_odd_names() -> None:
    inbox = Inbox(Links.everyone(1), {1: np.zeros(1), "a": np.zeros(1)})
    with pytest.raises(ValueError, match=r"a message 'cost', got \['1', 'a'\]"):
        inbox.message("cost")
    assert "['1', 'a']" in repr(inbox)
