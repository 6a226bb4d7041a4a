"""The communication channel: who receives which messages."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.swarm.inbox import Inbox, checked_inbox
from acl_gym.swarm.links import Links, link_of
from acl_gym.swarm.rows import check_messages
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class Channel(ABC):
    """The channel C of the environment, Definition 6.5: v_s, x_s -> w_s.

    The channels of this package are `Everyone`, `Ring`, `VonNeumann`, `Radius` and
    `Nearest`, which say who hears whom, and the wrappers `Lossy` and `Delayed`.
    """

    def reset(self, n: int) -> None:  # noqa: B027
        """Forget what was sent, before a run of n agents; by default nothing is kept."""

    @abstractmethod
    def deliver(
        self,
        sent: dict[str, NDArray[Any]],
        x: FloatArray,
        rng: np.random.Generator,
    ) -> Inbox:
        """Deliver the messages of a step.

        Args:
            sent: v_i of all agents, name -> `(n, ...)`. They may be arrays that the
                agents keep: a channel that changes messages changes copies.
            x: positions of all agents, `(n, dim)`.
            rng: the generator of the run.

        Returns:
            w_i of all agents; of as many as there are positions.
        """


class Topology(Channel):
    """A channel in which all messages arrive at once, with those who hear the sender."""

    @abstractmethod
    def links(self, x: FloatArray) -> Links:
        """Say who hears whom.

        Args:
            x: positions of all agents, `(n, dim)`.
        """

    def deliver(
        self,
        sent: dict[str, NDArray[Any]],
        x: FloatArray,
        rng: np.random.Generator,
    ) -> Inbox:
        """See `Channel.deliver`; nothing is drawn from `rng`."""
        return Inbox(self.links(x), sent)


class ChannelWrapper(Channel):
    """A channel that changes what another one delivers.

    Args:
        channel: the other one.

    Raises:
        TypeError: it is not a `Channel`.
    """

    def __init__(self, channel: Channel) -> None:
        if not isinstance(channel, Channel):
            raise TypeError(
                "channel must be a Channel, such as Everyone(), got "
                f"{validation.shown(channel)}."
            )
        self.channel = channel

    def reset(self, n: int) -> None:
        """See `Channel.reset`."""
        self.channel.reset(n)


class Lossy(ChannelWrapper):
    """Loses messages: what is sent over a link is lost with probability p.

    In every step one number is drawn for each link of the channel inside. An agent
    always hears itself, if it does so in that channel.

    Args:
        channel: who hears whom if nothing is lost.
        p: the probability of a loss, in [0, 1].
        symmetric: whether two agents that hear each other lose their messages to each
            other together, as when the way between them is blocked.

    Raises:
        TypeError: `channel` is not a `Channel`, or `p` not a number.
        ValueError: `p` is out of range.
    """

    def __init__(self, channel: Channel, p: float, symmetric: bool = False) -> None:
        super().__init__(channel)
        self.p = validation.number("p", p, at_least=0, at_most=1)
        self.symmetric = validation.boolean("symmetric", symmetric)

    def deliver(
        self,
        sent: dict[str, NDArray[Any]],
        x: FloatArray,
        rng: np.random.Generator,
    ) -> Inbox:
        """See `Channel.deliver`."""
        delivered = self.channel.deliver(sent, x, rng)
        inbox = checked_inbox(delivered, self.channel, len(x))
        links = inbox.links
        senders, offsets = links.csr()  # says so if there are too many
        drawn = rng.random(links.n_links)
        kept = np.empty(links.n_links, np.bool_)
        _keep(senders, offsets, drawn, self.p, self.symmetric, kept)
        return Inbox(links.subset(kept), inbox.messages)

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"Lossy({self.channel!r}, p={self.p}, symmetric={self.symmetric})"


@njit
def _keep(
    senders: IntArray,
    offsets: IntArray,
    drawn: FloatArray,
    p: float,
    symmetric: bool,
    kept: BoolArray,
) -> None:
    for i in range(offsets.size - 1):
        for link in range(offsets[i], offsets[i + 1]):
            j = senders[link]
            coin = drawn[link]
            if symmetric and j < i:
                back = link_of(j, i, senders, offsets)
                if back >= 0:
                    coin = drawn[back]
            kept[link] = i == j or coin >= p


class Delayed(ChannelWrapper):
    """Delivers late: messages and positions are those of some steps ago.

    At the beginning they are the oldest that there are. Agents hear themselves late as
    well.

    Args:
        channel: who hears whom, at the positions of that time.
        steps: how many steps, >= 0.

    Raises:
        TypeError: `channel` is not a `Channel`, or `steps` not an integer.
        ValueError: `steps` is < 0.
    """

    def __init__(self, channel: Channel, steps: int) -> None:
        super().__init__(channel)
        self.steps = validation.integer("steps", steps, at_least=0)
        self._under_way: deque[tuple[dict[str, NDArray[Any]], FloatArray]] = deque()

    def reset(self, n: int) -> None:
        """See `Channel.reset`."""
        self._under_way.clear()
        super().reset(n)

    def deliver(
        self,
        sent: dict[str, NDArray[Any]],
        x: FloatArray,
        rng: np.random.Generator,
    ) -> Inbox:
        """See `Channel.deliver`."""
        check_messages(sent, len(x))
        # Copies, because agents may change what they have sent.
        own = {name: np.array(rows) for name, rows in sent.items()}
        self._under_way.append((own, np.array(x)))
        if len(self._under_way) > self.steps + 1:
            self._under_way.popleft()
        messages, positions = self._under_way[0]
        if len(self._under_way) <= self.steps:
            # They are delivered again, also if agents change what they receive.
            messages = {name: np.array(rows) for name, rows in messages.items()}
        return self.channel.deliver(messages, positions, rng)

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"Delayed({self.channel!r}, steps={self.steps})"
