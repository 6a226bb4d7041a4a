"""Every experiment of chapters 3 to 5, as data: adding one is adding an entry.

Parameters are those of Tables 4.1 and 5.2; what the thesis leaves open is decided in
one place each, below, and said in the text of the experiment.
"""

from __future__ import annotations

from dataclasses import replace

from acl_gym.reproduction.settings import Experiment, Setting, Study
from acl_gym.reproduction.systems import row, swing, two_state, vehicle, world

RUNS = 30
"""Runs of each setting, as in the thesis; their seeds are 0 to 29."""

NEARLY_ONE = 0.999999
"""For gamma = 1, which lies outside of the range [0, 1) of (3.11)."""


def studies(settings: dict[str, Setting]) -> tuple[Study, ...]:
    """Settings under their labels."""
    return tuple(Study(label, setting) for label, setting in settings.items())


RHOS_ROW = (0.0, 0.1, 0.2, 0.5, 0.9, 1.0)
GAMMAS_ROW = (0.01, 0.05, 0.1, 0.2, 0.5, 0.9)
RHOS = (0.0, 0.001, 0.01, 0.1, 0.5, 1.0)
GAMMAS = (0.0, 0.001, 0.01, 0.1, 0.5, NEARLY_ONE)
ANTS = (100, 250, 500, 1000, 1500, 2000)
SIZES = {"11x11": 86, "21x21": 278, "31x31": 640}
KINDS = ("crisp", "fuzzy")
_NUMBER = {NEARLY_ONE: "1"}


def number(value: float) -> str:
    """A parameter as a figure labels it."""
    return _NUMBER.get(value, f"{value:g}")


def _both(cost: str, rule: str = "bounds") -> tuple[Study, ...]:
    return studies({kind: vehicle(cost, kind, rule) for kind in KINDS})


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


_GAPS = {
    f"M = {m}, gamma = {number(gamma)}": two_state(m, local_decay=gamma)
    for m in (1, 2, 8)
    for gamma in (0.0, 0.1, 0.5)
}

_GOAL = (
    "200 ants, Table 4.1, K = 200; the goal is reached within 0.25 m and 0.05 m/s. The "
    "other goal rule of the thesis is in navigation-rules."
)
_SLICE = (
    "A slice through the policy at rest, and the ways of vehicles that start at rest, "
    "over the damping field; the last policy of the run with the cheapest one."
)
_BASELINE = (
    "The policy of fuzzy Q-iteration on the same cells, which knows the model; the best "
    "of discounts 1, 0.98 and 0.95."
)

_QUADRATIC = (
    Experiment(
        "fig4.6",
        "Navigation, quadratic cost: cost of the policy",
        "§4.5.2",
        _both("quadratic"),
        "bands",
        ("C9", "C11"),
        _GOAL,
    ),
    Experiment(
        "fig4.7",
        "Navigation, quadratic cost: policy variation",
        "§4.5.2",
        _both("quadratic"),
        "bands",
        ("C10",),
        "The share of cells whose action differs from that of the trial before.",
        {"measure": "policy_variation"},
    ),
    Experiment(
        "fig4.8",
        "Navigation, quadratic cost: sensitivity",
        "§4.5.2",
        _both("quadratic"),
        "bands",
        ("C10",),
        "Sensitivity (3.48), the mean over the cells.",
        {"measure": "sensitivity"},
    ),
    Experiment(
        "fig4.9",
        "Navigation, quadratic cost: best policies",
        "§4.5.2",
        _both("quadratic"),
        "policies",
        (),
        _SLICE,
    ),
    Experiment(
        "fig4.10",
        "Navigation, quadratic cost: fuzzy Q-iteration",
        "§4.5.2",
        _both("quadratic")[1:],
        "baseline",
        ("C11",),
        _BASELINE,
    ),
)

_TIME_SPENT = (
    Experiment(
        "fig4.11",
        "Navigation, time-spent cost: cost of the policy",
        "§4.5.3",
        _both("time"),
        "bands",
        ("C12",),
        _GOAL,
    ),
    Experiment(
        "fig4.12",
        "Navigation, time-spent cost: policy variation",
        "§4.5.3",
        _both("time"),
        "bands",
        (),
        "The share of cells whose action differs from that of the trial before.",
        {"measure": "policy_variation"},
    ),
    Experiment(
        "fig4.13",
        "Navigation, time-spent cost: best policies",
        "§4.5.3",
        _both("time"),
        "policies",
        ("C12",),
        _SLICE,
    ),
    Experiment(
        "fig4.14",
        "Navigation, time-spent cost: fuzzy Q-iteration",
        "§4.5.3",
        _both("time")[1:],
        "baseline",
        ("C12",),
        _BASELINE,
    ),
)

EXPERIMENTS: tuple[Experiment, ...] = (
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
        ("C21", "C23"),
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
    *_QUADRATIC,
    *_TIME_SPENT,
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

BY_NAME = {experiment.name: experiment for experiment in EXPERIMENTS}
