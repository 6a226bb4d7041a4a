"""What processes that work for another one have in common."""

from __future__ import annotations

import os
import signal
import threading
import time

_LOOK_EVERY = 0.2
"""Seconds."""


def serve_parent(parent: int, grace: float = 0.0) -> None:
    """Leave Ctrl-C to the parent process, and end when it has died.

    Args:
        parent: its id.
        grace: seconds that remain to this process after the parent's death.
    """
    # Ctrl-C reaches every process of a terminal; the parent is the one to answer it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent, grace), daemon=True).start()


def _end_with(parent: int, grace: float) -> None:
    """Exit if the parent process has died, because nobody waits for the results."""
    while os.getppid() == parent:
        time.sleep(_LOOK_EVERY)
    time.sleep(grace)
    os._exit(1)
