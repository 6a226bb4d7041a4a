"""Figures of chapter 5: the pendulum."""

from __future__ import annotations

from acl_gym.reproduction.catalogue.common import (
    ANTS,
    GAMMAS,
    KINDS,
    RHOS,
    number,
    studies,
)
from acl_gym.reproduction.settings import Experiment, Study
from acl_gym.reproduction.systems import swing


def _cells_of(kind: str, n: int) -> tuple[int, int, int]:
    """N_theta, N_omega, and M: 60% of the states for crisp ants, 15% for fuzzy."""
    share = 0.6 if kind == "crisp" else 0.15
    return n, n + 1, round(share * n * (n + 1))


def partitions(kind: str) -> tuple[Study, ...]:
    """The panels of Figure 5.16, crisp, or 5.17, fuzzy."""
    found = {}
    for n in (16, 32, 64):
        n_theta, n_omega, ants = _cells_of(kind, n)
        label = f"N = {n}, M = {ants}"
        found[label] = swing(kind, ants, (n_theta, n_omega))
    return studies(found)


EXPERIMENTS = (
    Experiment(
        "fig5.2",
        "Pendulum, crisp, varying rho",
        "§5.3.1",
        studies({f"rho = {number(r)}": swing("crisp", global_decay=r) for r in RHOS}),
        "bands",
        ("C13",),
        "gamma = 0.01, 250 ants, Table 5.2; omega_max = 9 rad/s is a decision.",
    ),
    Experiment(
        "fig5.3",
        "Pendulum swung up by the crisp policy, rho = 0.001",
        "§5.3.1",
        studies({"crisp, rho = 0.001": swing("crisp", global_decay=0.001)}),
        "swing",
        ("C18",),
        "From hanging at rest, by the last policy of the run with the cheapest one.",
    ),
    Experiment(
        "fig5.4",
        "Pendulum, fuzzy, varying rho",
        "§5.3.1",
        studies({f"rho = {number(r)}": swing("fuzzy", global_decay=r) for r in RHOS}),
        "bands",
        ("C14",),
        "gamma = 0.01, 250 ants.",
    ),
    Experiment(
        "fig5.5",
        "Pendulum swung up by the fuzzy policy, rho = 0.1",
        "§5.3.1",
        studies({"fuzzy, rho = 0.1": swing("fuzzy")}),
        "swing",
        ("C18",),
    ),
    Experiment(
        "fig5.6",
        "Pendulum, policies, gamma = 0.01",
        "§5.3.1",
        studies({kind: swing(kind) for kind in KINDS}),
        "policies",
        ("C20",),
        "White is the full positive torque, black the full negative one, grey none; on "
        "a grid four times finer than the partition. rho = 0.1.",
    ),
    Experiment(
        "fig5.7",
        "Pendulum, crisp, varying gamma",
        "§5.3.2",
        studies(
            {f"gamma = {number(g)}": swing("crisp", local_decay=g) for g in GAMMAS}
        ),
        "bands",
        ("C15",),
        "rho = 0.1, 250 ants. gamma = 1 lies outside of the range that the thesis gives "
        "it; 0.999999 is taken.",
    ),
    Experiment(
        "fig5.8",
        "Pendulum swung up by the crisp policy, gamma = 0.1",
        "§5.3.2",
        studies({"crisp, gamma = 0.1": swing("crisp", local_decay=0.1)}),
        "swing",
        ("C18",),
    ),
    Experiment(
        "fig5.9",
        "Pendulum, fuzzy, varying gamma",
        "§5.3.2",
        studies(
            {f"gamma = {number(g)}": swing("fuzzy", local_decay=g) for g in GAMMAS}
        ),
        "bands",
        ("C16",),
        "rho = 0.1, 250 ants.",
    ),
    Experiment(
        "fig5.10",
        "Pendulum swung up by the fuzzy policy, gamma = 0.1",
        "§5.3.2",
        studies({"fuzzy, gamma = 0.1": swing("fuzzy", local_decay=0.1)}),
        "swing",
        ("C18",),
    ),
    Experiment(
        "fig5.11",
        "Pendulum, policies, gamma = 0.1",
        "§5.3.2",
        studies({kind: swing(kind, local_decay=0.1) for kind in KINDS}),
        "policies",
        ("C20",),
    ),
    Experiment(
        "fig5.12",
        "Pendulum, crisp, varying number of ants",
        "§5.3.3",
        studies({f"M = {m}": swing("crisp", m) for m in ANTS}),
        "bands",
        ("C17",),
        "rho = 0.1, gamma = 0.01.",
    ),
    Experiment(
        "fig5.13",
        "Pendulum swung up by the crisp policy of 2000 ants",
        "§5.3.3",
        studies({"crisp, M = 2000": swing("crisp", 2000)}),
        "swing",
        ("C18",),
    ),
    Experiment(
        "fig5.14",
        "Pendulum, fuzzy, varying number of ants",
        "§5.3.3",
        studies({f"M = {m}": swing("fuzzy", m) for m in ANTS}),
        "bands",
        ("C17",),
    ),
    Experiment(
        "fig5.15",
        "Pendulum, policies of 2000 crisp and 250 fuzzy ants",
        "§5.3.3",
        studies(
            {"crisp, M = 2000": swing("crisp", 2000), "fuzzy, M = 250": swing("fuzzy")}
        ),
        "policies",
        ("C20",),
    ),
    Experiment(
        "fig5.16",
        "Pendulum, crisp, varying partition",
        "§5.3.4",
        partitions("crisp"),
        "bands_and_policies",
        ("C19",),
        "N = N_theta = N_omega - 1; ants are 60% of the states.",
    ),
    Experiment(
        "fig5.17",
        "Pendulum, fuzzy, varying partition",
        "§5.3.4",
        partitions("fuzzy"),
        "bands_and_policies",
        ("C19",),
        "Ants are 15% of the states.",
    ),
)
