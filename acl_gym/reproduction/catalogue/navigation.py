"""Figures of chapter 4: the navigation."""

from __future__ import annotations

from acl_gym.reproduction.catalogue.common import KINDS, studies
from acl_gym.reproduction.settings import Experiment, Study
from acl_gym.reproduction.systems import vehicle


def _both(cost: str, rule: str = "bounds") -> tuple[Study, ...]:
    return studies({kind: vehicle(cost, kind, rule) for kind in KINDS})


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

EXPERIMENTS = (*_QUADRATIC, *_TIME_SPENT)
