"""Trials beside the thesis's: what it leaves open, decided otherwise."""

from __future__ import annotations

from dataclasses import replace

from acl_gym.reproduction.catalogue.common import (
    KINDS,
    number,
    studies,
)
from acl_gym.reproduction.settings import Experiment
from acl_gym.reproduction.systems import row, swing, vehicle

EXPERIMENTS = (
    Experiment(
        "omega-max",
        "Pendulum with other bounds on the velocity",
        "§5.2.2",
        studies(
            {
                f"{kind}, gamma = {number(gamma)}, omega_max = {limit:g}": replace(
                    swing(kind, local_decay=gamma), env={"omega_max": limit}
                )
                for kind in KINDS
                for gamma in (0.01, 0.1)
                for limit in (7.0, 15.0)
            }
        ),
        "bands",
        ("C15", "C16"),
        "The thesis does not name omega_max; 9 rad/s is taken elsewhere. The cells cover "
        "the same range.",
        {"columns": 2},
    ),
    Experiment(
        "row-choices",
        "1-D grid: one ant, other choices",
        "§3.6.5",
        studies(
            {
                "alpha = 1": replace(row(alpha=1.0), ants=1),
                "alpha = 2": replace(row(alpha=2.0), ants=1),
                "tau0 = 0.0001": replace(row(tau0=1e-4), ants=1),
                "epsilon = 0.1": replace(
                    row(selection="max_boltzmann", epsilon=0.1), ants=1
                ),
                "tabu list": replace(row(tabu=True), ants=1),
                "K = 1000": replace(row(), ants=1, trials=1000),
            }
        ),
        "bands",
        ("C5",),
        "Chapter 3 names no alpha, tau0, epsilon and K: what one ant does with others.",
    ),
    Experiment(
        "navigation-rules",
        "Navigation under the other goal rule",
        "§4.3.2",
        studies(
            {
                f"{cost}, {kind}": vehicle(cost, kind, "membership")
                for cost in ("quadratic", "time")
                for kind in KINDS
            }
        ),
        "bands",
        ("C9", "C12"),
        "The goal is reached where its membership function exceeds 0.5 (§4.3.2), not "
        "within the bounds of Table 4.1: the thesis names both rules.",
        {"columns": 2},
    ),
)
