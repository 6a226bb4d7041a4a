"""A log message while kernels are compiled on first use, which takes a while."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

from numba.core.event import Event, Listener, register

logger = logging.getLogger("acl_gym")

PATIENCE = 1.0
"""Seconds of compilation after which the message is logged."""


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

    def _announce(self) -> None:
        if not self._announced:
            self._announced = True
            logger.warning(
                "acl-gym is compiling its kernels for their first use, which may take "
                "half a minute in total; they are cached on disk for later runs."
            )


def _is_ours(event: Any) -> bool:
    kernel = event.data.get("dispatcher")
    return getattr(kernel, "__module__", "").startswith("acl_gym")


announcer = Announcer()
register("numba:compile", announcer)  # type: ignore[no-untyped-call]
