"""Several threads within one colony, with the same bits whatever their number.

What a step does for each ant by itself (moving it, locating its state, drawing its
action) is cut into blocks of ants, and threads take the blocks. What the ants share
(decay, and the sum of the deposits) is done by one thread, in the order of the ants.
So a result does not depend on the number of threads, nor on who is first.
"""

from __future__ import annotations

from acl_gym.utils import validation

LEAST_ANTS = 2_000
"""Below so many ants waking the threads costs more than it saves."""


class _Setting:
    count = 1


def set_num_threads(count: int) -> None:
    """Let colonies and their environments use `count` threads; at first it is 1.

    Threads serve colonies of several thousand ants. Independent runs gain more from
    processes of their own. Do not fork the process once threads have worked.

    Args:
        count: >= 1, at most the number of cores, or `NUMBA_NUM_THREADS` where that
            variable is set.

    Raises:
        TypeError: `count` is not an integer.
        ValueError: it is out of range.
    """
    count = validation.integer("count", count, at_least=1)
    if count > 1:
        import numba
        from numba.core import config

        most = int(getattr(config, "NUMBA_NUM_THREADS", 1))
        if count > most:
            raise ValueError(
                f"count must be at most {most}, got {count}: one thread a core, or what "
                "the environment variable NUMBA_NUM_THREADS says; set it before Python "
                "starts to allow more."
            )
        numba.set_num_threads(count)
    _Setting.count = count


def get_num_threads() -> int:
    """How many threads colonies and their environments use at most."""
    return _Setting.count


def worth_it(ants: int) -> bool:
    """Whether so many ants are to be shared among threads."""
    return _Setting.count > 1 and ants >= LEAST_ANTS
