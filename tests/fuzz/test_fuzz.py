"""Random calls with hostile values, in processes of their own.

Set `ACL_GYM_FUZZ_CALLS` for the long form, such as 20000, and `ACL_GYM_FUZZ_SEED` for
other calls. A call is a function of seed and number: repeat one with
`python -m tests.fuzz.worker SEED NUMBER NUMBER+1`.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzz import families, values
from tests.fuzz.families import Call
from tests.fuzz.worker import outcome_of

CALLS = int(os.environ.get("ACL_GYM_FUZZ_CALLS", "300"))
SEED = int(os.environ.get("ACL_GYM_FUZZ_SEED", "0"))
BUDGET = 90.0
"""Seconds after which the short form starts no further process; the long form has no
limit."""

BATCH = 100
"""Calls in one process, so that a crash ends few of them."""

PATIENCE = 1800
"""Seconds for one process, against waiting without using the processor; slow machines
compile kernels within it."""

ROOT = Path(__file__).parents[2]


def _faults_of(first: int, last: int, folder: Path) -> tuple[list[str], int]:
    """Faults among the calls first .. last - 1, and how many of them were made."""
    command = [sys.executable, "-m", "tests.fuzz.worker", str(SEED)]
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    surroundings = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    faults, made = [], 0
    while first < last:
        done = subprocess.run(
            [*command, str(first), str(last)],
            cwd=folder,
            env=surroundings,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        lines = done.stdout.splitlines()
        ended = bool(lines) and lines[-1] == "done"
        calls = lines[:-1] if ended else lines
        assert calls, f"no call was made: {done.stderr[-2000:]}"
        made += len(calls)
        faults += [line for line in calls if line.split("\t")[-1] not in FINE]
        if not ended:
            end = f"the process ended with {done.returncode} in or after {calls[-1]!r}"
            faults.append(f"{end}: {done.stderr[-2000:]}")
        first += len(calls)
    return faults, made


FINE = ("ok", "refused")


@pytest.mark.slow
def test_nothing_crashes_hangs_or_is_silently_wrong(tmp_path: Path) -> None:
    start, made, faults = time.monotonic(), 0, []
    short = "ACL_GYM_FUZZ_CALLS" not in os.environ
    for first in range(0, CALLS, BATCH):
        if short and made and time.monotonic() - start > BUDGET:
            break
        found, count = _faults_of(first, min(first + BATCH, CALLS), tmp_path)
        faults += found
        made += count
    print(f"{made} calls, {len(faults)} faults")
    assert made >= min(CALLS, BATCH)
    assert not faults, "\n".join(faults)


def _refuse() -> None:
    raise ValueError("not raised by the package")


@pytest.mark.parametrize(
    ("call", "found"),
    [
        (Call("accepts", lambda: 1, "refuse"), "silent"),
        (Call("differs", lambda: 1, ("same", 2)), "silent"),
        (Call("agrees", lambda: 2, ("same", 2)), "ok"),
        (Call("raw", lambda: {}["key"]), "raw"),
        (Call("raised by others", _refuse), "raw"),
        (Call("other error", lambda: {}["key"], "crash-free"), "refused"),
    ],
)
def test_the_judge_tells_faults_from_refusals(call: Call, found: str) -> None:
    assert outcome_of(call).split(":")[0] == found


def test_a_number_gives_the_same_call_again() -> None:
    names = [families.call_number(3, number).name for number in (7, 8)]
    assert names == [families.call_number(3, number).name for number in (7, 8)]
    assert len(values.VALUES) > 50  # none is lost by a change of the list
