"""Makes random calls and prints what comes of each, for `test_fuzz`.

Run as `python -m tests.fuzz.worker SEED FIRST LAST`.
"""

from __future__ import annotations

import copy
import faulthandler
import linecache
import resource
import signal
import sys
import traceback
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np

import acl_gym
from tests.fuzz.families import Call, call_number

SECONDS = 60
"""Of processor time: a call that takes longer counts as hung. The first ones compile
kernels, which is not fast."""

MEMORY = 8 << 30
"""Bytes of address space: what asks for absurd amounts fails."""

_PACKAGE = str(Path(acl_gym.__file__).parent)
_GYMNASIUM = str(Path(gym.__file__).parent)
_IN_WORDS = (TypeError, ValueError, OSError, gym.error.Error)
_REFUSED = (AttributeError, RuntimeError)  # what is fixed, or not the time for it


def outcome_of(call: Call) -> str:
    """What comes of a call: "ok", "refused", or a fault with its description."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            value = call.make()
    except Exception as error:
        return _judged(call, error)
    if isinstance(call.outcome, tuple):
        if value != call.outcome[1]:
            return f"silent: {value!r:.80} is not {call.outcome[1]!r:.80}"
    elif call.outcome == "refuse":
        return f"silent: accepted, {value!r:.80}"
    return "ok"


def _judged(call: Call, error: Exception) -> str:
    """Whether an error is one in words, raised on purpose."""
    if call.outcome == "crash-free" and not isinstance(error, SystemError):
        return "refused"
    last = traceback.extract_tb(error.__traceback__)[-1]
    line = linecache.getline(last.filename, last.lineno or 0).strip()
    where = f"{Path(last.filename).name}:{last.lineno}"
    on_purpose = line.startswith(("raise ", "assert ")) and last.filename.startswith(
        (_PACKAGE, _GYMNASIUM)
    )
    kind, text = type(error), " ".join(str(error).split())
    if on_purpose and isinstance(error, _IN_WORDS + _REFUSED + (AssertionError,)):
        return "refused"
    if last.filename.endswith("liars.py") and "read-only" in text:
        return "refused"  # what it was given cannot be written to
    if last.filename == copy.__file__ and isinstance(error, MemoryError):
        return "refused"  # Gymnasium copies the arguments of `make` before we see them
    if isinstance(error, TypeError) and "argument" in text and "()" in text:
        return "refused"  # Python's own words about the number of arguments
    return f"raw: {kind.__name__} at {where}: {text[:140]}"


def main() -> None:
    """Make the calls of the command line."""
    seed, first, last = map(int, sys.argv[1:4])
    # Ends the process, also where a kernel never returns to Python.
    faulthandler.register(signal.SIGPROF, chain=True)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("ignore")
    for number in range(first, last):
        print(f"call {number}", end="\t", flush=True)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        call = call_number(seed, number)
        print(call.name.replace("\n", " "), end="\t", flush=True)
        print(outcome_of(call).replace("\n", " "), flush=True)
        signal.setitimer(signal.ITIMER_PROF, 0)
    print("done", flush=True)


if __name__ == "__main__":
    main()
