"""The experiments of §3.6, the grid searches, and those tried beside them."""

from __future__ import annotations

from dataclasses import replace

from acl_gym.experiments.systems import GRID_STATES, grid_1d, grid_2d
from acl_gym.experiments.thesis.common import READINGS, experiment, sweep

RHOS = (0.0, 0.1, 0.2, 0.5, 0.9, 1.0)
GAMMAS = (0.01, 0.05, 0.1, 0.2, 0.5, 0.9)
OTHER_GAMMAS = (0.05, 0.2, 0.5)
PROBABILITIES = (0.5, 0.7, 0.9, 1.0)
TWO_PROBABILITIES = (0.5, 0.9)
SHARES = (0.2, 1.0)
"""Ants as shares of the states."""

ONE_ANT = {
    "alpha = 1": grid_1d(1, alpha=1.0),
    "alpha = 2": grid_1d(1, alpha=2.0),
    "tau0 = 0.0001": grid_1d(1, tau0=1e-4),
    "epsilon = 0.1": grid_1d(1, selection="max_boltzmann", epsilon=0.1),
    "tabu list": grid_1d(1, tabu=True),
    "K = 1000": replace(grid_1d(1), trials=1000),
}
"""One ant on the 1-D grid, with other choices of what the thesis leaves open."""

CHOICES = {
    "alpha = 1": {p: grid_2d(p=p, alpha=1.0) for p in TWO_PROBABILITIES},
    "alpha = 2": {p: grid_2d(p=p, alpha=2.0) for p in TWO_PROBABILITIES},
    "M = 172": {p: grid_2d(p=p, ants=172) for p in TWO_PROBABILITIES},
}
"""The 2-D grid with other choices, by p."""

COVERED = {
    (size, share): grid_2d(size, max(1, round(share * states)))
    for size, states in GRID_STATES.items()
    for share in SHARES
}
"""The 2-D grids by size, and ants as a share of the states."""

READ_AS = {
    reading: {g: grid_1d(local_decay=g, update=update) for g in OTHER_GAMMAS}
    for reading, update in READINGS.items()
}
"""The 1-D grid by the reading of the local update, and gamma."""

_RHO = sweep("rho", RHOS, lambda rho: grid_1d(global_decay=rho))
_GAMMA = sweep("gamma", GAMMAS, lambda gamma: grid_1d(local_decay=gamma))
_P = sweep("p", PROBABILITIES, lambda p: grid_2d(p=p))
_TWO_P = sweep("p", TWO_PROBABILITIES, lambda p: grid_2d(p=p))
_SIZES = {f"{size}, {share:.0%}": s for (size, share), s in COVERED.items()}

NOTES = {
    "fig3.6": "gamma = 0, 9 ants. The thesis does not say alpha, tau0, T and K; here "
    "alpha = 3, tau0 = 0.001, T = 50 and K = 100.",
    "fig3.7": "The cost of the ants' solutions, the share of cells whose action "
    "changes, and the sensitivity of the policy, eq. (3.48).",
    "fig3.8": "rho = 0.1, 9 ants; gamma = 0 is in Figure 3.6.",
    "fig3.9": "rho = 0.1, gamma = 0.",
    "fig3.11": "11 x 11 cells, rho = 0.1, gamma = 0, 86 ants. The map of the thesis is "
    "lost; this one has as many cells, and a mean shortest path of 9.99 steps. K = 200, "
    "T = 435 / p.",
    "fig3.13": "The last policy of the run whose last policy is the cheapest.",
    "fig3.14": "Ants as a share of the states, p = 1, rho = 0.1, gamma = 0.",
    "row-choices": "Chapter 3 does not say alpha, tau0, epsilon and K: one ant with "
    "other values of them.",
    "row-orders": "In turn: one ant after the other chooses an action and decays its "
    "level. Once an ant: a level decays once for each ant that has visited the pair, as "
    "in the total local update, eq. (3.13). Once a trial: a level decays once if any "
    "ant has visited the pair. In all other experiments all ants choose, and then the "
    "levels decay, at each visit.",
    "world-choices": "Chapter 3 does not say alpha; in the other experiments it is 3, "
    "and there are 86 ants.",
}
"""What is decided here, and what is shown."""


_EXPERIMENTS = (
    experiment("fig3.6", "1-D grid, varying rho", "§3.6.3", _RHO, "C1 C2 C3 C4"),
    experiment(
        *("fig3.7", "1-D grid, other measures", "§3.6.3"),
        studies={"rho = 0.1, gamma = 0": grid_1d()},
        plot="measures",
    ),
    experiment("fig3.8", "1-D grid, varying gamma", "§3.6.4", _GAMMA, "C4"),
    experiment(
        *("fig3.9", "1-D grid, varying number of ants", "§3.6.5"),
        studies=sweep("M", (1, 5, 9), grid_1d),
        claims="C5",
    ),
    experiment(
        "fig3.11", "2-D grid, varying transition probability", "§3.6.7", _P, "C6"
    ),
    experiment(
        "fig3.12", "2-D grid, other measures", "§3.6.7", _TWO_P, plot="measures"
    ),
    experiment("fig3.13", "2-D grid, policies", "§3.6.7", _TWO_P, "C7", "policies"),
    experiment(
        *("fig3.14", "2-D grid, varying size and number of ants", "§3.6.8"),
        studies=_SIZES,
        claims="C8",
        options={"columns": 2},
    ),
    experiment(
        *("row-choices", "1-D grid: one ant, other choices", "§3.6.5"),
        studies=ONE_ANT,
        explains="C5",
    ),
    experiment(
        *("row-orders", "1-D grid: other readings of the local update", "§3.6.4"),
        studies={
            f"{reading}, gamma = {gamma:g}": study
            for reading, studies in READ_AS.items()
            for gamma, study in studies.items()
        },
        explains="C4",
    ),
    experiment(
        *("world-choices", "2-D grid: other choices", "§3.6.7"),
        studies={
            f"p = {p:g}, {choice}": studies[p]
            for p in TWO_PROBABILITIES
            for choice, studies in CHOICES.items()
        },
        explains="C6 C7",
    ),
)

EXPERIMENTS = tuple(
    replace(each, text=NOTES.get(each.name, "")) for each in _EXPERIMENTS
)
