"""What was tried to understand the claims C9 to C12, where they do not hold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from acl_gym.reproduction.catalogue.beside import PATIENT
from acl_gym.reproduction.evidence import Evidence, baseline
from acl_gym.reproduction.systems import vehicle
from acl_gym.reproduction.verdicts import Tried, interval, middle_half, ratio
from acl_gym.utils.typing import FloatArray

Attempt = Callable[[Evidence], Tried]

KINDS = ("fuzzy", "crisp")
LATE = 20
"""So many trials at the end count as late."""

OTHER_RULE = "the goal rule of §4.3.2 (membership above 0.5)"


def late_costs(evidence: Evidence, cost: str, kind: str, rule: str) -> FloatArray:
    """The mean cost of the policy over the last trials of each run."""
    costs = evidence.rows(vehicle(cost, kind, rule))
    return np.asarray(costs[:, -LATE:].mean(axis=1))


def trials_of_fall(costs: FloatArray, share: float = 0.9) -> int:
    """The first trial at which the mean over runs has done so much of its fall."""
    mean = costs.mean(axis=0)
    end = mean[-LATE:].mean()
    return int(np.argmax(mean <= end + (1 - share) * max(mean[0] - end, 0.0))) + 1


def other_rule(cost: str, evidence: Evidence) -> Tried:
    """Fuzzy beside crisp under the other goal rule."""
    fuzzy, crisp = (late_costs(evidence, cost, kind, "membership") for kind in KINDS)
    fast, slow = (
        trials_of_fall(evidence.rows(vehicle(cost, kind, "membership")))
        for kind in KINDS
    )
    return Tried(
        f"{OTHER_RULE}: trials to 90% of the fall, cost of the last 20 trials, middle "
        "half of the runs, fuzzy against crisp",
        f"{fast} against {slow}; ratio {ratio(fuzzy, crisp)}; {middle_half(fuzzy):.3g} "
        f"against {middle_half(crisp):.3g}",
    )


def other_shares(evidence: Evidence) -> Tried:
    """Other shares of the fall, under the rule of Table 4.1."""
    found = []
    for share in (0.5, 0.8, 0.95):
        fast, slow = (
            trials_of_fall(evidence.rows(vehicle("quadratic", kind)), share)
            for kind in KINDS
        )
        found.append(f"{share:.0%}: {fast} against {slow}")
    return Tried("trials to other shares of the fall, fuzzy against crisp",
                 ", ".join(found))  # fmt: skip


def sensitivities(rule: str, evidence: Evidence) -> Tried:
    """The whole way of the sensitivity instead of two points."""
    found = []
    for kind in KINDS:
        mean = evidence.rows(vehicle("quadratic", kind, rule), "sensitivity").mean(
            axis=0
        )
        low = int(mean.argmin())
        found.append(
            f"{kind}: {mean[0]:.2f} at first, lowest {mean[low]:.2f} after {low + 1} "
            f"trials, {mean[-1]:.2f} at the end"
        )
    name = OTHER_RULE if rule == "membership" else "the rule of Table 4.1"
    return Tried(f"the sensitivity on the way, {name}", "; ".join(found))


def cheapest(evidence: Evidence) -> Tried:
    """The best policy of each run beside that of fuzzy Q-iteration."""
    found = []
    for rule in ("bounds", "membership"):
        setting = vehicle("quadratic", "fuzzy", rule)
        best = evidence.rows(setting).min(axis=1) / baseline(setting)[1].cost
        last = late_costs(evidence, "quadratic", "fuzzy", rule)
        last = last / baseline(setting)[1].cost
        arrive = evidence.last(setting, "success_rate").mean()
        reference = baseline(setting)[1].success_rate
        found.append(
            f"{rule}: last {interval(last)}, best {interval(best)}; {arrive:.0%} of the "
            f"starts arrive against {reference:.0%}"
        )
    return Tried("both goal rules; cost of the last and the best policies over that of "
                 "fuzzy Q-iteration", "; ".join(found))  # fmt: skip


def longer_walks(evidence: Evidence) -> Tried:
    """Ants that may walk four times as long."""
    costs = evidence.rows(PATIENT)
    arrive = evidence.last(PATIENT, "success_rate")
    return Tried(
        f"T = 600 in learning, {OTHER_RULE}, fuzzy: cost of the last 20 trials, of the "
        "best policies, and how many starts arrive (more in docs/reproduction.md)",
        f"{interval(costs[:, -LATE:].mean(axis=1))}, {interval(costs.min(axis=1))}, "
        f"{arrive.mean():.0%}",
    )


def arrivals(evidence: Evidence) -> Tried:
    """How many starts arrive at all."""
    found = []
    for rule in ("bounds", "membership"):
        for kind in KINDS:
            share = evidence.last(vehicle("time", kind, rule), "success_rate").mean()
            found.append(f"{kind}, {rule}: {share:.0%}")
    reference = baseline(vehicle("time", "fuzzy"))[1].success_rate
    return Tried("starts from which the last policies arrive, both goal rules",
                 f"{', '.join(found)}; fuzzy Q-iteration {reference:.0%}")  # fmt: skip


C9: tuple[Attempt, ...] = (partial(other_rule, "quadratic"), other_shares)
C10: tuple[Attempt, ...] = tuple(
    partial(sensitivities, rule) for rule in ("bounds", "membership")
)
C11: tuple[Attempt, ...] = (cheapest,)
C12: tuple[Attempt, ...] = (partial(other_rule, "time"), arrivals, longer_walks)
