"""A word to the user while kernels are compiled, which takes a while on first use."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

from numba.core.event import Event, Listener, register

logger = logging.getLogger("acl_gym")

PATIENCE = 1.0
"""Seconds of compilation after which the user is told what the wait is for."""


class Announcer(Listener):
    """Tells once, when this package's kernels have compiled for `PATIENCE` seconds.

    Kernels that are loaded from Numba's cache do not count, nor do other packages'.

    Attributes:
        seconds: how long kernels have been compiled in this process.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0  # a kernel that calls another compiles it in between
        self._began = 0.0
        self._told = False
        self._timer: threading.Timer | None = None

    def on_start(self, event: Event) -> None:
        """A kernel begins to be compiled."""
        if not _is_ours(event):
            return
        if self._depth == 0:
            self._began = time.perf_counter()
            if not self._told:
                # A single kernel may take longer than the patience.
                wait = max(0.0, PATIENCE - self.seconds)
                self._timer = threading.Timer(wait, self._tell)
                self._timer.daemon = True
                self._timer.start()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """A kernel has been compiled."""
        if not _is_ours(event):
            return
        self._depth -= 1
        if self._depth:
            return
        self.seconds += time.perf_counter() - self._began
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _tell(self) -> None:
        if not self._told:
            self._told = True
            logger.warning(
                "acl-gym compiles its kernels when they are first used, which may take "
                "half a minute in all; they are kept on disk for the next time."
            )


def _is_ours(event: Any) -> bool:
    kernel = event.data.get("dispatcher")
    return getattr(kernel, "__module__", "").startswith("acl_gym")


announcer = Announcer()
register("numba:compile", announcer)  # type: ignore[no-untyped-call]
