"""What was tried to understand the claims C13 to C20, where they do not hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from acl_gym.reproduction.catalogue.beside import (
    GAMMAS_PENDULUM,
    LONG,
    MANY,
    OTHER_LIMITS,
    OTHER_ORDERS,
    limited,
    long,
    ordered,
    roomy,
)
from acl_gym.reproduction.catalogue.common import GAMMAS, RHOS, number
from acl_gym.reproduction.catalogue.pendulum import partitions
from acl_gym.reproduction.claims.swings import (
    OPTIMUM,
    SETTLED,
    convergence,
    late_cost,
    structure,
    swing_up,
    trajectory,
)
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Setting
from acl_gym.reproduction.systems import swing
from acl_gym.reproduction.verdicts import Tried, interval
from acl_gym.utils.typing import FloatArray

Attempt = Callable[[Evidence], Tried]
Change = Callable[[Setting], Setting]

CHANGES: dict[str, Change] = {
    **{
        f"omega_max = {limit:g} rad/s": partial(limited, omega_max=limit)
        for limit in OTHER_LIMITS
    },
    **{
        f"the local update read as {order}": partial(ordered, order=order)
        for order in OTHER_ORDERS
    },
}
"""What may be decided otherwise, beside each gamma of `GAMMAS_PENDULUM`."""


def steady(costs: FloatArray) -> float:
    """The share of runs that keep within 25% of their median in 18 of 20 late trials.

    A policy that hovers beside the goal for a trial or two does not count here, as it
    does in `swing_at_the_end`.
    """
    late = costs[:, -20:]
    middle = np.median(late, axis=1, keepdims=True)
    near = np.abs(late / middle - 1.0) <= SETTLED / 2
    return float((near.mean(axis=1) >= 0.9).mean())


def longer(runs: Iterable[tuple[str, float]], evidence: Evidence) -> Tried:
    """More trials."""
    found = [
        f"{kind}, rho = {rho:g}: {convergence(evidence, long(kind, rho))[1]}"
        for kind, rho in runs
    ]
    return Tried(f"K = {LONG} instead of 100; share that has settled", "; ".join(found))


def spikes(kind: str, evidence: Evidence) -> Tried:
    """Without the policies that are bad for a trial."""
    shares = {r: steady(evidence.rows(swing(kind, global_decay=r))) for r in RHOS[1:]}
    listed = ", ".join(f"rho = {rho:g}: {share:.0%}" for rho, share in shares.items())
    return Tried(
        "single trials left out (policies that hover beside the goal, docs/hovering.md): "
        "share of the runs that keep within 12.5% of their median in 18 of the last 20 "
        "trials",
        listed,
    )


def first_below(kind: str, evidence: Evidence) -> Tried:
    """How soon each rho comes down."""
    found = []
    for rho in RHOS[1:]:
        mean = evidence.rows(swing(kind, global_decay=rho)).mean(axis=0)
        below = np.flatnonzero(mean <= 3 * OPTIMUM)
        trial = str(below[0] + 1) if below.size else "never"
        found.append(f"rho = {rho:g}: {trial}")
    return Tried("the trial at which the mean first costs less than 3 J*",
                 ", ".join(found))  # fmt: skip


def gammas(kind: str, name: str, evidence: Evidence) -> Tried:
    """Whether gamma = 0.1 does better when something else is decided otherwise."""
    small, large = (
        interval(late_cost(evidence, CHANGES[name](swing(kind, local_decay=gamma))))
        for gamma in GAMMAS_PENDULUM
    )
    better = "better" if large.high < small.low else "no better"
    return Tried(
        name,
        f"gamma = 0.1 is {better}: cost {large} against {small} for gamma = 0.01",
    )


def best_of_run(kind: str, evidence: Evidence) -> Tried:
    """The cheapest policy of each run instead of the last ones."""
    found = [
        f"{number(gamma)}: {interval(evidence.rows(swing(kind, local_decay=gamma)).min(axis=1))}"
        for gamma in GAMMAS
    ]
    return Tried("the cheapest policy of each run, by gamma", ", ".join(found))


def swung(name: str, evidence: Evidence) -> Tried:
    """How soon the best fuzzy policies swing up when something is decided otherwise."""
    found = []
    for gamma in GAMMAS_PENDULUM:
        setting = CHANGES[name](swing("fuzzy", local_decay=gamma))
        path = trajectory(evidence, setting, evidence.best_run(setting))
        found.append(f"gamma = {gamma:g}: {swing_up(path)[0]:.1f} s")
    return Tried(f"{name}: the best policy is upright after", ", ".join(found))


def crisp_turns(evidence: Evidence) -> Tried:
    """All crisp runs, not the best one."""
    found = []
    for label, setting in (
        ("rho = 0.001", swing("crisp", global_decay=0.001)),
        ("gamma = 0.1", swing("crisp", local_decay=0.1)),
        ("M = 2000", swing("crisp", 2000)),
        ("fuzzy", swing("fuzzy")),
    ):
        runs = range(len(evidence.runs(setting)))
        turns = [swing_up(trajectory(evidence, setting, run))[1] for run in runs]
        found.append(f"{label}: {np.median(turns):g} [{min(turns)}, {max(turns)}]")
    return Tried("turns of all runs instead of the best one: median and range",
                 ", ".join(found))  # fmt: skip


def more_ants(evidence: Evidence) -> Tried:
    """The coarse partitions with the ants of the finest one."""
    found = [f"N = {n}: {interval(late_cost(evidence, roomy(n)))}" for n in (16, 32)]
    last = partitions("fuzzy")[-1].setting
    found.append(f"N = 64: {interval(late_cost(evidence, last))}")
    return Tried(f"{MANY} fuzzy ants on every partition", ", ".join(found))


def median_trials(evidence: Evidence) -> Tried:
    """The median of the last trials, which single bad policies do not move."""
    found = []
    for kind in ("crisp", "fuzzy"):
        for study in partitions(kind):
            costs = np.median(evidence.rows(study.setting)[:, -10:], axis=1)
            found.append(f"{kind}, N = {study.setting.cells[0]}: {interval(costs)}")
    return Tried("the median of the last ten trials instead of their mean",
                 ", ".join(found))  # fmt: skip


def structures(evidence: Evidence) -> Tried:
    """How much structure other settings have."""
    found = []
    for label, setting in (
        ("fuzzy, gamma = 0.1", swing("fuzzy", local_decay=0.1)),
        ("crisp, gamma = 0.1", swing("crisp", local_decay=0.1)),
        ("crisp, M = 2000", swing("crisp", 2000)),
    ):
        shares = [structure(each, setting) for each in evidence.policies(setting)]
        smooth, drives, brakes = np.mean(shares, axis=0)
        found.append(f"{label}: {smooth:.0%}, {drives:.0%}, {brakes:.0%}")
    return Tried(
        "same action as the neighbour, drives near hanging, brakes near upright, under "
        "other settings",
        "; ".join(found),
    )


def coasting(evidence: Evidence) -> Tried:
    """Near upright: cells without torque count as braking, or fast ones do not count."""
    idle, slow = [], []
    policies: list[Any] = evidence.policies(swing("fuzzy"))
    for policy in policies:
        theta, omega = np.meshgrid(*policy.partition.centres, indexing="ij")
        action = policy.best_actions().reshape(theta.shape) - 1
        off = theta - np.pi
        away = (np.abs(off) < 0.5) & (np.abs(omega) > 0.5) & (off * omega > 0)
        along = action * np.sign(omega)
        idle.append((along <= 0)[away].mean())
        slow.append((along < 0)[away & (np.abs(omega) <= 3.0)].mean())
    return Tried(
        "fuzzy, near upright and moving away: share of the cells that do not drive it on "
        "(torque against the motion, or none); that brake among those up to 3 rad/s, "
        "which can be caught",
        f"{interval(np.array(idle))}; {interval(np.array(slow))}",
    )


C13: tuple[Attempt, ...] = (
    partial(longer, (("crisp", 0.1), ("crisp", 0.5))),
    partial(first_below, "crisp"),
    partial(spikes, "crisp"),
)
C14: tuple[Attempt, ...] = (
    partial(spikes, "fuzzy"),
    partial(longer, (("fuzzy", 0.001), ("fuzzy", 1.0))),
    partial(first_below, "fuzzy"),
)
C15: tuple[Attempt, ...] = (
    *(partial(gammas, "crisp", name) for name in CHANGES),
    partial(best_of_run, "crisp"),
)
C16: tuple[Attempt, ...] = (
    *(partial(gammas, "fuzzy", name) for name in CHANGES),
    partial(best_of_run, "fuzzy"),
)
C18: tuple[Attempt, ...] = (
    *(partial(swung, name) for name in CHANGES),
    crisp_turns,
)
C19: tuple[Attempt, ...] = (more_ants, median_trials)
C20: tuple[Attempt, ...] = (structures, coasting)
