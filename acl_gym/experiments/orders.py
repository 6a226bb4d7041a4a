"""The names under which the reproduction keeps the update rules."""

from __future__ import annotations

from typing import Any

from acl_gym.agents.acl import ACL

TWO_PHASES = "two phases"
ONE_PHASE = "one phase"
ONCE_AN_ANT = "once an ant"
ONCE_A_TRIAL = "once a trial"

ORDERS = {
    TWO_PHASES: "all ants choose, then all decay, at each visit",
    ONE_PHASE: "each ant in turn chooses and decays before the next one chooses",
    ONCE_AN_ANT: "a pair decays once for each ant that visited it, (3.13)",
    ONCE_A_TRIAL: "a pair decays once a trial, whoever visited it",
}
"""What the names of the readings mean."""

_RULES = {
    TWO_PHASES: "each_visit",
    ONE_PHASE: "in_turn",
    ONCE_AN_ANT: "once_per_ant",
    ONCE_A_TRIAL: "once_per_trial",
}


def colony(order: str, *arguments: Any, **keywords: Any) -> ACL:
    """`ACL(*arguments, **keywords)` with the update rule of a key of `ORDERS`."""
    return ACL(*arguments, update=_RULES[order], **keywords)
