"""Ctrl-C and SIGTERM while an agent learns: stop at a consistent point."""

from __future__ import annotations

import os
import signal
import threading
from types import FrameType
from typing import Any, Self

GRACE = 2.0
"""Seconds in which the trial under way may end by itself after a signal."""

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class Interruption:
    """Notes the first signal, and ends the program at the second; a context manager.

    The learning code looks at `wanted` after each trial and stops there. If the trial takes
    longer than `GRACE`, KeyboardInterrupt is raised in it. A signal that the caller has
    set to be ignored, as `nohup` does, stays ignored.

    Attributes:
        signal: the number of the first signal; None before it.
    """

    def __init__(self) -> None:
        self.signal: int | None = None
        self._forced = False
        self._learning = True
        self._timer: threading.Timer | None = None
        self._before: dict[int, Any] = {}

    @property
    def wanted(self) -> bool:
        """Whether learning is to stop."""
        return self.signal is not None

    @property
    def exit_code(self) -> int:
        """128 + the number of the signal, by convention of the shells."""
        return 128 + (self.signal or 0)

    def __enter__(self) -> Self:
        for name in _SIGNALS:
            number = getattr(signal, name, None)  # there is no SIGHUP on Windows
            if number is None or signal.getsignal(number) is signal.SIG_IGN:
                continue
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        self.learning_is_over()
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def learning_is_over(self) -> None:
        """From now on nothing is interrupted by force: files are written."""
        self._learning = False
        if self._timer is not None:
            self._timer.cancel()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._forced and self._learning:
            self._forced = False
            raise KeyboardInterrupt
        if self.signal is not None:
            # os.write, because stderr may be in the middle of a write.
            os.write(2, b"acl-gym: ended at once, by the second signal.\n")
            os._exit(128 + number)
        self.signal = number
        if self._learning:
            self._timer = threading.Timer(GRACE, self._force)
            self._timer.daemon = True
            self._timer.start()

    def _force(self) -> None:
        """Raise KeyboardInterrupt in the main thread, also where it sleeps."""
        self._forced = True
        if hasattr(signal, "pthread_kill"):
            main = threading.main_thread().ident
            if main is not None:
                signal.pthread_kill(main, self.signal or signal.SIGINT)
        else:  # Windows
            signal.raise_signal(signal.SIGINT)
