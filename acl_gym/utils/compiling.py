"""Kernels that are compiled on first use and cached where a folder may be written.

Compiling takes a while, so a log message says what the wait is for.
"""

from __future__ import annotations

import functools
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar, overload

import numba
from numba.core.event import Event, Listener, register

logger = logging.getLogger("acl_gym")

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PATIENCE = 1.0
"""Seconds of compilation after which the message is logged."""


@overload
def njit(function: Kernel, /) -> Kernel: ...


@overload
def njit(**options: Any) -> Callable[[Kernel], Kernel]: ...


def njit(function: Any = None, /, **options: Any) -> Any:
    """Compile a kernel as `numba.njit(cache=True)` does, without the cache if need be.

    Numba raises an error where it finds no folder for its cache: in containers and on
    clusters, where neither the package nor the home folder may be written.

    Args:
        function: the kernel, where the decorator stands without options.
        **options: those of `numba.njit`.
    """
    if function is None:
        return functools.partial(_compiled, **options)
    return _compiled(function)


def _compiled(function: Any, **options: Any) -> Any:
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        announcer.report_no_cache()
        return numba.njit(**options)(function)


class Announcer(Listener):
    """Logs one message when the package has compiled kernels for `PATIENCE` seconds.

    Kernels loaded from Numba's cache and kernels of other packages do not count.

    Attributes:
        seconds: time spent compiling kernels in this process.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0  # compiling a kernel compiles those that it calls
        self._began = 0.0
        self._announced = False
        self._cached = True
        self._timer: threading.Timer | None = None

    def on_start(self, event: Event) -> None:
        """Compilation of a kernel begins."""
        if not _is_ours(event):
            return
        if self._depth == 0:
            self._began = time.perf_counter()
            if not self._announced:
                # A single kernel may take longer than the patience.
                wait = max(0.0, PATIENCE - self.seconds)
                self._timer = threading.Timer(wait, self._announce)
                self._timer.daemon = True
                self._timer.start()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """Compilation of a kernel has ended."""
        if not _is_ours(event):
            return
        self._depth -= 1
        if self._depth:
            return
        self.seconds += time.perf_counter() - self._began
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def report_no_cache(self) -> None:
        """Log, once, that compiled kernels cannot be kept for the next process."""
        if self._cached:
            self._cached = False
            logger.warning(
                "acl-gym finds no folder that it may write its compiled kernels to, so "
                "that each process compiles them anew, which may take half a minute; "
                "set NUMBA_CACHE_DIR to a folder that may be written."
            )

    def _announce(self) -> None:
        if self._announced:
            return
        self._announced = True
        if self._cached:  # else the user has been told what to expect
            logger.warning(
                "acl-gym is compiling its kernels for their first use, which may take "
                "half a minute in total; they are cached on disk for later runs."
            )


def _is_ours(event: Any) -> bool:
    kernel = event.data.get("dispatcher")
    return (getattr(kernel, "__module__", None) or "").startswith("acl_gym")


announcer = Announcer()
register("numba:compile", announcer)  # type: ignore[no-untyped-call]
