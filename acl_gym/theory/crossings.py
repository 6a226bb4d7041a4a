"""Colonies that cross a double bridge, simulated by the choice model (2.1).

Part of `acl_gym.theory`. All colonies advance together, ant by ant, so that the kernel
runs through independent numbers in its innermost loop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.theory.double_bridge import ALPHA, OFFSET, crossing_weights
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

COLONIES_AT_A_TIME = 128
"""So many that their counts fit into the nearest cache, and their random numbers into the
next one."""


@njit
def cross(
    uniforms: FloatArray,
    weights: FloatArray,
    counted: IntArray,
    first_on_a: int,
    record: IntArray,
    on_a: BoolArray,
    recorded: IntArray,
) -> None:
    """Let the ants of some colonies choose, one after the other.

    Args:
        uniforms: from [0, 1), one for each ant and colony, `(n_ants, n)`.
        weights: (C + count)^alpha for each count, up to a factor, `(n_ants + 1,)`.
        counted: of the first how many ants each ant finds the marks, `(n_ants, 2)`:
            those of them that chose branch A, and those that chose B.
        first_on_a: the first ant that finds branch A open.
        record: numbers of ants, increasing, `(m,)`.
        on_a: `(n_ants, n)`, receives whether each ant chose branch A.
        recorded: `(m, n)`, receives how many of the first `record` ants chose A.
    """
    n_ants, n_colonies = uniforms.shape
    marks_a = np.zeros(n_colonies, np.int64)
    marks_b = np.zeros(n_colonies, np.int64)
    chosen = np.zeros(n_colonies, np.int64)
    next_a, next_b, row = 0, 0, 0
    for ant in range(n_ants):
        for earlier in range(next_a, counted[ant, 0]):
            for i in range(n_colonies):
                marks_a[i] += on_a[earlier, i]
        for earlier in range(next_b, counted[ant, 1]):
            for i in range(n_colonies):
                marks_b[i] += not on_a[earlier, i]
        next_a, next_b = counted[ant, 0], counted[ant, 1]
        if ant < first_on_a:
            for i in range(n_colonies):
                on_a[ant, i] = False
        else:
            for i in range(n_colonies):
                of_a = weights[marks_a[i]]
                total = of_a + weights[marks_b[i]]
                on_a[ant, i] = uniforms[ant, i] * total < of_a
                chosen[i] += on_a[ant, i]
        if row < record.size and record[row] == ant + 1:
            for i in range(n_colonies):
                recorded[row, i] = chosen[i]
            row += 1


def simulate_crossings(
    n_ants: int,
    n_colonies: int,
    *,
    alpha: float = ALPHA,
    offset: float = OFFSET,
    crossing_times: tuple[float, float] = (0.0, 0.0),
    counted: str = "end",
    ants_per_second: float = 0.5,
    opens_after: float = 0.0,
    record: Any = None,
    seed: int | None = None,
) -> IntArray:
    """Let colonies of real ants cross a double bridge, and count who takes branch A.

    At both ends of the bridge an ant arrives every 1 / `ants_per_second` seconds, the
    first two at time 0, and chooses by (2.1) from what has been counted until then.
    Where crossings take no time, each ant has been counted when the next one chooses,
    and N_A has the law `crossing_law`.

    Args:
        n_ants: how many ants of each colony choose, from both ends together, >= 1.
        n_colonies: >= 1.
        alpha: see `acl_gym.theory.double_bridge`.
        offset: C, see `acl_gym.theory.double_bridge`.
        crossing_times: how long it takes to cross branches A and B, seconds, >= 0; the
            ratio is that of their lengths.
        counted: when an ant counts as one of N_A or N_B, which (2.1) leaves open: at
            the `"end"` of its crossing, or at its `"start"`. Counted at the start, the
            lengths make no difference, because every ant counts at once on either
            branch. They act only in that ants on the shorter branch count sooner.
        ants_per_second: at each end of the bridge, > 0.
        opens_after: branch A is closed until then, seconds, >= 0: a short branch that
            comes late.
        record: numbers of ants in 1, .., `n_ants`, increasing, after which crossings
            are counted; None takes the last.
        seed: of the random numbers; None draws one.

    Returns:
        How many of the first `record` ants chose branch A, `(n_colonies, len(record))`;
        `(n_colonies,)` if `record` is None.

    Raises:
        ValueError: an argument is out of range, or no memory is large enough.
        TypeError: an argument is of the wrong type.
    """
    n_ants = validation.integer("n_ants", n_ants, at_least=1)
    n_colonies = validation.integer("n_colonies", n_colonies, at_least=1)
    validation.one_of("counted", counted, ("end", "start"))
    times = _checked_times(crossing_times)
    rate = validation.number("ants_per_second", ants_per_second, above=0)
    opens = validation.number("opens_after", opens_after, at_least=0)
    after = _checked_record(record, n_ants)
    validation.check_memory(
        f"{n_ants:,} ants of {n_colonies:,} colonies",
        # Of each ant its number and its choice, and three numbers of all colonies.
        9 * COLONIES_AT_A_TIME * n_ants + 24 * n_ants + 8 * after.size * n_colonies,
        "use fewer of them, or record fewer",
    )
    weights = crossing_weights(n_ants, alpha, offset)
    rng = np.random.default_rng(validation.seed(seed))
    if counted == "start":
        times = (0.0, 0.0)
    until = np.stack([_counted_before(n_ants, time * rate) for time in times], axis=1)
    first_on_a = min(n_ants, 2 * math.ceil(min(opens * rate, float(n_ants))))
    found = np.empty((n_colonies, after.size), np.int64)
    for first in range(0, n_colonies, COLONIES_AT_A_TIME):
        block = found[first : first + COLONIES_AT_A_TIME]
        uniforms = rng.random((n_ants, len(block)))
        on_a = np.empty(uniforms.shape, np.bool_)
        recorded = np.empty((after.size, len(block)), np.int64)
        cross(uniforms, weights, until, first_on_a, after, on_a, recorded)
        block[:] = recorded.T
    return found[:, 0] if record is None else found


def _counted_before(n_ants: int, arrivals: float) -> IntArray:
    """Of how many first ants the crossings have ended when each ant chooses.

    Args:
        n_ants: how many choose.
        arrivals: the time of a crossing, in times between two arrivals at an end.
    """
    ant = np.arange(n_ants)
    # Two ants arrive at a time. Undo rounding errors: 20.000000000000004 is 20.
    at_least = math.ceil(min(arrivals, float(n_ants)) * (1.0 - 1e-12))
    pairs = ant // 2 - at_least + 1
    return np.clip(2 * pairs, 0, ant).astype(np.int64)


def _checked_times(times: Any) -> tuple[float, float]:
    given = validation.elements(times)
    if given is None or len(given) != 2:
        raise ValueError(
            "crossing_times must be two numbers, the seconds for each branch, got "
            f"{validation.shown(times)}."
        )
    of_a, of_b = (
        validation.number(f"crossing_times[{i}]", each, at_least=0)
        for i, each in enumerate(given)
    )
    return of_a, of_b


def _checked_record(record: Any, n_ants: int) -> IntArray:
    if record is None:
        return np.array([n_ants])
    after = validation.as_array(record)
    good = (
        after is not None
        and after.ndim == 1
        and after.size > 0
        and after.dtype.kind in "iu"
        and bool((after >= 1).all() and (after <= n_ants).all())
        and bool((np.diff(after.astype(np.int64)) > 0).all())
    )
    if after is None or not good:
        raise ValueError(
            f"record must be integers of 1..{n_ants}, increasing, or None, got "
            f"{validation.shown(record)}."
        )
    return after.astype(np.int64)
