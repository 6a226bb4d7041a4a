"""What the agents of a swarm have received in a step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.swarm.links import Links
from acl_gym.swarm.rows import check_messages
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray


class Inbox:
    """The messages w_i of all agents, Definition 6.2: who hears whom, and what.

    Messages are broadcast, so they are kept once for each sender and not once for each
    link. Sums are made in the order of the senders' numbers, so that the same messages
    give the same bits.

    Args:
        links: who hears whom.
        messages: what each agent has sent, name -> `(n, ...)`.

    Attributes:
        links: see above.
        messages: see above.

    Raises:
        TypeError: `links` are none, or `messages` is no dict of arrays.
        ValueError: an array does not have a row for each agent.

    Example:
        >>> import numpy as np
        >>> inbox = Inbox(
        ...     Links.from_lists([[0, 1], [1, 2], [2]]),
        ...     {"cost": np.array([3.0, 2.0, 1.0])},
        ... )
        >>> inbox.best("cost")
        array([1, 2, 2])
        >>> inbox.mean(inbox.messages["cost"])
        array([2.5, 1.5, 1. ])
    """

    __slots__ = ("links", "messages")

    def __init__(self, links: Links, messages: dict[str, NDArray[Any]]) -> None:
        if not isinstance(links, Links):
            raise TypeError(
                "links must be Links, such as Links.everyone(n), got "
                f"{validation.shown(links)}."
            )
        check_messages(messages, links.n)
        self.links = links
        self.messages = messages

    @property
    def count(self) -> IntArray:
        """How many agents each one has heard, `(n,)`."""
        return self.links.degrees

    def best(self, key: str) -> IntArray:
        """Return for each agent whom it has heard the least value of.

        Args:
            key: a message of one number, `(n,)`, such as the cost of the best solution.
                Integers are compared as they are, floats of any format as float64.

        Returns:
            Numbers of senders, `(n,)`; of equal values the sender with the lowest
            number, -1 where an agent has heard nothing.

        Raises:
            ValueError: there is no such message, it is not one number, or a value is
                NaN; infinity is allowed.
        """
        message, links = self.message(key), self.links
        plain = type(message) is np.ndarray
        array = message if plain else validation.as_array(message)
        if array is None or array.shape != (links.n,) or array.dtype.kind not in "biuf":
            raise ValueError(
                f"message {key!r} must be one real number for each agent, got "
                f"{validation.shown(message)} of {message.dtype} and shape "
                f"{message.shape}."
            )
        values = _comparable(array)
        found = np.empty(links.n, np.int64)
        if links.is_implicit:
            unordered = _best_of_all(values, links.all_others, found)
        else:
            unordered = _best(values, *links.csr(), found)
        if unordered >= 0:
            raise ValueError(
                f"message {key!r} must not be NaN, got NaN from agent {unordered}; send "
                "infinity where there is no value."
            )
        return found

    def sum(self, rows: ArrayLike) -> FloatArray:
        """Return for each agent the sum of `rows` over those that it has heard.

        Args:
            rows: of the senders, `(n, ...)`, such as `inbox.messages["x"]`.

        Returns:
            float64 of the shape of `rows`; 0 where an agent has heard nothing.

        Raises:
            ValueError: `rows` are not real numbers with a row for each agent.
        """
        links = self.links
        array = validation.as_array(rows)
        if (
            array is None
            or array.dtype.kind not in "biuf"
            or array.ndim == 0
            or array.shape[0] != links.n
        ):
            raise ValueError(
                f"rows must be real numbers with a row for each of the {links.n} agents, "
                f"got {validation.shown(rows)}."
            )
        flat = validation.float64(array).reshape(links.n, -1)
        sums = np.empty_like(flat)
        if links.complete:
            _sum_everyone(flat, sums)
        elif links.all_others:
            _sum_others(flat, sums)
        else:
            _sum(flat, *links.csr(), sums)
        return sums.reshape(array.shape)

    def mean(self, rows: ArrayLike, default: ArrayLike = 0.0) -> FloatArray:
        """Return for each agent the mean of `rows` over those that it has heard.

        Args:
            rows: of the senders, `(n, ...)`.
            default: for agents that have heard nothing; broadcast to the shape of
                `rows`.

        Returns:
            float64 of the shape of `rows`.

        Raises:
            ValueError: `rows` are not real numbers with a row for each agent, or
                `default` does not fit them.
        """
        sums, count = self.sum(rows), self.count
        array = validation.as_array(default)
        if array is None or array.dtype.kind not in "biuf" or not _fits(array, sums):
            raise ValueError(
                "default must be a number, or real numbers that can be broadcast to the "
                f"shape {sums.shape} of rows, got {validation.shown(default)}."
            )
        count = count.reshape(count.shape + (1,) * (sums.ndim - 1))
        return np.where(count > 0, sums / np.maximum(count, 1), array)

    def pairs(self, name: str) -> NDArray[Any]:
        """Return a message link by link, `(n_links, ...)`: that of `links.sender`.

        Raises:
            ValueError: there is no such message.
        """
        rows: NDArray[Any] = self.message(name)[self.links.sender]
        return rows

    def message(self, name: str) -> NDArray[Any]:
        """Return a message as it was sent, `(n, ...)`: a row for each sender.

        Raises:
            ValueError: there is no such message.
        """
        try:
            return self.messages[name]
        except KeyError:
            raise ValueError(
                f"there must be a message {name!r}, got {self._names}; let send() of the "
                "agents return it, and the channel deliver it."
            ) from None

    def __repr__(self) -> str:
        """What was sent, to how many."""
        return f"Inbox({self.links!r}, messages={self._names})"

    @property
    def _names(self) -> list[str]:
        return sorted(map(str, self.messages))


def _comparable(values: NDArray[Any]) -> NDArray[Any]:
    """Numbers as kernels compare them: int64, uint64 where they need it, or float64."""
    if values.dtype.kind == "f":
        return validation.float64(values)
    wide = np.uint64 if values.dtype.kind == "u" else np.int64
    return np.require(values, wide, ("C", "A"))


def checked_inbox(delivered: Any, channel: Any, n: int) -> Inbox:
    """Return what a channel has delivered, which may be one of the user's own.

    Args:
        delivered: what `Channel.deliver` has returned.
        channel: that channel.
        n: how many agents there are.

    Raises:
        TypeError: it is no `Inbox`.
        ValueError: it is that of another number of agents.
    """
    if not isinstance(delivered, Inbox):
        raise TypeError(
            f"{type(channel).__name__}.deliver must return an Inbox, got {validation.shown(delivered)}; return "
            "Inbox(links, sent)."
        )
    if delivered.links.n != n:
        raise ValueError(
            f"{type(channel).__name__}.deliver must return links of the {n} agents that "
            f"there are, got links of {delivered.links.n}; make them for len(x) agents."
        )
    return delivered


def _fits(array: NDArray[Any], target: NDArray[Any]) -> bool:
    """Whether an array can be broadcast to the shape of another one."""
    try:
        return np.broadcast_shapes(array.shape, target.shape) == target.shape
    except ValueError:
        return False


@njit
def _best_of_all(values: NDArray[Any], all_others: bool, found: IntArray) -> int:
    """Whom everyone has heard the least value of; the first NaN, or -1 if there is none.

    Args:
        values: of all agents, `(n,)`.
        all_others: whether an agent does not hear itself.
        found: `(n,)`, receives the senders, -1 where there is no other agent.
    """
    first = 0
    for j in range(values.size):
        if values[j] != values[j]:
            return j
        if values[j] < values[first]:
            first = j
    for i in range(found.size):
        found[i] = first
    if all_others:
        second = -1
        for j in range(values.size):
            if j != first and (second < 0 or values[j] < values[second]):
                second = j
        found[first] = second
    return -1


@njit
def _best(
    values: NDArray[Any], senders: IntArray, offsets: IntArray, found: IntArray
) -> int:
    """The same for those that each agent hears; -1 for one that hears nobody."""
    for j in range(values.size):
        if values[j] != values[j]:
            return j
    for i in range(found.size):
        best = -1
        for link in range(offsets[i], offsets[i + 1]):
            j = senders[link]
            if best < 0 or values[j] < values[best]:
                best = j
        found[i] = best
    return -1


@njit
def _sum(
    rows: FloatArray, senders: IntArray, offsets: IntArray, sums: FloatArray
) -> None:
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            sums[i, k] = 0.0
        for link in range(offsets[i], offsets[i + 1]):
            j = senders[link]
            for k in range(rows.shape[1]):
                sums[i, k] += rows[j, k]


@njit
def _sum_everyone(rows: FloatArray, sums: FloatArray) -> None:
    total = np.zeros(rows.shape[1])
    for j in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            total[k] += rows[j, k]
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            sums[i, k] = total[k]


@njit
def _sum_others(rows: FloatArray, sums: FloatArray) -> None:
    """What comes before an agent plus what comes after it: nothing is subtracted."""
    n, d = rows.shape
    for k in range(d):
        before = 0.0
        for i in range(n):
            sums[i, k] = before
            before += rows[i, k]
        after = 0.0
        for i in range(n - 1, -1, -1):
            sums[i, k] += after
            after += rows[i, k]
