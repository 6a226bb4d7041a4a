"""Figures of chapter 3: theory and grids."""

from __future__ import annotations

from dataclasses import replace

from acl_gym.reproduction.catalogue.common import (
    GAMMAS_ROW,
    RHOS_ROW,
    SIZES,
    number,
    studies,
)
from acl_gym.reproduction.settings import Experiment
from acl_gym.reproduction.systems import row, two_state, world

_GAPS = {
    f"M = {m}, gamma = {number(gamma)}": two_state(m, local_decay=gamma)
    for m in (1, 2, 8)
    for gamma in (0.0, 0.1, 0.5)
}

EXPERIMENTS = (
    Experiment(
        "fig3.3",
        "The level in q between its bounds",
        "§3.4.7",
        studies({f"M = {m}": two_state(m) for m in (1, 2, 8)}),
        "level_band",
        ("C21", "C22"),
        "The two-state system of Figure 3.2 with costs 1, 2 and 4, epsilon-greedy ants "
        "(epsilon = 0.1), rho = gamma = 0.1. The thesis draws an illustration; this is "
        "a real run: the mean over the runs between the bounds of Propositions 3.8 and "
        "3.9, and the band of all runs.",
    ),
    Experiment(
        "fig3.4",
        "The gap between the levels of the two policies",
        "§3.4.8",
        studies(_GAPS),
        "policy_gap",
        ("C21", "C22", "C23"),
        "Delta of (3.31) is positive for one ant and negative for more, with costs 1 "
        "and 2 of the two best actions. Drawn is how often the last policies of the "
        "runs are the optimal ones, and still change.",
    ),
    Experiment(
        "fig3.6",
        "1-D grid, varying rho",
        "§3.6.3",
        studies({f"rho = {number(r)}": row(global_decay=r) for r in RHOS_ROW}),
        "bands",
        ("C1", "C2", "C3", "C4"),
        "gamma = 0, 9 ants. alpha = 3, tau0 = 0.001, T = 50 and K = 100 are decisions.",
    ),
    Experiment(
        "fig3.7",
        "1-D grid, other measures",
        "§3.6.3",
        studies({"rho = 0.1, gamma = 0": row()}),
        "measures",
        (),
        "What the ants pay, how many cells change their action, and how sensitive the "
        "policy is (3.48), for rho = 0.1 and gamma = 0.",
    ),
    Experiment(
        "fig3.8",
        "1-D grid, varying gamma",
        "§3.6.4",
        studies({f"gamma = {number(g)}": row(local_decay=g) for g in GAMMAS_ROW}),
        "bands",
        ("C4",),
        "rho = 0.1, 9 ants; gamma = 0 is in Figure 3.6.",
    ),
    Experiment(
        "fig3.9",
        "1-D grid, varying number of ants",
        "§3.6.5",
        studies({f"M = {m}": replace(row(), ants=m) for m in (1, 5, 9)}),
        "bands",
        ("C5",),
        "rho = 0.1, gamma = 0.",
    ),
    Experiment(
        "fig3.11",
        "2-D grid, varying probability of transition",
        "§3.6.7",
        studies({f"p = {p:g}": world(p=p) for p in (0.5, 0.7, 0.9, 1.0)}),
        "bands",
        ("C6",),
        "11 x 11 cells, rho = 0.1, gamma = 0, 86 ants. The thesis's map is lost; this "
        "one has as many cells and a mean shortest path of 9.99 steps. K = 200, "
        "T = 435 / p.",
    ),
    Experiment(
        "fig3.12",
        "2-D grid, other measures",
        "§3.6.7",
        studies({f"p = {p:g}": world(p=p) for p in (0.5, 0.9)}),
        "measures",
        (),
    ),
    Experiment(
        "fig3.13",
        "2-D grid, policies",
        "§3.6.7",
        studies({f"p = {p:g}": world(p=p) for p in (0.5, 0.9)}),
        "policies",
        ("C7",),
        "The last policy of the run with the cheapest one.",
    ),
    Experiment(
        "fig3.14",
        "2-D grid, varying size and number of ants",
        "§3.6.8",
        studies(
            {
                f"{size}, {share:.0%}": world(size, max(1, round(share * states)))
                for size, states in SIZES.items()
                for share in (0.2, 1.0)
            }
        ),
        "bands",
        ("C8",),
        "Ants as a share of the states, p = 1, rho = 0.1, gamma = 0.",
        {"columns": 2},
    ),
)
