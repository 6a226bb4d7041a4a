"""Claims C1 to C8: the grid searches of §3.6."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from acl_gym.reproduction.catalogue.common import GAMMAS_ROW, SIZES
from acl_gym.reproduction.claims import grids_tried as tried
from acl_gym.reproduction.claims.exact import optimal_grid_cost, policy_costs, solved
from acl_gym.reproduction.claims.grids_tried import OPTIMUM_1D
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Setting
from acl_gym.reproduction.systems import row, world
from acl_gym.reproduction.verdicts import (
    Claim,
    Part,
    interval,
    rank_correlation,
    ratio,
    trial_of,
)

LATE = 20
"""So many trials at the end count as late."""


def _optimal(evidence: Evidence, setting: Setting) -> Any:
    return evidence.rows(setting) <= OPTIMUM_1D + 1e-9


def c1(evidence: Evidence) -> list[Part]:
    """rho = 0 never converges."""
    late = _optimal(evidence, row(global_decay=0.0))[:, -LATE:].all(axis=1)
    return [
        Part(
            f"no run keeps J = 5 over the last {LATE} trials",
            f"{late.sum()} of {late.size} runs",
            not late.any(),
        )
    ]


def c2(evidence: Evidence) -> list[Part]:
    """rho = 0.1, gamma = 0 converges in every run."""
    late = _optimal(evidence, row())[:, -LATE:].all(axis=1)
    return [
        Part(
            f"every run keeps J = 5 over the last {LATE} trials",
            f"{late.sum()} of {late.size} runs",
            bool(late.all()),
        )
    ]


def c3(evidence: Evidence) -> list[Part]:
    """Large rho converges first and does not settle."""
    parts = []
    for rho in (0.9, 1.0):
        optimal = _optimal(evidence, row(global_decay=rho))
        reached = optimal.any(axis=1)
        left = np.array(
            [run.any() and not run[int(run.argmax()) :].all() for run in optimal]
        )
        parts += [
            Part(
                f"rho = {rho:g}: nine of ten runs come to J = 5 once",
                f"{reached.mean():.0%}",
                bool(reached.mean() >= 0.9),
            ),
            Part(
                f"rho = {rho:g}: half of the runs or more leave it again",
                f"{left.mean():.0%}",
                bool(left.mean() >= 0.5),
            ),
        ]
    return parts


def c4(evidence: Evidence) -> list[Part]:
    """gamma = 0 is best; the larger gamma, the worse."""
    gammas = (0.0, *GAMMAS_ROW)
    means = [
        evidence.rows(row(local_decay=gamma)).mean(axis=1) for gamma in gammas
    ]  # over the trials: fast and low is little
    centres = [interval(each).value for each in means]
    rank = rank_correlation(gammas, centres)
    listed = ", ".join(
        f"{gamma:g}: {centre:.3g}"
        for gamma, centre in zip(gammas, centres, strict=True)
    )
    better = [
        gamma
        for gamma, values in zip(gammas, means, strict=True)
        if ratio(values, means[0]).high < 1
    ]
    return [
        Part(
            "no gamma has a lower mean cost over the trials than gamma = 0: no interval "
            "of a ratio to it lies below 1",
            listed,
            not better,
        ),
        Part(
            "the mean cost rises with gamma: rank correlation of 0.9 or more",
            f"{rank:.2f}",
            rank >= 0.9,
        ),
    ]


def c5(evidence: Evidence) -> list[Part]:
    """More ants, fewer trials; all reach the optimum."""
    first, ends = [], []
    for ants in (1, 5, 9):
        optimal = _optimal(evidence, replace(row(), ants=ants))
        first.append(float(np.median(trial_of(optimal))))
        ends.append(float(optimal[:, -1].mean()))
    return [
        Part(
            "the median trial from which on J = 5 falls from 1 to 5 to 9 ants",
            ", ".join(f"{each:g}" for each in first),
            first[0] > first[1] > first[2],
        ),
        Part(
            "with each number 95% of the runs or more end at J = 5",
            ", ".join(f"{each:.0%}" for each in ends),
            min(ends) >= 0.95,
        ),
    ]


def c6(evidence: Evidence) -> list[Part]:
    """J is about (mean shortest path) / p."""
    parts = []
    shortest = optimal_grid_cost(world())
    for p in (0.5, 0.7, 0.9, 1.0):
        found = interval(policy_costs(evidence, world(p=p)))
        parts.append(
            Part(
                f"p = {p:g}: the last policy costs {shortest / p:.2f} within 10%",
                str(found),
                abs(found.value * p / shortest - 1) <= 0.1,
            )
        )
    return parts


def c7(evidence: Evidence) -> list[Part]:
    """p = 0.5 and p = 0.9 give nearly the same policy."""
    _, optimum, free = solved(world())
    values = optimum.action_values[free]
    single = (values >= values.max(axis=1, keepdims=True) - 1e-6).sum(axis=1) == 1
    cells = free[single]
    low, high = (
        np.array([policy.best_actions()[cells] for policy in evidence.policies(s)])
        for s in (world(p=0.5), world(p=0.9))
    )
    between = float((low == high).mean())
    within = float(
        np.mean([(each == np.roll(each, 1, axis=0)).mean() for each in (low, high)])
    )
    return [
        Part(
            "where one action is best, the policies agree in 90% of the cells or more",
            f"{between:.0%}",
            between >= 0.9,
        ),
        Part(
            "they agree as often as two runs at one p, within 5 points",
            f"{between:.0%} against {within:.0%}",
            between >= within - 0.05,
        ),
    ]


def c8(evidence: Evidence) -> list[Part]:
    """Trials depend on coverage, hardly on size."""
    trials: dict[tuple[str, float], Any] = {}
    for size, states in SIZES.items():
        for share in (0.2, 1.0):
            costs = evidence.rows(world(size, max(1, round(share * states))))
            end = np.median(costs[:, -LATE:], axis=1, keepdims=True)
            trials[size, share] = (costs <= 1.05 * end).argmax(axis=1) + 1.0
    parts = []
    for size in SIZES:
        found = ratio(trials[size, 0.2], trials[size, 1.0])
        parts.append(
            Part(
                f"{size}: with 20% of the ants at least 1.5 times the trials until the "
                "cost first comes within 5% of its end",
                str(found),
                found.value >= 1.5,
            )
        )
    for share in (0.2, 1.0):
        found = ratio(trials["31x31", share], trials["11x11", share])
        parts.append(
            Part(
                f"{share:.0%}: at most twice the trials on 7.4 times the states",
                str(found),
                found.value <= 2.0,
            )
        )
    return parts


CLAIMS = (
    Claim("C1", "rho = 0 never converges.", "§3.6.3", c1),
    Claim(
        "C2",
        "rho = 0.1 with gamma = 0 converges to the optimum, J = 5, in every run.",
        "§3.6.3",
        c2,
    ),
    Claim(
        "C3",
        "A large rho (0.9, 1) converges first, and does not settle afterwards.",
        "§3.6.3",
        c3,
    ),
    Claim(
        "C4",
        "gamma = 0 is best; the larger gamma, the worse.",
        "§3.6.4",
        c4,
        tried.C4,
        "Up to gamma = 0.1 every setting finds the optimum within two or three "
        "trials, and the order among them is chance; from 0.2 on more gamma is worse, "
        "as told. Read as once an ant or once a trial, the local update hardly "
        "matters even at 0.5.",
    ),
    Claim(
        "C5",
        "More ants need fewer trials; 1, 5 and 9 ants all reach the optimum.",
        "§3.6.5",
        c5,
        tried.C5,
        "One ant alone settles on the first way that it finds, for nobody else comes "
        "upon a better one. Less insistence (alpha = 1) or exploration (epsilon = "
        "0.1, a tabu list) sets it free; a smaller tau0 or ten times as many trials "
        "do not.",
    ),
    Claim(
        "C6",
        "The policy costs about the mean shortest path divided by p.",
        "§3.6.7",
        c6,
        tried.C6,
    ),
    Claim(
        "C7",
        "p = 0.5 and p = 0.9 give nearly the same policy.",
        "§3.6.7",
        c7,
        tried.C7,
        "The policies at two p differ no more than those of two runs at one p: what "
        "is left is chance, and cells in which the ants settle on a way that is a "
        "step too long.",
    ),
    Claim(
        "C8",
        "How many trials it takes depends on the coverage by ants, hardly on the size.",
        "§3.6.8",
        c8,
        tried.C8,
        "At first the trial was taken from which on the cost stays within 5% of its end; "
        "single cells that lose their way for a trial made that infinite in many runs.",
    ),
)
