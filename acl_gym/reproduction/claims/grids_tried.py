"""What was tried to understand the claims C1 to C8, where they do not hold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from acl_gym.reproduction.catalogue.beside import (
    GAMMAS_OTHER,
    OTHER_ORDERS,
    ROW_CHOICES,
    WORLD_CHOICES,
    choice,
    ordered,
)
from acl_gym.reproduction.catalogue.common import GAMMAS_ROW, SIZES
from acl_gym.reproduction.claims.exact import optimal_grid_cost, policy_costs
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.systems import row, world
from acl_gym.reproduction.verdicts import Tried, interval, trial_of

Attempt = Callable[[Evidence], Tried]

OPTIMUM_1D = 5.0
"""J of the optimal policy on the row of ten states."""


def order(name: str, evidence: Evidence) -> Tried:
    """The mean cost over the trials under another reading of the local update."""
    found = [
        f"{gamma:g}: {interval(evidence.rows(setting).mean(axis=1))}"
        for gamma, setting in (
            (0.0, row()),
            *((g, ordered(row(local_decay=g), name)) for g in GAMMAS_OTHER),
        )
    ]
    return Tried(
        f"the local update read as {name}: mean cost over the trials, by gamma",
        ", ".join(found),
    )


def first_trials(evidence: Evidence) -> Tried:
    """How soon a run comes to the optimum to stay, instead of the mean cost."""
    found = []
    for gamma in (0.0, *GAMMAS_ROW):
        optimal = evidence.rows(row(local_decay=gamma)) <= OPTIMUM_1D + 1e-9
        found.append(f"{gamma:g}: {np.median(trial_of(optimal)):g}")
    return Tried("the median trial from which on J = 5, by gamma", ", ".join(found))


def one_ant(evidence: Evidence) -> Tried:
    """Other choices for the one ant."""
    found = []
    for name, setting in ROW_CHOICES.items():
        end = evidence.rows(setting)[:, -1] <= OPTIMUM_1D + 1e-9
        found.append(f"{name}: {end.mean():.0%}")
    return Tried("one ant, runs that end at J = 5 with other choices", ", ".join(found))


def world_costs(name: str, evidence: Evidence) -> Tried:
    """What the last policies cost with another choice."""
    found = [
        f"p = {p:g}: {interval(policy_costs(evidence, choice(p, name)))} (optimum "
        f"{optimal_grid_cost(choice(p, name)):.2f})"
        for p in (0.5, 0.9)
    ]
    return Tried(f"{name}: cost of the last policy", ", ".join(found))


def every_run(evidence: Evidence) -> Tried:
    """How many runs keep to the claim, beside those that lose cells altogether."""
    shortest, found = optimal_grid_cost(world()), []
    for p in (0.5, 0.7, 0.9, 1.0):
        costs = policy_costs(evidence, world(p=p))
        near = np.mean(costs * p / shortest <= 1.1)
        lost = np.isinf(costs).mean()
        found.append(
            f"p = {p:g}: {near:.0%} ({lost:.0%} with a cell that never arrives)"
        )
    return Tried("runs whose last policy costs at most 1.1 times the claim",
                 ", ".join(found))  # fmt: skip


def agreement(name: str, evidence: Evidence) -> Tried:
    """How far policies at both p agree with another choice, in all cells."""
    low, high = (
        np.array([each.best_actions() for each in evidence.policies(choice(p, name))])
        for p in (0.5, 0.9)
    )
    within = [float((a == np.roll(a, 1, axis=0)).mean()) for a in (low, high)]
    return Tried(
        f"{name}: all cells with the same action at both p, and in two runs at one p",
        f"{(low == high).mean():.0%}, and {within[0]:.0%} (p = 0.5), "
        f"{within[1]:.0%} (p = 0.9)",
    )


def within(share: float, evidence: Evidence) -> Tried:
    """Another measure of how soon it has come down."""
    found = []
    for size, states in SIZES.items():
        for ants in (0.2, 1.0):
            costs = evidence.rows(world(size, max(1, round(ants * states))))
            end = np.median(costs[:, -20:], axis=1, keepdims=True)
            first = (costs <= (1.0 + share) * end).argmax(axis=1) + 1.0
            found.append(f"{size}, {ants:.0%}: {np.median(first):g}")
    return Tried(f"median trials until within {share:.0%} of the end", ", ".join(found))


C4: tuple[Attempt, ...] = (
    *(partial(order, name) for name in OTHER_ORDERS),
    first_trials,
)
C5: tuple[Attempt, ...] = (one_ant,)
C6: tuple[Attempt, ...] = (
    every_run,
    *(partial(world_costs, name) for name in WORLD_CHOICES),
)
C7: tuple[Attempt, ...] = tuple(partial(agreement, name) for name in WORLD_CHOICES)
C8: tuple[Attempt, ...] = (partial(within, 0.1), partial(within, 0.25))
