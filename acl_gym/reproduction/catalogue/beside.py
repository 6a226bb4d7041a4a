"""Trials beside the thesis's: what it leaves open, decided otherwise."""

from __future__ import annotations

from dataclasses import replace

from acl_gym.reproduction import orders
from acl_gym.reproduction.catalogue.common import KINDS, fewer, number, studies
from acl_gym.reproduction.settings import Experiment, Setting
from acl_gym.reproduction.systems import row, swing, vehicle, world

OTHER_ORDERS = tuple(order for order in orders.ORDERS if order != orders.TWO_PHASES)
OTHER_LIMITS = (7.0, 15.0)
"""omega_max in rad/s, beside the 9 that are taken elsewhere."""

GAMMAS_PENDULUM = (0.01, 0.1)
GAMMAS_OTHER = (0.05, 0.2, 0.5)
LONG = 300
"""Trials of a long run on the pendulum."""

LONG_RUNS = (("crisp", 0.1), ("crisp", 0.5), ("fuzzy", 0.001), ("fuzzy", 1.0))
"""Partition and rho of these."""

MANY = 624
"""Fuzzy ants of N = 64 in Figure 5.17."""


def ordered(setting: Setting, order: str) -> Setting:
    """A setting under another reading of the local update."""
    return replace(setting, order=order)


def limited(setting: Setting, omega_max: float) -> Setting:
    """The pendulum with another bound on its velocity."""
    return replace(setting, env={"omega_max": omega_max})


def long(kind: str, rho: float) -> Setting:
    """The pendulum, three times as many trials."""
    return replace(swing(kind, global_decay=rho), trials=LONG)


def roomy(n: int) -> Setting:
    """The fuzzy pendulum on n x (n + 1) cells, with as many ants as on the finest."""
    return swing("fuzzy", MANY, (n, n + 1))


WORLD_CHOICES = {
    "alpha = 1": {"alpha": 1.0},
    "alpha = 2": {"alpha": 2.0},
    "M = 172": {"ants": 172},
}


def choice(p: float, name: str) -> Setting:
    """The 2-D grid with one of `WORLD_CHOICES`."""
    return world(p=p, **WORLD_CHOICES[name])  # type: ignore[arg-type]


ROW_CHOICES = {
    "alpha = 1": replace(row(alpha=1.0), ants=1),
    "alpha = 2": replace(row(alpha=2.0), ants=1),
    "tau0 = 0.0001": replace(row(tau0=1e-4), ants=1),
    "epsilon = 0.1": replace(row(selection="max_boltzmann", epsilon=0.1), ants=1),
    "tabu list": replace(row(tabu=True), ants=1),
    "K = 1000": replace(row(), ants=1, trials=1000),
}

PATIENT = replace(
    vehicle("time", "fuzzy", "membership", max_steps=600), evaluation_steps=150
)
"""The navigation with four times as long walks in learning."""

EXPERIMENTS = (
    Experiment(
        "row-choices",
        "1-D grid: one ant, other choices",
        "§3.6.5",
        studies(ROW_CHOICES),
        "bands",
        text="Chapter 3 names no alpha, tau0, epsilon and K: what one ant does with "
        "others.",
        explains=("C5",),
    ),
    Experiment(
        "row-orders",
        "1-D grid: other readings of the local update",
        "§3.6.4",
        studies(
            {
                f"{order}, gamma = {gamma:g}": ordered(row(local_decay=gamma), order)
                for order in OTHER_ORDERS
                for gamma in GAMMAS_OTHER
            }
        ),
        "bands",
        text="One phase: each ant in turn chooses and decays. Once an ant: a pair decays "
        "once for each ant that has visited it, (3.13). Once a trial: whoever visited "
        "it. Elsewhere all ants choose, then all decay, at each visit.",
        explains=("C4",),
    ),
    Experiment(
        "world-choices",
        "2-D grid: other choices",
        "§3.6.7",
        studies(
            {
                f"p = {p:g}, {name}": choice(p, name)
                for p in (0.5, 0.9)
                for name in WORLD_CHOICES
            }
        ),
        "bands",
        text="Chapter 3 names no alpha; elsewhere it is 3, and there are 86 ants.",
        explains=("C6", "C7"),
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
        text="The goal is reached where its membership function exceeds 0.5 (§4.3.2), "
        "not within the bounds of Table 4.1: the thesis names both rules.",
        options={"columns": 2},
        explains=("C9", "C10", "C11", "C12"),
    ),
    Experiment(
        "navigation-long",
        "Navigation, time-spent cost: longer walks",
        "§4.5.3",
        studies(fewer({"fuzzy, T = 600": PATIENT})),
        "bands",
        text="The goal rule of §4.3.2; ants may walk four times as long, policies are "
        "evaluated over 150 steps as elsewhere.",
        explains=("C12",),
    ),
    Experiment(
        "omega-max",
        "Pendulum with other bounds on the velocity",
        "§5.2.2",
        studies(
            fewer(
                {
                    f"{kind}, gamma = {number(gamma)}, omega_max = {limit:g}": limited(
                        swing(kind, local_decay=gamma), limit
                    )
                    for kind in KINDS
                    for gamma in GAMMAS_PENDULUM
                    for limit in OTHER_LIMITS
                }
            )
        ),
        "bands",
        text="The thesis does not name omega_max; 9 rad/s is taken elsewhere. The cells "
        "cover the same range.",
        options={"columns": 2},
        explains=("C15", "C16", "C18"),
    ),
    Experiment(
        "local-update",
        "Pendulum: other readings of the local update",
        "§5.3.2",
        studies(
            fewer(
                {
                    f"{kind}, {order}, gamma = {number(gamma)}": ordered(
                        swing(kind, local_decay=gamma), order
                    )
                    for kind in KINDS
                    for order in OTHER_ORDERS
                    for gamma in GAMMAS_PENDULUM
                }
            )
        ),
        "bands",
        text="The readings of row-orders.",
        options={"columns": 2},
        explains=("C15", "C16", "C18"),
    ),
    Experiment(
        "pendulum-long",
        "Pendulum: more trials",
        "§5.3.1",
        studies(
            fewer(
                {f"{kind}, rho = {rho:g}": long(kind, rho) for kind, rho in LONG_RUNS}
            )
        ),
        "bands",
        text=f"K = {LONG}: whether what has not settled after 100 trials does so later.",
        explains=("C13", "C14"),
    ),
    Experiment(
        "fuzzy-ants",
        "Pendulum, fuzzy, varying partition, one number of ants",
        "§5.3.4",
        studies(fewer({f"N = {n}, M = {MANY}": roomy(n) for n in (16, 32)})),
        "bands_and_policies",
        text="The coarse partitions of Figure 5.17 with as many ants as the finest one.",
        explains=("C19",),
    ),
)
