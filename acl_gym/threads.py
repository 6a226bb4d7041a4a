"""Several threads within one colony, with the same bits whatever their number.

What a step does for each ant by itself (moving it, locating its state, drawing its
action) is done for slices of the ants at a time, each by a thread. What the ants share
(decay, and the sum of the deposits) is done by one thread, in the order of the ants.
So a result does not depend on the number of threads, nor on who is first.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice, pairwise
from typing import TypeVar

from acl_gym import validation

Given = TypeVar("Given")
Made = TypeVar("Made")

LEAST_ANTS = 4_096
"""Ants that a thread must have to do, or waking it costs more than it saves."""

ALL = slice(None)


class _Team:
    """How many threads there may be, and the pool that they wait in."""

    def __init__(self) -> None:
        self.count = 1
        self.pool: ThreadPoolExecutor | None = None

    def submit(self, work: Callable[[Given], Made], item: Given) -> Future[Made]:
        if self.pool is None:
            self.pool = ThreadPoolExecutor(self.count, thread_name_prefix="acl_gym")
        return self.pool.submit(work, item)

    def resize(self, count: int) -> None:
        if self.pool is not None and count != self.count:
            self.pool.shutdown(wait=False)
            self.pool = None
        self.count = count

    def forget_pool_of_parent(self) -> None:
        """A forked process has the pool but no threads: work would wait for ever."""
        self.pool = None


_team = _Team()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_team.forget_pool_of_parent)


def set_num_threads(count: int) -> None:
    """Let colonies and vector environments use `count` threads; at first it is 1.

    They use them from about 8,000 ants on; below that, waking a thread takes as long
    as the work. Results are the same to the last bit. Independent runs gain more
    from processes of their own.

    Args:
        count: >= 1.

    Raises:
        TypeError: `count` is not an integer.
        ValueError: it is less than 1.
    """
    _team.resize(validation.integer("count", count, at_least=1))


def get_num_threads() -> int:
    """How many threads colonies and vector environments use at most."""
    return _team.count


def parts(size: int) -> int:
    """How many threads are worth waking for `size` ants."""
    return 1 if _team.count == 1 else max(1, min(_team.count, size // LEAST_ANTS))


def each(work: Callable[[slice], Made], size: int) -> list[Made]:
    """Do `work` on the parts of `size` ants, at the same time; results in order."""
    count = parts(size)
    if count == 1:
        return [work(ALL)]
    bounds = [size * part // count for part in range(count + 1)]
    own, *others = (slice(*pair) for pair in pairwise(bounds))
    futures = [_team.submit(work, part) for part in others]
    try:
        results = [work(own)]
    finally:
        # Nobody writes to the caller's arrays any more once this has returned.
        errors = [future.exception() for future in futures]
    for error in errors:
        if error is not None:
            raise error
    return results + [future.result() for future in futures]


def ahead(work: Callable[[Given], Made], items: Iterable[Given]) -> Iterator[Made]:
    """`map`, in order, with the next items worked on while the caller uses one."""
    if _team.count == 1:
        yield from map(work, items)
        return
    rest = iter(items)
    waiting: list[Future[Made]] = []
    try:
        for item in islice(rest, _team.count):
            waiting.append(_team.submit(work, item))
        while waiting:
            result = waiting.pop(0).result()
            for item in islice(rest, 1):
                waiting.append(_team.submit(work, item))
            yield result
    finally:
        for future in waiting:
            future.cancel()
