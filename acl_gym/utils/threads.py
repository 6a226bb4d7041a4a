"""Several threads within one colony, with results that are the same for any number.

The parts of a step that concern one ant at a time (moving it, locating its state,
drawing its action) are split into blocks of ants, which threads share. The parts that
concern all ants (decay and the sum of the deposits) are done by one thread, in the
order of the ants. So a result does not depend on the number of threads or their timing.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any

from acl_gym.utils import validation

LEAST_ANTS = 2_000
"""With fewer ants, waking the threads costs more than it saves."""


class _Setting:
    count = 1


_one_at_a_time = threading.Lock()


def shared_among_threads(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Make a parallel kernel safe to call from any Python thread; a decorator.

    Numba keeps the number of threads for each Python thread by itself, and two of them
    inside parallel kernels at once end the process under its `workqueue` layer. Here
    the count of `set_num_threads` holds everywhere, and Python threads take turns.

    Args:
        kernel: compiled with `parallel=True`.

    Returns:
        A function that takes the same arguments.
    """
    import numba

    @functools.wraps(kernel)
    def call(*arguments: Any) -> Any:
        with _one_at_a_time:
            numba.set_num_threads(_Setting.count)
            return kernel(*arguments)

    return call


def set_num_threads(count: int) -> None:
    """Let colonies and their environments use `count` threads; the default is 1.

    Threads pay off in colonies of several thousand ants; independent runs gain more
    from processes of their own. Do not fork the process after threads have been used.

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
                f"count must be at most {most}, got {count}: one thread per core, or "
                "NUMBA_NUM_THREADS where that variable is set; set it before Python "
                "starts to allow more."
            )
        numba.set_num_threads(count)
    _Setting.count = count


def get_num_threads() -> int:
    """The most threads that colonies and their environments use."""
    return _Setting.count


def worth_it(ants: int) -> bool:
    """Whether a number of ants is large enough to share among threads."""
    return _Setting.count > 1 and ants >= LEAST_ANTS
