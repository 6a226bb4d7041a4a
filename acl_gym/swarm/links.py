"""Who hears whom: the neighbourhoods of all agents of a swarm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.swarm.rows import check_room
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, IntArray

_NOTHING: IntArray = validation.read_only(np.empty(0, np.int64))

_MOST_AGENTS = 3_000_000_000
"""The number of a pair of agents fits into an int64."""


_HEAR_FEWER = (
    "let each agent hear fewer others, or use Inbox.best and Inbox.sum, which need no "
    "list of the links"
)


class Links:
    """The neighbourhoods N_i of all agents, Definition 6.6; they do not change.

    The arrays are copied, and those that are returned are read-only: kernels follow the
    numbers in them without a look at the limits.

    A link leads from a sender to a receiver: agent i hears agent j if j is in N_i. Links
    are most easily made with `everyone`, `from_pairs` or `from_lists`.

    Args:
        n: the number of agents, >= 1.
        sender: whom the receivers hear, `(n_links,)` int64: the numbers of those that
            agent 0 hears in ascending order, then of those that agent 1 hears, and so on.
        offsets: the senders of receiver i are `sender[offsets[i]:offsets[i + 1]]`,
            `(n + 1,)` int64.

    Attributes:
        n: the number of agents.
        n_links: the number of links.
        complete: whether every agent hears all agents, itself included. Such links are
            not written out, so that they need no memory; `receiver`, `sender` and
            `offsets` are made when they are asked for.
        all_others: whether every agent hears all agents but itself. Not written out
            either.

    Raises:
        TypeError: `n` is not an integer.
        ValueError: the arrays are not as described.
    """

    __slots__ = ("_offsets", "_receiver", "_sender", "all_others", "complete", "n")

    n: int
    complete: bool
    all_others: bool
    _sender: IntArray
    _offsets: IntArray
    _receiver: IntArray | None  # made when it is asked for

    def __init__(self, n: int, sender: IntArray, offsets: IntArray) -> None:
        n = validation.integer("n", n, at_least=1, at_most=_MOST_AGENTS)
        for array in (sender, offsets):
            if not isinstance(array, np.ndarray) or array.dtype != np.int64:
                raise ValueError(
                    "sender and offsets must be arrays of int64, got "
                    f"{validation.shown(array)}; use Links.from_pairs for others."
                )
        # Copied before they are checked, so that nobody changes them afterwards.
        sender, offsets = np.array(sender), np.array(offsets)
        if (
            sender.ndim != 1
            or offsets.shape != (n + 1,)
            or not _in_rows(sender, offsets)
        ):
            raise ValueError(
                f"offsets must be n + 1 = {n + 1} numbers that rise from 0 to the number "
                f"of links, and senders from 0 to {n - 1} must ascend between them, got "
                f"offsets {validation.shown(offsets)} for {sender.size} senders; use "
                "Links.from_pairs for links in any order."
            )
        self._set(n, sender, offsets)

    def _set(
        self,
        n: int,
        sender: IntArray = _NOTHING,
        offsets: IntArray = _NOTHING,
        complete: bool = False,
        all_others: bool = False,
    ) -> None:
        for array in (sender, offsets):
            array.setflags(write=False)
        set_once = super().__setattr__
        set_once("n", n)
        set_once("complete", complete)
        set_once("all_others", all_others)
        # Views of arrays that are read-only themselves cannot be made writable again.
        set_once("_sender", sender.view())
        set_once("_offsets", offsets.view())
        set_once("_receiver", None)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(
            f"links do not change, got a new value for {name}; make others with "
            "Links.from_pairs or Links.from_lists."
        )

    def __reduce__(self) -> tuple[Any, ...]:
        if self.is_implicit:
            return _everyone, (self.n, self.complete)
        return Links, (self.n, self._sender, self._offsets)

    @classmethod
    def everyone(cls, n: int, include_self: bool = True) -> Links:
        """Let every agent hear all agents.

        Args:
            n: the number of agents, >= 1.
            include_self: whether an agent hears itself.

        Raises:
            TypeError: `n` is not an integer.
            ValueError: it is < 1, or no memory is large enough for so many agents.
        """
        n = _checked_number(n)
        include_self = validation.boolean("include_self", include_self)
        links = cls.__new__(cls)
        links._set(n, complete=include_self, all_others=not include_self)
        return links

    @classmethod
    def _from_rows(cls, n: int, sender: IntArray, offsets: IntArray) -> Links:
        """Make links of arrays that only this package knows and that need no check."""
        links = cls.__new__(cls)
        links._set(n, sender, offsets)
        return links

    @classmethod
    def from_pairs(cls, n: int, receiver: ArrayLike, sender: ArrayLike) -> Links:
        """Make links from pairs of agents, in any order; a repeated pair is one link.

        Args:
            n: the number of agents, >= 1.
            receiver: who hears, `(n_links,)`, numbers from 0 to n - 1.
            sender: whom, `(n_links,)`.

        Raises:
            TypeError: `n` is not an integer.
            ValueError: the arrays are not such numbers, or not equally long; or no
                memory is large enough for so many agents.
        """
        n = _checked_number(n)
        to, by = _agents("receiver", receiver, n), _agents("sender", sender, n)
        if to.shape != by.shape:
            raise ValueError(
                "receiver and sender must be equally long, a pair for each link, got "
                f"{to.size} and {by.size}."
            )
        pairs = np.unique(to * n + by)  # sorted by receiver, then by sender
        counts = np.bincount(pairs // n, minlength=n)
        return cls._from_rows(n, pairs % n, _offsets_of(counts))

    @classmethod
    def from_lists(cls, lists: Sequence[ArrayLike]) -> Links:
        """Make links from a list for each agent of those that it hears.

        Args:
            lists: N_i of each agent, numbers from 0 to n - 1, n being the number of
                lists.

        Raises:
            TypeError: `lists` is no sequence.
            ValueError: there is no list, or a list has other elements.
        """
        try:
            count = len(lists)
        except TypeError:
            raise TypeError(
                "lists must be a sequence with a list for each agent, such as "
                f"[[1], [0]], got {validation.shown(lists)}."
            ) from None
        n = validation.integer("the number of lists", count, at_least=1)
        rows = [_agents(f"lists[{i}]", each, n) for i, each in enumerate(lists)]
        receiver = np.repeat(np.arange(n), [row.size for row in rows])
        return cls.from_pairs(n, receiver, np.concatenate(rows))

    @property
    def is_implicit(self) -> bool:
        """Whether everyone hears everyone, or all others, and links are not written out."""
        return self.complete or self.all_others

    @property
    def n_links(self) -> int:
        """The number of links."""
        if self.is_implicit:
            return self.n * (self.n - self.all_others)
        return int(self._sender.size)

    @property
    def degrees(self) -> IntArray:
        """How many agents each one hears, `(n,)`."""
        if self.is_implicit:
            return np.full(self.n, self.n - self.all_others)
        return np.diff(self._offsets)

    @property
    def offsets(self) -> IntArray:
        """The links of receiver i are `offsets[i]:offsets[i + 1]`; `(n + 1,)`, read-only."""
        if self.is_implicit:
            each = self.n - self.all_others
            return validation.read_only(np.arange(self.n + 1) * each)
        return self._offsets

    @property
    def receiver(self) -> IntArray:
        """Who hears, `(n_links,)`, in ascending order, read-only.

        Raises:
            ValueError: no memory is large enough, where everyone hears everyone.
        """
        if self.is_implicit:
            check_room(self.n_links, _HEAR_FEWER)
            return validation.read_only(
                np.repeat(np.arange(self.n), self.n - self.all_others)
            )
        receiver = self._receiver
        if receiver is None:
            receiver = np.repeat(np.arange(self.n), np.diff(self._offsets))
            receiver.setflags(write=False)
            receiver = receiver.view()
            super().__setattr__("_receiver", receiver)
        return receiver

    @property
    def sender(self) -> IntArray:
        """Whom, `(n_links,)`, in ascending order for each receiver, read-only.

        Raises:
            ValueError: no memory is large enough, where everyone hears everyone.
        """
        if self.is_implicit:
            check_room(self.n_links, _HEAR_FEWER)
            senders = np.tile(np.arange(self.n), (self.n, 1))
            if self.all_others:
                senders = senders[~np.eye(self.n, dtype=np.bool_)]
            return validation.read_only(senders.reshape(-1))
        return self._sender

    @property
    def hears_itself(self) -> BoolArray:
        """Whether there is a link from each agent to itself, `(n,)`."""
        if self.is_implicit:
            return np.full(self.n, self.complete)
        to_itself = np.empty(self.n, np.bool_)
        _find_own(self._sender, self._offsets, to_itself)
        return to_itself

    @property
    def is_symmetric(self) -> bool:
        """Whether any two agents hear each other, or neither hears the other."""
        return self.is_implicit or bool(_is_symmetric(self._sender, self._offsets))

    def csr(self) -> tuple[IntArray, IntArray]:
        """Return `sender` and `offsets`, compressed sparse rows for kernels, read-only.

        Raises:
            ValueError: no memory is large enough, where everyone hears everyone.
        """
        if self.is_implicit:
            return self.sender, self.offsets
        return self._sender, self._offsets

    def subset(self, kept: ArrayLike) -> Links:
        """Return some of these links.

        Args:
            kept: which of them, `(n_links,)`.

        Raises:
            ValueError: it is not such an array.
        """
        flags = validation.as_array(kept)
        if flags is None or flags.shape != (self.n_links,) or flags.dtype != np.bool_:
            raise ValueError(
                f"kept must be {self.n_links} flags, one for each link, got "
                f"{validation.shown(kept)}; flags are True and False."
            )
        counts = np.bincount(self.receiver[flags], minlength=self.n)
        return Links._from_rows(self.n, self.sender[flags], _offsets_of(counts))

    def __repr__(self) -> str:
        """How many agents and links there are."""
        return f"Links(n={self.n}, n_links={self.n_links})"


def _everyone(n: int, include_self: bool) -> Links:
    """What `pickle` makes such links with."""
    return Links.everyone(n, include_self)


def _checked_number(n: Any) -> int:
    """The number of agents, whose links have some rows of numbers at least."""
    count = validation.integer("n", n, at_least=1, at_most=_MOST_AGENTS)
    check_room(0, "use fewer agents", n_agents=count)
    return count


def _agents(name: str, numbers: ArrayLike, n: int) -> IntArray:
    """Numbers of agents as an array, checked."""
    array = validation.as_array(numbers)
    if array is not None and array.size == 0 and array.ndim == 1:
        return _NOTHING
    if array is not None:
        check_room(array.size, "pass fewer")
    if array is None or array.ndim != 1 or array.dtype.kind not in "iu":
        raise ValueError(
            f"{name} must be a list of numbers of agents, got "
            f"{validation.shown(numbers)}."
        )
    if array.min() < 0 or array.max() >= n:
        bad = array[(array < 0) | (array >= n)][0]
        raise ValueError(
            f"{name} must hold numbers of agents from 0 to {n - 1}, got {bad}."
        )
    return array.astype(np.int64)


def _offsets_of(counts: NDArray[Any]) -> IntArray:
    """Where the links of each receiver begin, and where the last ones end."""
    offsets = np.zeros(counts.size + 1, np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


@njit
def _in_rows(senders: IntArray, offsets: IntArray) -> bool:
    """Whether senders ascend, and exist, in the row of each receiver."""
    n = offsets.size - 1
    if offsets[0] != 0 or offsets[n] != senders.size:
        return False
    for i in range(n):
        if not offsets[i] <= offsets[i + 1] <= senders.size:
            return False
        before = -1
        for link in range(offsets[i], offsets[i + 1]):
            if not before < senders[link] < n:
                return False
            before = senders[link]
    return True


@njit
def link_of(receiver: int, sender: int, senders: IntArray, offsets: IntArray) -> int:
    """The number of the link from a sender to a receiver; -1 where there is none."""
    low, high = offsets[receiver], offsets[receiver + 1]
    while low < high:
        middle = (low + high) // 2
        if senders[middle] < sender:
            low = middle + 1
        else:
            high = middle
    found = low < offsets[receiver + 1] and senders[low] == sender
    return low if found else -1


@njit
def _find_own(senders: IntArray, offsets: IntArray, to_itself: BoolArray) -> None:
    for i in range(to_itself.size):
        to_itself[i] = link_of(i, i, senders, offsets) >= 0


@njit
def _is_symmetric(senders: IntArray, offsets: IntArray) -> bool:
    for i in range(offsets.size - 1):
        for link in range(offsets[i], offsets[i + 1]):
            if link_of(senders[link], i, senders, offsets) < 0:
                return False
    return True
