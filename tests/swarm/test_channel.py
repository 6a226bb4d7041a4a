"""Lossy and delayed channels."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.swarm import (
    Channel,
    Delayed,
    Everyone,
    Inbox,
    Links,
    Lossy,
    Radius,
    Ring,
    Topology,
)
from tests.swarm.test_inbox import any_links
from tests.swarm.test_links import as_lists


class Given(Topology):
    """Links that a test has made."""

    def __init__(self, links: Links) -> None:
        self._links = links

    def links(self, x) -> Links:
        return self._links


def delivered(channel: Channel, n: int, rng: np.random.Generator) -> Inbox:
    return channel.deliver({"v": np.arange(n)}, np.zeros((n, 1)), rng)


@given(any_links(), st.floats(0, 1), st.integers(0, 2**32))
def test_a_link_is_lost_if_its_number_is_below_p(links, p, seed) -> None:
    inbox = delivered(Lossy(Given(links), p), links.n, np.random.default_rng(seed))
    drawn = iter(np.random.default_rng(seed).random(links.n_links))
    wanted = [
        [j for j in heard if next(drawn) >= p or j == i]
        for i, heard in enumerate(as_lists(links))
    ]
    assert as_lists(inbox.links) == wanted
    assert inbox.messages["v"].tolist() == list(range(links.n))


@given(any_links(), st.floats(0, 1), st.integers(0, 2**32))
def test_symmetric_losses_go_by_the_number_of_one_direction(links, p, seed) -> None:
    channel = Lossy(Given(links), p, symmetric=True)
    inbox = delivered(channel, links.n, np.random.default_rng(seed))
    number = {}
    drawn = iter(np.random.default_rng(seed).random(links.n_links))
    for i, heard in enumerate(as_lists(links)):
        for j in heard:
            number[i, j] = next(drawn)

    def arrives(i: int, j: int) -> bool:
        first = min(i, j), max(i, j)
        return i == j or number.get(first, number[i, j]) >= p

    wanted = [
        [j for j in heard if arrives(i, j)] for i, heard in enumerate(as_lists(links))
    ]
    assert as_lists(inbox.links) == wanted
    if links.is_symmetric:
        assert inbox.links.is_symmetric


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_share_p_is_lost_and_nobody_loses_its_own(symmetric) -> None:
    n, p, repeats = 40, 0.3, 200
    channel, rng = Lossy(Everyone(), p, symmetric), np.random.default_rng(1)
    kept = np.zeros((n, n))
    for _ in range(repeats):
        links = delivered(channel, n, rng).links
        kept[links.receiver, links.sender] += 1
    own = np.eye(n, dtype=np.bool_)
    assert (kept[own] == repeats).all()
    independent = n * (n - 1) * repeats / (2 if symmetric else 1)
    error = math.sqrt(p * (1 - p) / independent)
    assert kept[~own].mean() / repeats == pytest.approx(1 - p, abs=4 * error)
    # No link is treated differently from others.
    spread = kept[~own].std() / math.sqrt(repeats * p * (1 - p))
    assert spread == pytest.approx(1.0, abs=0.1)


def test_the_same_seed_loses_the_same_messages() -> None:
    channel, x = Lossy(Radius(0.5), 0.4), np.random.default_rng(0).random((50, 2))
    found = [
        channel.deliver({}, x, np.random.default_rng(7)).links.sender.tolist()
        for _ in range(2)
    ]
    assert found[0] == found[1]
    assert (
        channel.deliver({}, x, np.random.default_rng(8)).links.sender.tolist()
        != (found[0])
    )


@pytest.mark.parametrize("p", [-0.1, 1.1, math.nan])
def test_p_must_be_a_probability(p) -> None:
    with pytest.raises(ValueError, match=r"p must lie in \[0, 1\]"):
        Lossy(Everyone(), p)


def test_losses_of_everyone_need_a_list_of_links() -> None:
    with pytest.raises(ValueError, match="links must fit"):
        delivered(Lossy(Everyone(), 0.5), 10**6, np.random.default_rng(0))


@given(st.integers(0, 4), st.integers(1, 8))
def test_messages_and_positions_arrive_later(delay, steps) -> None:
    rng, channel = np.random.default_rng(0), Delayed(Radius(1.0), delay)
    channel.reset(3)
    sent, x = [], []
    for k in range(steps):
        sent.append(rng.normal(size=3))
        x.append(rng.normal(size=(3, 1)))
        inbox = channel.deliver({"v": sent[k]}, x[k], rng)
        then = max(k - delay, 0)
        assert inbox.messages["v"].tolist() == sent[then].tolist()
        assert as_lists(inbox.links) == as_lists(Radius(1.0).links(x[then]))


def test_late_messages_are_as_they_were_sent() -> None:
    channel, rng = Delayed(Everyone(), 1), np.random.default_rng(0)
    v, x = np.zeros(2), np.zeros((2, 1))
    for k in range(3):
        v[:] = k
        inbox = channel.deliver({"v": v}, x, rng)
    assert inbox.messages["v"].tolist() == [1, 1]


def test_reset_forgets_what_is_under_way() -> None:
    inside = Delayed(Everyone(), 2)
    channel, rng = Lossy(Delayed(inside, 1), 0.0), np.random.default_rng(0)
    for n in (2, 3):  # messages of two agents would not fit to three
        channel.reset(n)
        for k in range(5):
            inbox = channel.deliver({"v": np.full(n, k)}, np.zeros((n, 1)), rng)
            assert inbox.messages["v"].tolist() == [max(k - 3, 0)] * n


@pytest.mark.parametrize("wrapper", [lambda c: Lossy(c, 0.5), lambda c: Delayed(c, 1)])
def test_wrappers_need_a_channel(wrapper) -> None:
    with pytest.raises(TypeError, match="channel must be a Channel"):
        wrapper(Ring)


def test_a_delay_is_a_number_of_steps() -> None:
    with pytest.raises(ValueError, match="steps must be at least 0"):
        Delayed(Ring(), -1)


def test_repr_is_the_call_that_makes_it() -> None:
    channel = Lossy(Delayed(Ring(), 2), 0.1, symmetric=True)
    assert repr(eval(repr(channel))) == repr(channel)


@pytest.mark.parametrize(
    ("sent", "error", "message"),
    [
        (None, TypeError, "messages must be a dict of arrays"),
        ({"a": [1, 2]}, TypeError, "message 'a' must be an array with a row"),
        ({"a": np.zeros(3)}, ValueError, "a row for each of the 2 agents"),
    ],
)
def test_a_delay_checks_what_is_sent_when_it_is_sent(sent, error, message) -> None:
    channel, rng = Delayed(Everyone(), 3), np.random.default_rng(0)
    channel.reset(2)
    channel.deliver({"a": np.zeros(2)}, np.zeros((2, 1)), rng)
    with pytest.raises(error, match=message):
        channel.deliver(sent, np.zeros((2, 1)), rng)


def test_agents_that_change_what_they_hear_do_not_change_later_messages() -> None:
    channel, rng = Delayed(Everyone(), 2), np.random.default_rng(0)
    channel.reset(3)
    heard = []
    for step in range(6):
        sent = {"c": np.full(3, float(step))}
        inbox = channel.deliver(sent, np.zeros((3, 2)), rng)
        heard.append(inbox.messages["c"].tolist())
        inbox.messages["c"] *= 2.0
        inbox.messages["d"] = inbox.messages.pop("c")
    assert heard == [[k] * 3 for k in (0.0, 0.0, 0.0, 1.0, 2.0, 3.0)]
